use lo_cone::Rendering;
use lo_geometry::{Quat, Vec3};
use lo_scene::Room;

/// A frame aligned with gravity: +Y is up, the camera is at the origin and its heading is −Z.
///
/// Rotates panoramas and points from the frame of a tilted camera, so that gravity points straight down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelFrame {
    /// Unit quaternion.
    level_from_camera: Quat,
}

impl LevelFrame {
    /// Derives the frame from the up direction of a room.
    pub fn new(room: &Room) -> Self {
        Self { level_from_camera: Quat::from_mat3(&room.level_from_camera()).normalize() }
    }

    /// Rotation of directions from the camera's frame into this one.
    pub fn level_from_camera(&self) -> Quat {
        self.level_from_camera
    }

    /// Pitch (upwards) and roll (clockwise for the photographer) of the camera in degrees, each in [−90, 90].
    pub fn camera_pitch_roll_deg(&self) -> [f32; 2] {
        let [ahead, right] = [Vec3::NEG_Z, Vec3::X].map(|axis| self.level_from_camera * axis);
        [ahead.y, 0.0 - right.y].map(|sine| sine.clamp(-1.0, 1.0).asin().to_degrees())
    }

    /// Transforms a point in metres from the camera's frame into this one.
    pub fn point(&self, camera_m: Vec3) -> Vec3 {
        self.level_from_camera * camera_m
    }

    /// Rows to render for a rotated panorama of `height` rows: twice as many, because rotation resamples.
    pub fn rendered_height(height: usize) -> usize {
        2 * height
    }

    /// Rotates an equirectangular panorama into this frame and resamples it to `2 * height` × `height` pixels.
    ///
    /// Radiance is averaged. Distance and opacity take the nearest pixel, so that surfaces never mix.
    ///
    /// # Panics
    /// If the panorama has no pixels.
    pub fn panorama(&self, camera: &Rendering, height: usize) -> Rendering {
        let (rotation, width) = (self.level_from_camera, 2 * height);
        let nearest = lo_imaging::rotate_equirectangular_nearest;
        Rendering {
            radiance: lo_imaging::rotate_equirectangular(&camera.radiance, rotation, width, height),
            distance_m: nearest(&camera.distance_m, rotation, width, height),
            opacity: nearest(&camera.opacity, rotation, width, height),
        }
    }
}

#[cfg(test)]
mod tests {
    use lo_geometry::pixel_direction;
    use lo_imaging::Image;

    use super::*;

    fn frame(up: Vec3) -> LevelFrame {
        LevelFrame::new(&Room { up: up.normalize(), planes: Vec::new() })
    }

    #[test]
    fn a_point_straight_up_stays_up() {
        for up in [Vec3::Y, Vec3::new(0.1, 0.9, 0.4), Vec3::new(-0.2, 0.8, -0.5), Vec3::Z] {
            let above = frame(up).point(2.0 * up.normalize());
            assert!((above - 2.0 * Vec3::Y).length() < 1e-5, "{up}: {above}");
        }
    }

    #[test]
    fn pitch_and_roll_are_those_of_the_camera() {
        let level_from_camera = Quat::from_rotation_x(0.3) * Quat::from_rotation_z(-0.1);
        let [pitch_deg, roll_deg] = LevelFrame { level_from_camera }.camera_pitch_roll_deg();
        assert!((pitch_deg - 0.3f32.to_degrees()).abs() < 1e-3, "{pitch_deg}");
        // The camera's right side is 0.1 rad lower; pitch scales its sine by cos 0.3.
        assert!((roll_deg - (0.1f32.sin() * 0.3f32.cos()).asin().to_degrees()).abs() < 1e-3, "{roll_deg}");
    }

    #[test]
    fn a_panorama_rotated_there_and_back_agrees() {
        let (width, height) = (256, 128);
        let value = |x, y| 2.0 + pixel_direction(x, y, width, height).dot(Vec3::new(0.6, 0.0, -0.8));
        let original = Rendering {
            radiance: Image::from_fn(width, height, |x, y| [value(x, y); 3]),
            distance_m: Image::from_fn(width, height, value),
            opacity: Image::from_fn(width, height, |_, _| 1.0),
        };
        let there = frame(Vec3::new(0.1, 0.9, 0.4));
        let back = LevelFrame { level_from_camera: there.level_from_camera.inverse() };
        let result = back.panorama(&there.panorama(&original, height), height);
        assert_eq!((result.radiance.width(), result.distance_m.height()), (width, height));
        // The value changes by at most 0.0245 per pixel. Interpolation is of second order, so off by less than 0.0245².
        // The nearest pixel is off by up to 0.71 pixels in each of two rotations.
        for (radiance, expected) in result.radiance.pixels().iter().zip(original.radiance.pixels()) {
            assert!((radiance[1] - expected[1]).abs() < 6e-4, "{radiance:?} {expected:?}");
        }
        for (distance_m, expected) in result.distance_m.pixels().iter().zip(original.distance_m.pixels()) {
            assert!((distance_m - expected).abs() < 0.036, "{distance_m} {expected}");
        }
        assert!(result.opacity.pixels().iter().all(|&opacity| opacity == 1.0));
    }
}
