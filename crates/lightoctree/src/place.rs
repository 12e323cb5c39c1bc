use geometry::{Vec3, orthonormal_basis};
use scene::{Scene, Side};

/// Why there is no point where one was asked for.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlaceError {
    /// Outside of the picture.
    #[error("pixel ({u}, {v}) lies outside of the {width} × {height} photo")]
    OutsidePhoto {
        /// Horizontal position as given.
        u: f64,
        /// Vertical position as given.
        v: f64,
        /// Width of the photo.
        width: u32,
        /// Height of the photo.
        height: u32,
    },
    /// A hole in the depth map.
    #[error("there is no depth reading at pixel ({u}, {v}) or near it; choose another pixel or give --at X,Y,Z")]
    NoDepth {
        /// Horizontal position as given.
        u: f64,
        /// Vertical position as given.
        v: f64,
    },
}

/// How far around a pixel a depth reading is looked for, in depth pixels.
const SEARCH_RADIUS: isize = 3;

/// The surface point seen at photo position `(u, v)` and the unit normal there, towards the camera.
///
/// Takes the nearest reading within three depth pixels, so that single holes do no harm.
///
/// # Errors
/// A position outside of the photo, no reading near it.
pub fn surface_at_pixel(scene: &Scene, u: f64, v: f64) -> Result<(Vec3, Vec3), PlaceError> {
    let camera = &scene.frame.camera;
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    if !((0.0..width).contains(&u) && (0.0..height).contains(&v)) {
        return Err(PlaceError::OutsidePhoto { u, v, width: camera.width, height: camera.height });
    }
    let depth = &scene.frame.depth_m;
    let (columns, rows) = (depth.width() as isize, depth.height() as isize);
    let (x, y) = ((u / width * columns as f64) as isize, (v / height * rows as f64) as isize);
    let reading = |dx: isize, dy: isize| {
        let (x, y) = (x + dx, y + dy);
        ((0..columns).contains(&x) && (0..rows).contains(&y))
            .then(|| depth[(x as usize, y as usize)])
            .filter(|&z| z > 0.0)
    };
    let mut nearest: Option<(isize, f32)> = None;
    for dy in -SEARCH_RADIUS..=SEARCH_RADIUS {
        for dx in -SEARCH_RADIUS..=SEARCH_RADIUS {
            let distance = dx * dx + dy * dy;
            if let Some(depth_m) = reading(dx, dy).filter(|_| nearest.is_none_or(|(best, _)| distance < best)) {
                nearest = Some((distance, depth_m));
            }
        }
    }
    let (_, depth_m) = nearest.ok_or(PlaceError::NoDepth { u, v })?;
    let point = camera.unproject(u, v, f64::from(depth_m));
    let normals = scene.frame.normals();
    let normal = normals[(x as usize, y as usize)].unwrap_or_else(|| -point.normalize());
    Ok((point, normal))
}

/// The centres of `counts` cells that divide the inside of the room, x fastest, then y, then z.
///
/// The inside is what the room's planes enclose along its own axes; without planes, the box around the occupied leaves.
pub fn probe_grid(scene: &Scene, counts: [usize; 3]) -> Vec<Vec3> {
    let (axes, low, high) = inside(scene);
    let mut points = Vec::with_capacity(counts.iter().product());
    let at = |axis: usize, i: usize| low[axis] + (high[axis] - low[axis]) * (i as f32 + 0.5) / counts[axis] as f32;
    for k in 0..counts[2] {
        for j in 0..counts[1] {
            for i in 0..counts[0] {
                points.push(axes * Vec3::new(at(0, i), at(1, j), at(2, k)));
            }
        }
    }
    points
}

/// Axes of the room as columns (y is up), and the lowest and highest coordinate along each.
fn inside(scene: &Scene) -> (geometry::Mat3, Vec3, Vec3) {
    let occupied = occupied_corners(scene);
    let Some(room) = &scene.room else {
        let (low, high) = bounds(occupied.into_iter());
        return (geometry::Mat3::IDENTITY, low, high);
    };
    let wall = room.planes.iter().find(|plane| plane.side == Side::Wall).map(|plane| plane.plane.normal);
    let z =
        wall.map(|normal| (normal - room.up * normal.dot(room.up)).normalize_or_zero()).filter(|z| *z != Vec3::ZERO);
    let z = z.unwrap_or_else(|| orthonormal_basis(room.up).x_axis);
    let axes = geometry::Mat3::from_cols(room.up.cross(z), room.up, z);
    let (mut low, mut high) = bounds(occupied.into_iter().map(|point| axes.transpose() * point));
    for plane in &room.planes {
        let normal = axes.transpose() * plane.plane.normal;
        let axis = (0..3).max_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs())).unwrap_or(0);
        let at = plane.plane.offset_m / normal[axis];
        if normal[axis] > 0.0 {
            low[axis] = low[axis].max(at);
        } else {
            high[axis] = high[axis].min(at);
        }
    }
    (axes, low.min(high), high)
}

/// Lowest and highest corner of every occupied finest leaf, world frame.
fn occupied_corners(scene: &Scene) -> Vec<Vec3> {
    let light = &scene.light;
    let depth = light.octree.depth();
    let edge_m = light.cube.node_edge_m(depth);
    let level = &light.octree.levels()[depth as usize];
    let mut corners = Vec::new();
    for (&key, _) in level.keys.iter().zip(&level.rows).filter(|(_, row)| **row >= 0) {
        let [x, y, z] = octree::xyz_from_key(key);
        let low = light.cube.origin_m + Vec3::new(x as f32, y as f32, z as f32) * edge_m;
        corners.extend([low, low + Vec3::splat(edge_m)]);
    }
    corners
}

fn bounds(points: impl Iterator<Item = Vec3>) -> (Vec3, Vec3) {
    points.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), point| (low.min(point), high.max(point)))
}
