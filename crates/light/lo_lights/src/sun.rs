use lo_geometry::Vec3;
use lo_scene::Scene;

/// Unit direction towards a sun: degrees to the right of where the camera looks, about the vertical, and above the horizon.
pub fn sun_direction(scene: &Scene, azimuth_deg: f64, elevation_deg: f64) -> Vec3 {
    let (azimuth, elevation) = (azimuth_deg.to_radians() as f32, elevation_deg.to_radians() as f32);
    let level = Vec3::new(azimuth.sin() * elevation.cos(), elevation.sin(), -azimuth.cos() * elevation.cos());
    scene.room.as_ref().map_or(level, |room| room.level_from_camera().transpose() * level).normalize()
}

/// Azimuth and elevation of a direction, as [`sun_direction`] takes them.
pub fn sun_angles_deg(scene: &Scene, direction: Vec3) -> [f64; 2] {
    let level = scene.room.as_ref().map_or(direction, |room| room.level_from_camera() * direction);
    let azimuth = f64::from(level.x).atan2(-f64::from(level.z));
    let elevation = f64::from(level.y).clamp(-1.0, 1.0).asin();
    [azimuth.to_degrees(), elevation.to_degrees()]
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
        let level = Scene::as_seen(light, frame);
        let up = Vec3::new(0.1, 0.9, 0.3).normalize();
        let tilted = Scene { room: Some(Room { up, planes: Vec::new() }), ..level.clone() };
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
}
