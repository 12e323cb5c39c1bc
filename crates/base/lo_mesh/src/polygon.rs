use lo_geometry::Vec3;

/// Number of corners beyond which polygons are triangulated as a fan: ear clipping takes quadratic time.
const MAX_CLIPPED_CORNERS: usize = 1000;

/// Triangulates a simple polygon, convex or not, by ear clipping in the plane of its Newell normal.
///
/// `points` are its corners in order. `triangle` receives indices into them; fewer than three corners give no triangle.
pub(crate) fn triangulate(points: &[Vec3], mut triangle: impl FnMut([usize; 3])) {
    let count = points.len();
    if count <= 3 || count > MAX_CLIPPED_CORNERS {
        (2..count).for_each(|i| triangle([0, i - 1, i]));
        return;
    }
    let flat = projected(points);
    let mut ring: Vec<usize> = (0..count).collect();
    let mut at = 0;
    let mut misses = 0;
    while ring.len() > 3 {
        let n = ring.len();
        let [a, b, c] = [ring[(at + n - 1) % n], ring[at], ring[(at + 1) % n]];
        let is_ear = turn(flat[a], flat[b], flat[c]) > 0.0
            && !ring.iter().any(|&p| p != a && p != b && p != c && inside(flat[p], flat[a], flat[b], flat[c]));
        // A self-intersecting or degenerate polygon may have no ear: then clip any corner.
        if is_ear || misses >= n {
            triangle([a, b, c]);
            ring.remove(at);
            at %= ring.len();
            misses = 0;
        } else {
            at = (at + 1) % n;
            misses += 1;
        }
    }
    triangle([ring[0], ring[1], ring[2]]);
}

/// Projects the corners onto the coordinate plane that the polygon faces most, counter-clockwise.
fn projected(points: &[Vec3]) -> Vec<[f64; 2]> {
    let next = points.iter().cycle().skip(1);
    // Newell normal, relative to a corner to avoid cancellation of large coordinates.
    let origin = points[0].as_dvec3();
    let normal = points.iter().zip(next).fold(lo_geometry::Vec3::ZERO.as_dvec3(), |sum, (a, b)| {
        sum + (a.as_dvec3() - origin).cross(b.as_dvec3() - origin)
    });
    let size = normal.abs();
    let [x, y, sign] = if size.z >= size.x && size.z >= size.y {
        [0.0, 1.0, normal.z]
    } else if size.y >= size.x {
        [2.0, 0.0, normal.y]
    } else {
        [1.0, 2.0, normal.x]
    };
    let (x, y) = (x as usize, y as usize);
    points
        .iter()
        .map(|p| {
            let p = p.as_dvec3() - origin;
            [if sign < 0.0 { -p[x] } else { p[x] }, p[y]]
        })
        .collect()
}

/// Twice the signed area; positive if a, b, c turn left.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

fn inside(p: [f64; 2], a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> bool {
    p != a && p != b && p != c && turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::repair::face_normal;

    fn area_and_count(points: &[Vec3]) -> (f32, usize) {
        let (mut area, mut count) = (0.0, 0);
        let mut normal = Vec3::ZERO;
        triangulate(points, |t| {
            let [a, b, c] = t.map(|i| points[i]);
            area += (b - a).cross(c - a).length() / 2.0;
            count += 1;
            let n = face_normal([a, b, c]);
            assert!(normal == Vec3::ZERO || normal.distance(n) < 1e-5, "a triangle is flipped");
            normal = n;
        });
        (area, count)
    }

    #[test]
    fn concave_polygons_keep_their_area() {
        // An L shape of area 3 in each coordinate plane, from both sides.
        let l = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        let planes: [fn([f32; 2]) -> Vec3; 3] =
            [|[u, v]| Vec3::new(u, v, 3.0), |[u, v]| Vec3::new(v, 3.0, u), |[u, v]| Vec3::new(3.0, u, v)];
        for place in planes {
            let mut points = l.map(place).to_vec();
            for _ in 0..2 {
                let (area, count) = area_and_count(&points);
                assert_eq!(count, 4);
                assert!((area - 3.0).abs() < 1e-5, "{area}");
                points.reverse();
            }
        }
    }

    #[test]
    fn a_comb_is_cut_without_overlap() {
        // Teeth of area 1 each on a bar of area 7, sheared.
        let mut points = vec![Vec3::new(7.0, 0.0, 0.0), Vec3::new(7.0, 1.0, 0.0)];
        for tooth in (0..4).rev() {
            let x = tooth as f32 * 2.0;
            points.extend([[x + 1.0, 1.0], [x + 1.0, 2.0], [x, 2.0], [x, 1.0]].map(|[x, y]| Vec3::new(x, y, 0.0)));
        }
        points.remove(points.len() - 1);
        points.push(Vec3::ZERO);
        points.remove(1);
        let (area, count) = area_and_count(&points);
        assert_eq!(count, points.len() - 2);
        let expected =
            points.iter().zip(points.iter().cycle().skip(1)).map(|(a, b)| a.x * b.y - b.x * a.y).sum::<f32>() / 2.0;
        assert!((area - expected).abs() < 1e-4, "{area} {expected}");
    }

    #[test]
    fn odd_polygons_do_not_hang() {
        assert_eq!(area_and_count(&[]).1, 0);
        assert_eq!(area_and_count(&[Vec3::ZERO, Vec3::X]).1, 0);
        let mut count = 0;
        triangulate(&[Vec3::ONE; 7], |_| count += 1);
        triangulate(&[Vec3::NAN; 5], |_| count += 1);
        let bow_tie = [Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0), Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0)];
        triangulate(&bow_tie, |_| count += 1);
        assert_eq!(count, 5 + 3 + 2);
    }
}
