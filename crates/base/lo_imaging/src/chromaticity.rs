//! Conversion between RGB primaries (SMPTE RP 177-1993).

/// CIE xy of red, green, blue and white of Rec. 709 (ITU-R BT.709-6, table 1).
pub(crate) const REC709: [[f64; 2]; 4] = [[0.64, 0.33], [0.3, 0.6], [0.15, 0.06], [0.3127, 0.329]];

/// Returns the matrix, row by row, from linear RGB of other primaries (red, green, blue, white as CIE xy) to Rec. 709.
///
/// White maps to white, by a von Kries scaling in RGB without further chromatic adaptation. `None` if the primaries are
/// those of Rec. 709 to three digits, or do not form a triangle.
pub(crate) fn rec709_from_primaries(primaries: [[f64; 2]; 4]) -> Option<[[f32; 3]; 3]> {
    let same = primaries.iter().flatten().zip(REC709.iter().flatten()).all(|(a, b)| (a - b).abs() < 2e-3);
    if same {
        return None;
    }
    let from = xyz_from_rgb(primaries)?;
    let to = inverse(xyz_from_rgb(REC709)?)?;
    let product = multiply(to, from);
    // rows scaled to sum 1: neutral colours stay neutral for any two whites
    let matrix = product.map(|row| row.map(|v| (v / row.iter().sum::<f64>()) as f32));
    matrix.iter().flatten().all(|v| v.is_finite() && v.abs() < 1e3).then_some(matrix)
}

fn xyz_from_rgb(primaries: [[f64; 2]; 4]) -> Option<[[f64; 3]; 3]> {
    let xyz = primaries.map(|[x, y]| [x / y, 1.0, (1.0 - x - y) / y]);
    let columns = [0, 1, 2].map(|row| [0, 1, 2].map(|column| xyz[column][row]));
    let inverse = inverse(columns)?;
    let gain = inverse.map(|row| (0..3).map(|i| row[i] * xyz[3][i]).sum::<f64>());
    Some(columns.map(|row| [row[0] * gain[0], row[1] * gain[1], row[2] * gain[2]]))
}

fn multiply(a: [[f64; 3]; 3], b: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    a.map(|row| [0, 1, 2].map(|column| (0..3).map(|i| row[i] * b[i][column]).sum()))
}

fn inverse(m: [[f64; 3]; 3]) -> Option<[[f64; 3]; 3]> {
    let minor = |r: usize, c: usize| {
        let (r0, r1, c0, c1) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        m[r0][c0] * m[r1][c1] - m[r0][c1] * m[r1][c0]
    };
    let determinant: f64 = (0..3).map(|c| m[0][c] * minor(0, c)).sum();
    let adjugate = [0, 1, 2].map(|r| [0, 1, 2].map(|c| minor(c, r) / determinant));
    adjugate.iter().flatten().all(|v| v.is_finite()).then_some(adjugate)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn rec709_to_xyz_is_the_published_matrix() {
        // IEC 61966-2-1, second row: the luminance weights
        let luminance = xyz_from_rgb(REC709).unwrap()[1];
        for (got, expected) in luminance.iter().zip([0.2126, 0.7152, 0.0722]) {
            assert!((got - expected).abs() < 1e-4);
        }
    }

    #[test]
    fn display_p3_converts_by_the_published_matrix() {
        assert_eq!(rec709_from_primaries(REC709), None);
        let p3 = [[0.68, 0.32], [0.265, 0.69], [0.15, 0.06], [0.3127, 0.329]];
        let matrix = rec709_from_primaries(p3).unwrap();
        // CSS Color 4, conversion of display-p3 to linear sRGB
        let expected = [[1.2249, -0.2249, 0.0], [-0.0421, 1.0421, 0.0], [-0.0196, -0.0786, 1.0983]];
        for (got, expected) in matrix.iter().flatten().zip(expected.iter().flatten()) {
            assert!((got - expected).abs() < 2e-4, "{matrix:?}");
        }
        assert_eq!(rec709_from_primaries([[0.3, 0.3]; 4]), None);
        assert_eq!(rec709_from_primaries([[0.0, 0.0]; 4]), None);
    }
}
