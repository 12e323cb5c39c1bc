use lo_geometry::Vec3;
use lo_scene::Estimate;

/// Returns the unit direction towards a sun, from its azimuth (degrees to the right of the camera's direction, about
/// the vertical) and elevation (degrees above the horizon).
pub fn sun_direction(scene: &Estimate, azimuth_deg: f64, elevation_deg: f64) -> Vec3 {
    let (azimuth, elevation) = (azimuth_deg.to_radians() as f32, elevation_deg.to_radians() as f32);
    let level = Vec3::new(azimuth.sin() * elevation.cos(), elevation.sin(), -azimuth.cos() * elevation.cos());
    scene.room.as_ref().map_or(level, |room| room.level_from_camera().transpose() * level).normalize()
}

/// Returns azimuth and elevation of a direction, as [`sun_direction`] takes them.
pub fn sun_angles_deg(scene: &Estimate, direction: Vec3) -> [f64; 2] {
    let level = scene.room.as_ref().map_or(direction, |room| room.level_from_camera() * direction);
    let azimuth = f64::from(level.x).atan2(-f64::from(level.z));
    let elevation = f64::from(level.y).clamp(-1.0, 1.0).asin();
    [azimuth.to_degrees(), elevation.to_degrees()]
}

/// Returns the unit direction towards a sun for which the object at one pixel of the photo casts its shadow on the
/// surface at another.
///
/// Returns `None` where depth is missing, or if the shadow would fall upwards.
pub fn sun_from_shadow(scene: &Estimate, object: [f64; 2], shadow: [f64; 2]) -> Option<Vec3> {
    let up = scene.up();
    let direction = (scene.nearest_point(object)? - scene.nearest_point(shadow)?).try_normalize()?;
    (direction.dot(up) > 0.0).then_some(direction)
}

#[cfg(test)]
mod tests {
    use lo_geometry::{Camera, Cube};
    use lo_imaging::{Image, Photo};
    use lo_octree::LightOctree;
    use lo_scene::{Frame, Room};

    use super::*;

    #[test]
    fn angles_come_back_in_level_and_in_tilted_rooms() {
        let cube = Cube::centred(Vec3::ZERO, 4.0);
        let (light, _) = LightOctree::from_points(&[], cube, 3, 2).expect("an empty octree");
        let frame = Frame {
            camera: Camera::from_hfov_deg(60.0, 4, 4).expect("a camera"),
            photo: Photo::Srgb8(Image::new(4, 4, vec![[0; 3]; 16])),
            depth_m: Image::new(4, 4, vec![1.0; 16]),
            exposure: 1.0,
        };
        let level = Estimate::observed_only(light, frame);
        let up = Vec3::new(0.1, 0.9, 0.3).normalize();
        let tilted = Estimate { room: Some(Room { up, planes: Vec::new() }), ..level.clone() };
        for (azimuth, elevation) in [(0.0, 0.0), (-60.0, 35.0), (170.0, -20.0)] {
            for scene in [&level, &tilted] {
                let [back, above] = sun_angles_deg(scene, sun_direction(scene, azimuth, elevation));
                assert!((back - azimuth).abs() < 1e-3 && (above - elevation).abs() < 1e-3, "{back} {above}");
            }
            // The elevation is the angle above the room's horizon.
            let above = sun_direction(&tilted, azimuth, elevation).dot(up).asin().to_degrees();
            assert!((f64::from(above) - elevation).abs() < 1e-3, "{above}");
        }
    }

    #[test]
    fn a_shadow_gives_the_suns_direction() {
        // A pole on a floor: its top is at the one pixel, the end of its shadow at the other.
        let camera = Camera::from_hfov_deg(70.0, 320, 240).expect("a camera");
        let (top, end) = (Vec3::new(0.3, -0.4, -3.0), Vec3::new(-0.4, -1.2, -2.6));
        let pixel = |at: Vec3| camera.project(at).map(|(u, v, _)| [u, v]).expect("in front");
        let near = |x: usize, y: usize, at: Vec3| {
            let [u, v] = pixel(at);
            (x as f64 - u).abs() < 1.5 && (y as f64 - v).abs() < 1.5
        };
        let depth = |x: usize, y: usize| match () {
            () if near(x, y, top) => -top.z,
            () if near(x, y, end) => -end.z,
            () => 6.0,
        };
        let frame = Frame {
            camera,
            photo: Photo::Srgb8(Image::new(320, 240, vec![[0; 3]; 320 * 240])),
            depth_m: Image::from_fn(320, 240, depth),
            exposure: 1.0,
        };
        let (light, _) = LightOctree::from_points(&[], Cube::centred(Vec3::ZERO, 4.0), 3, 2).expect("an empty octree");
        let mut scene = Estimate::observed_only(light, frame);
        let found = sun_from_shadow(&scene, pixel(top), pixel(end)).expect("it falls down");
        assert!(found.angle_between(top - end).to_degrees() < 0.1, "{found}");
        assert_eq!(sun_from_shadow(&scene, pixel(end), pixel(top)), None, "upwards");
        scene.frame.depth_m.pixels_mut().fill(0.0);
        assert_eq!(sun_from_shadow(&scene, pixel(top), pixel(end)), None, "no depth");
    }
}
