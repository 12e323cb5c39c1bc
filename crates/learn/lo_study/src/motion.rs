//! Placements of the objects in a method's scene, in each frame.

use lo_geometry::{Plane, Vec3};
use lo_insert::{Align, Base, Placement};
use lo_scene::LitScene;
use lo_synth::CameraPose;

use crate::path::ObjectPath;

/// Points along a path at which a method's depth is read.
const READINGS: usize = 17;

/// Fewest points with a level surface.
const MIN_READINGS: usize = 4;

/// Motion of both objects, the same in the images of all methods.
pub(crate) struct Motion<'a> {
    pub path: &'a ObjectPath,
    pub view: &'a CameraPose,
    pub base: &'a Base,
    /// Frames from one end to the other.
    pub frames: u32,
    /// Rotation from one end to the other, radians.
    pub turn_rad: f32,
}

impl Motion<'_> {
    /// Returns the share of the path of a frame: 0 at the first, 1 at the last, at rest at both ends. Played forth and
    /// back, the motion has no jump.
    fn share(&self, frame: u32) -> f32 {
        let phase = std::f32::consts::PI * frame as f32 / (self.frames - 1) as f32;
        0.5 - 0.5 * phase.cos()
    }

    /// Returns a point of the room in the photo's frame.
    fn in_photo_frame(&self, point_m: Vec3) -> Vec3 {
        self.view.pose.rotation.inverse() * (point_m - self.view.pose.position)
    }

    /// Places both objects in each frame: at their true image position and size, on the surface of a method's depth.
    ///
    /// `None` if that has no level surface along the path.
    pub fn placements(&self, scene: &LitScene) -> Option<Vec<[Placement; 2]>> {
        let track = SurfaceTrack::fit(self, scene)?;
        let at = |frame: u32, object: usize| {
            let share = self.share(frame);
            let true_m = self.in_photo_frame(self.path.base_m(object, share));
            // Along the line of sight.
            let factor = track.factor(true_m);
            let (position_m, up) = (true_m * factor, scene.up());
            Placement {
                position_m,
                scale: self.path.scale * factor,
                yaw_rad: self.turn_rad * (share - 0.5),
                up,
                support: Some(Plane::through(position_m, up)),
            }
        };
        Some((0..self.frames).map(|frame| [at(frame, 0), at(frame, 1)]).collect())
    }
}

/// Depth of a method's surface along a path.
///
/// In an image, the inverse depth of a plane is an affine function of the position. The line through the readings is
/// that of Theil and Sen, since predicted depth has outliers. Objects thus move evenly over a wavy surface.
struct SurfaceTrack {
    /// Horizontal image position of the median reading over focal length.
    origin: f32,
    /// Inverse depth there, in 1/m.
    inverse_m: f32,
    /// Its change per unit of image position.
    slope: f32,
}

impl SurfaceTrack {
    fn fit(motion: &Motion, scene: &LitScene) -> Option<Self> {
        let camera = &motion.view.camera;
        let reading = |point_m: Vec3| {
            let true_m = motion.in_photo_frame(point_m);
            let (u, v, _) = camera.project(true_m)?;
            let resting = Placement::rest_on_pixel(scene, u, v, Align::Gravity).ok()?;
            resting.support?;
            let scale = motion.path.scale * resting.position_m.length() / true_m.length();
            let settled = resting.scaled(scale).settled(scene, motion.base);
            Some((tangent(true_m), -1.0 / settled.position_m.z))
        };
        let readings: Vec<(f32, f32)> = motion.path.points_m(READINGS).filter_map(reading).collect();
        Self::through(&readings)
    }

    /// Fits image positions and inverse depths; `None` if there are too few.
    fn through(readings: &[(f32, f32)]) -> Option<Self> {
        if readings.len() < MIN_READINGS {
            return None;
        }
        let (inverse_m, slope, origin) = theil_sen(readings)?;
        Some(Self { origin, inverse_m, slope })
    }

    /// Returns the ratio of the method's depth to the true depth at the image position of a point.
    fn factor(&self, true_m: Vec3) -> f32 {
        let inverse_m = self.inverse_m + self.slope * (tangent(true_m) - self.origin);
        1.0 / (inverse_m * -true_m.z)
    }
}

/// Returns the horizontal image position over focal length, from the optical axis.
fn tangent(point_m: Vec3) -> f32 {
    point_m.x / -point_m.z
}

/// Returns the value at the median position, the slope, and that position, of the robust line through points.
fn theil_sen(points: &[(f32, f32)]) -> Option<(f32, f32, f32)> {
    let pairs = points.iter().enumerate().flat_map(|(i, a)| points[..i].iter().map(move |b| (a, b)));
    let slopes = pairs.filter(|(a, b)| a.0 != b.0).map(|(a, b)| (a.1 - b.1) / (a.0 - b.0)).collect();
    let slope = median(slopes)?;
    let origin = median(points.iter().map(|point| point.0).collect())?;
    let value = median(points.iter().map(|point| point.1 - slope * (point.0 - origin)).collect())?;
    Some((value, slope, origin))
}

fn median(mut values: Vec<f32>) -> Option<f32> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn objects_move_evenly_in_depth_of_another_scale_with_outliers() {
        // A path on a floor that leads away from the camera, whose depth is estimated 1.7 times too far.
        let point_m = |along_m: f32| Vec3::new(-0.6, -1.4, -2.0) + Vec3::new(0.8, 0.0, -0.6) * along_m;
        let points_m: Vec<Vec3> = (0..READINGS).map(|i| point_m(0.1 * i as f32)).collect();
        let reading = |true_m: &Vec3| (tangent(*true_m), -1.0 / (1.7 * true_m.z));
        let mut readings: Vec<(f32, f32)> = points_m.iter().map(reading).collect();
        for outlier in [1, 5, 6, 16] {
            readings[outlier].1 *= 0.5;
        }
        let track = SurfaceTrack::through(&readings).unwrap();
        for point_m in points_m {
            assert!((track.factor(point_m) - 1.7).abs() < 1e-3, "{}", track.factor(point_m));
        }
        assert!(SurfaceTrack::through(&readings[..MIN_READINGS - 1]).is_none());
        // All at one image position.
        assert!(SurfaceTrack::through(&[readings[0]; READINGS]).is_none());
    }
}
