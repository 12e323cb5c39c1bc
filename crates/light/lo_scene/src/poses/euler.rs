use lo_geometry::DMat3;

/// Rotation by Euler angles about fixed axes, in degrees about x, y and z. `order` names the axes in the order of
/// rotation: `"ZXY"` rotates about z first and is R_y · R_x · R_z. Nuke, Blender and USD name orders in this way.
pub(super) fn rotation(order: [char; 3], [x, y, z]: [f64; 3]) -> DMat3 {
    order.into_iter().fold(DMat3::IDENTITY, |before, axis| {
        let turn = match axis {
            'X' => DMat3::from_rotation_x(x.to_radians()),
            'Y' => DMat3::from_rotation_y(y.to_radians()),
            _ => DMat3::from_rotation_z(z.to_radians()),
        };
        turn * before
    })
}

/// Orders of rotation by their names.
pub(super) fn order_named(name: &str) -> Option<[char; 3]> {
    const ORDERS: [&str; 6] = ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"];
    let mut axes = ORDERS.into_iter().find(|order| *order == name)?.chars();
    Some([axes.next()?, axes.next()?, axes.next()?])
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::DVec3;

    use super::*;

    #[test]
    fn orders_are_those_of_usd() {
        // Rows of `ComputeLocalToWorldTransform` (OpenUSD of bpy 4.5.0) for `rotate…` of (10, 20, 30) degrees.
        for (order, rows) in [
            ("XYZ", [[0.813798, -0.44097, 0.378522], [0.469846, 0.882564, 0.018028], [-0.34202, 0.163176, 0.925417]]),
            ("XZY", [[0.813798, -0.403317, 0.418412], [0.5, 0.852869, -0.150384], [-0.296198, 0.331588, 0.895721]]),
            ("YXZ", [[0.784102, -0.492404, 0.377786], [0.521281, 0.852869, 0.029696], [-0.336824, 0.173648, 0.925417]]),
            ("YZX", [[0.813798, -0.5, 0.296198], [0.522099, 0.852869, 0.005236], [-0.255236, 0.150384, 0.955112]]),
            ("ZXY", [[0.843493, -0.418412, 0.336824], [0.492404, 0.852869, -0.173648], [-0.21461, 0.312325, 0.925417]]),
            ("ZYX", [[0.813798, -0.469846, 0.34202], [0.543838, 0.823173, -0.163176], [-0.204874, 0.318796, 0.925417]]),
        ] {
            let rows = rows.map(DVec3::from_array);
            let expected = DMat3::from_cols(rows[0], rows[1], rows[2]).transpose();
            // six decimals
            assert!(rotation(order_named(order).unwrap(), [10.0, 20.0, 30.0]).abs_diff_eq(expected, 1e-6), "{order}");
        }
        assert_eq!(order_named("XYX"), None);
    }
}
