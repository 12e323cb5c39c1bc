//! Hand-built scenes for the tests.

use lo_geometry::{Camera, Cube, Vec3};
use lo_imaging::{Image, Photo};
use lo_octree::{LightOctree, key_from_xyz};
use lo_scene::{Frame, LitScene};

/// Creates an octree from cells of its finest level with their RGBα, all observed.
pub(crate) fn light_of(cells: &[([u32; 3], [f32; 4])], cube: Cube, depth: u32) -> LightOctree {
    let mut cells: Vec<(u32, [f32; 4])> = cells.iter().map(|&(xyz, rgba)| (key_from_xyz(xyz), rgba)).collect();
    cells.sort_by_key(|cell| cell.0);
    let (keys, rgba): (Vec<u32>, Vec<[f32; 4]>) = cells.into_iter().unzip();
    let seen = vec![255; keys.len()];
    LightOctree::from_leaves(keys, rgba, seen, cube, depth, 1).expect("the test's cells are valid")
}

/// Creates a closed room around the camera: the shell of 8³ cells of 0.5 m with radiance 0.5, and a lamp of 2 × 2
/// cells with (10, 8, 6) in the middle of the ceiling. The photo has 8 × 6 pixels, one without a reading, and a
/// principal point half a pixel to the right of the centre and a quarter above.
pub(crate) fn box_room() -> LitScene {
    let cells: Vec<_> = (0..512)
        .map(|i| [i / 64, i / 8 % 8, i % 8])
        .filter(|xyz| xyz.iter().any(|c| *c == 0 || *c == 7))
        .map(|xyz| match xyz {
            [3..=4, 7, 3..=4] => (xyz, [10.0, 8.0, 6.0, 0.99]),
            _ => (xyz, [0.5, 0.5, 0.5, 0.99]),
        })
        .collect();
    let mut depth_m = Image::new(8, 6, vec![1.5; 48]);
    depth_m[(0, 0)] = 0.0;
    let photo = Photo::Srgb8(Image::from_fn(8, 6, |x, y| [(x * 30) as u8, (y * 40) as u8, 128]));
    let camera = Camera::new(5.0, 5.0, 4.5, 2.75, 8, 6).expect("the test's camera is valid");
    LitScene::observed_only(
        light_of(&cells, Cube::centred(Vec3::ZERO, 4.0), 3),
        Frame::new(photo, depth_m, camera, 1.0).expect("the test's frame is valid"),
    )
}
