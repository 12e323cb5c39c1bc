//! Depth inpainting for pixels without a reading.

use lo_geometry::{Camera, Vec2, Vec3};
use lo_imaging::{DepthMap, Image};

use crate::face::FaceGrid;
use crate::layout::RoomBox;

/// Holes narrower than twice this many pixels (at the working resolution) are slits along edges: occlusion shadows,
/// flying pixels.
const SLIT_RADIUS: usize = 3;

/// Greatest relative difference between the depths at a hole's border and the room's planes for the hole to be planar.
const ON_PLANE: f32 = 0.05;

/// Iterations of over-relaxation: enough for holes of a hundred pixels across.
const RELAXATIONS: usize = 80;

/// Returns depth for every pixel of the camera's image; readings are kept.
///
/// Slits take the farther side, since sensors fail to see the background beside an edge. Larger holes take the room's
/// planes where they touch the image border, or where half of the surrounding readings are on those planes (a shiny
/// patch of floor, a window). Elsewhere the surrounding depth is continued smoothly (a black part of a sofa).
pub(crate) fn fill_holes(depth_m: &DepthMap, camera: &Camera, room: &RoomBox) -> DepthMap {
    let mut filled = depth_m.clone();
    if depth_m.pixels().iter().all(|&z| z > 0.0) {
        return filled;
    }
    fill_slits(&mut filled);
    let boxed = |x: usize, y: usize| {
        let direction = camera.unproject(x as f64 + 0.5, y as f64 + 0.5, 1.0);
        let (_, hit) = room.exit(Vec3::ZERO, room.local(direction));
        (-room.world(hit).z).max(1e-3)
    };
    let smooth = smooth_depth(&filled);
    let (width, height) = (filled.width(), filled.height());
    let mut visited = filled.map(|&z| z > 0.0);
    for start in 0..width * height {
        if visited.pixels()[start] {
            continue;
        }
        let mut hole = vec![(start % width, start / width)];
        visited.pixels_mut()[start] = true;
        let (mut border, mut around, mut on_plane) = (false, 0usize, 0usize);
        let mut next = 0;
        while next < hole.len() {
            let (x, y) = hole[next];
            next += 1;
            border |= x == 0 || y == 0 || x + 1 == width || y + 1 == height;
            for (nx, ny) in neighbours(x, y, width, height) {
                let z = filled[(nx, ny)];
                if z > 0.0 {
                    around += 1;
                    on_plane += usize::from((boxed(nx, ny) / z - 1.0).abs() < ON_PLANE);
                } else if !visited[(nx, ny)] {
                    visited[(nx, ny)] = true;
                    hole.push((nx, ny));
                }
            }
        }
        let planar = border || 2 * on_plane >= around;
        for &(x, y) in &hole {
            filled[(x, y)] = if planar { boxed(x, y) } else { smooth[(x, y)] };
        }
        if !planar {
            relax(&mut filled, &hole);
        }
    }
    filled
}

fn neighbours(x: usize, y: usize, width: usize, height: usize) -> impl Iterator<Item = (usize, usize)> {
    let steps = [(-1, 0), (1, 0), (0, -1), (0, 1)];
    steps.into_iter().filter_map(move |(dx, dy)| {
        let (x, y) = (x.checked_add_signed(dx)?, y.checked_add_signed(dy)?);
        (x < width && y < height).then_some((x, y))
    })
}

/// Grows the farther side into holes that are narrow everywhere.
fn fill_slits(depth_m: &mut DepthMap) {
    let wide = {
        // Morphological opening of the holes: erosion by the radius, then dilation.
        let mut core = depth_m.map(|&z| z <= 0.0);
        for _ in 0..SLIT_RADIUS {
            core = spread(&core, false);
        }
        for _ in 0..=SLIT_RADIUS {
            core = spread(&core, true);
        }
        core
    };
    for _ in 0..2 * SLIT_RADIUS {
        let before = depth_m.clone();
        for y in 0..before.height() {
            for x in 0..before.width() {
                if before[(x, y)] <= 0.0 && !wide[(x, y)] {
                    let far = neighbours(x, y, before.width(), before.height()).map(|n| before[n]).fold(0.0, f32::max);
                    depth_m[(x, y)] = far;
                }
            }
        }
    }
}

/// Grows (`value` true) or shrinks the set by one pixel in the four directions; pixels outside the image count as the
/// border pixel.
fn spread(set: &Image<bool>, value: bool) -> Image<bool> {
    Image::from_fn(set.width(), set.height(), |x, y| {
        let any = set[(x, y)] == value || neighbours(x, y, set.width(), set.height()).any(|n| set[n] == value);
        any == value
    })
}

/// Fits a membrane over a hole that does not touch the image border. Inverse depth solves Laplace's equation with the
/// surrounding readings as boundary values (successive over-relaxation from a close initial value).
fn relax(depth_m: &mut DepthMap, hole: &[(usize, usize)]) {
    for _ in 0..RELAXATIONS {
        for &(x, y) in hole {
            let around =
                neighbours(x, y, depth_m.width(), depth_m.height()).map(|n| 1.0 / depth_m[n]).sum::<f32>() / 4.0;
            let own = 1.0 / depth_m[(x, y)];
            depth_m[(x, y)] = 1.0 / (own + 1.8 * (around - own)).max(1e-3);
        }
    }
}

/// Returns depth everywhere, continued smoothly in inverse depth (which keeps planes nearly planar).
fn smooth_depth(depth_m: &DepthMap) -> DepthMap {
    let (width, height) = (depth_m.width(), depth_m.height());
    let centre = |x: usize, y: usize| Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
    let mut grid = FaceGrid::new(width, height);
    for y in 0..height {
        for x in 0..width {
            let z = depth_m[(x, y)];
            if z > 0.0 {
                grid.add(centre(x, y), [1.0 / z; 3], 1.0);
            }
        }
    }
    grid.fill([0.5; 3], 1e-6);
    Image::from_fn(width, height, |x, y| 1.0 / grid.sample(centre(x, y))[0].max(1e-3))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::Mat3;

    use super::*;

    fn room() -> RoomBox {
        RoomBox {
            axes: Mat3::IDENTITY,
            low: Vec3::new(-2.0, -1.5, -4.0),
            high: Vec3::new(2.0, 1.1, 2.0),
            measured: [true; 6],
        }
    }

    fn truth(camera: &Camera) -> DepthMap {
        Image::from_fn(camera.width as usize, camera.height as usize, |x, y| {
            let direction = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
            -room().exit(Vec3::ZERO, direction).1.z
        })
    }

    #[test]
    fn holes_in_walls_and_at_the_border_lie_on_the_planes() {
        let camera = Camera::from_hfov_deg(70.0, 96, 64).unwrap();
        let truth = truth(&camera);
        let holes = Image::from_fn(96, 64, |x, y| {
            let block = (30..50).contains(&x) && (30..60).contains(&y) || x > 70 || (x * 7 + y * 13) % 11 < 3;
            if block { 0.0 } else { truth[(x, y)] }
        });
        let filled = fill_holes(&holes, &camera, &room());
        let error = |x: usize, y: usize| (filled[(x, y)] / truth[(x, y)] - 1.0).abs();
        assert!((0..64).all(|y| (72..96).all(|x| error(x, y) < 1e-4)));
        assert!((32..58).all(|y| (34..46).all(|x| error(x, y) < 1e-4)));
        // Slits take the depth of a pixel on the farther side, at most a few pixels away.
        assert!((0..64).all(|y| (0..96).all(|x| error(x, y) < 0.12)));
    }

    #[test]
    fn a_hole_inside_of_an_object_continues_the_object() {
        let camera = Camera::from_hfov_deg(70.0, 96, 64).unwrap();
        let mut depth = truth(&camera);
        for y in 10..60 {
            for x in 20..70 {
                depth[(x, y)] = if (30..60).contains(&x) && (20..50).contains(&y) { 0.0 } else { 1.0 };
            }
        }
        let filled = fill_holes(&depth, &camera, &room());
        assert!((20..50).all(|y| (30..60).all(|x| (filled[(x, y)] - 1.0).abs() < 0.01)));
        let nothing = fill_holes(&Image::new(3, 2, vec![0.0; 6]), &camera.resized(3, 2), &room());
        assert!(nothing.pixels().iter().all(|&z| z > 0.0 && z < 10.0));
    }
}
