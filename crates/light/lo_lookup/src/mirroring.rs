//! Extension of the photo over the sphere by mirroring at its borders.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use lo_geometry::{Camera, Mat3, Vec2, Vec3};
use lo_scene::Room;

/// Least share of the photo's height that is mirrored above and below it.
const LEAST_BAND: f32 = 0.25;

/// Greatest share of the photo's height, and of the angle from its border to the horizon, that is mirrored above and
/// below it. The horizon must not continue floors and ceilings.
const MOST_BAND: f32 = 0.6;

/// Greatest elevation that the photo shows, and sine of its roll, up to which its columns are treated as upright in the
/// room.
const LEVEL: (f32, f32) = (1.05, 0.3);

/// Elevations over which the mirrored photo fades into blur, since all columns meet at the poles.
const POLE_RAD: (f32, f32) = (0.8, 1.3);

/// Half-width of the blur at the poles, radians.
const POLE_BLUR_RAD: f32 = 0.5;

/// Maps directions from the camera to positions in its photo.
///
/// Inside the photo this is the projection. Outside, azimuths about the room's vertical are mirrored at the photo's
/// sides, and elevations at its top and bottom. The map is continuous on the sphere except at the poles.
pub(crate) struct Mirroring {
    camera: Camera,
    level_from_camera: Mat3,
    sides: FrustumSides,
    /// Elevations of the lower and upper ends of the photo's left and right side.
    reach_rad: [(f32, f32); 2],
    /// Number of mirror images around the rest of the circle; odd, so that the last one ends at the photo's other side.
    panels: f32,
}

/// Unit normals of the frustum's sides, pointing inwards.
struct FrustumSides {
    left: Vec3,
    right: Vec3,
    bottom: Vec3,
    top: Vec3,
}

/// A position in the photo and the footprint of a small cone there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PhotoFootprint {
    /// In pixels of the camera.
    pub at: Vec2,
    /// Half-axes of the cone's footprint, in pixels.
    pub axes: [Vec2; 2],
    /// Angle outside the photo; inside, minus the angle to the nearest border.
    pub outside_rad: f32,
}

impl Mirroring {
    /// Creates the map; `up` is the unit vector against gravity in the camera's frame.
    pub fn new(camera: Camera, up: Vec3) -> Self {
        let upright = Room { up, planes: Vec::new() };
        let level_from_camera = if is_level(&camera, up) { upright.level_from_camera() } else { Mat3::IDENTITY };
        let sides = FrustumSides::new(&camera).turned(level_from_camera);
        let elevation = |u: u32, v: u32| (level_from_camera * camera.direction(f64::from(u), f64::from(v))).y.asin();
        let reach_rad = [0, camera.width].map(|u| {
            let ends = (elevation(u, camera.height), elevation(u, 0));
            (ends.0.min(ends.1), ends.0.max(ends.1))
        });
        let middle = 0.25 * reach_rad.iter().map(|(low, high)| low + high).sum::<f32>();
        let (left, right) = sides.azimuths_rad([middle; 2]);
        let beside = (TAU - (right - left)) / (right - left);
        // The odd number with the least stretch.
        let fewer = (2.0 * ((beside - 1.0) / 2.0).floor() + 1.0).max(1.0);
        let panels = if beside * beside > fewer * (fewer + 2.0) { fewer + 2.0 } else { fewer };
        Self { camera, level_from_camera, sides, reach_rad, panels }
    }

    /// Returns width and height of the photo, in pixels.
    pub fn size(&self) -> Vec2 {
        Vec2::new(self.camera.width as f32, self.camera.height as f32)
    }

    /// Maps a unit direction and a cone of half-angle `half_angle_rad` about it to the photo.
    pub fn footprint(&self, direction: Vec3, half_angle_rad: f32) -> PhotoFootprint {
        let level = self.level_from_camera * direction;
        let inside = self.sides.inside_rad(level);
        let (azimuth, elevation) = (level.x.atan2(-level.z), level.y.clamp(-1.0, 1.0).asin());
        if inside >= 0.0 {
            return self.projected(azimuth, elevation, [half_angle_rad; 2], -inside);
        }
        let (along, beside, shrink) = self.folded_azimuth(azimuth, elevation);
        let (up, above) = self.folded_elevation(elevation, along);
        let outside = Vec2::new(beside * elevation.cos(), above).length();
        let pole = lo_geometry::smoothstep(POLE_RAD.0, POLE_RAD.1, elevation.abs());
        let half_angle = half_angle_rad.max(POLE_BLUR_RAD * pole);
        let across = (half_angle * shrink * up.cos() / elevation.cos().max(1e-3)).min(FRAC_PI_2 * 0.5);
        self.projected(along, up, [across, half_angle], outside)
    }

    /// Returns an azimuth mirrored into the photo, its angle outside the photo, and the ratio of angles inside to those
    /// outside.
    fn folded_azimuth(&self, azimuth: f32, elevation: f32) -> (f32, f32, f32) {
        let (left, right) = self.sides.azimuths_rad(self.reach_rad.map(|(low, high)| elevation.clamp(low, high)));
        let width = right - left;
        if (left..=right).contains(&azimuth) {
            return (azimuth, 0.0, 1.0);
        }
        let rest = TAU - width;
        let beyond = (azimuth - right).rem_euclid(TAU).min(rest);
        let panel = beyond * self.panels / rest;
        let share = panel.fract();
        let is_mirror = panel.floor() % 2.0 == 0.0;
        let along = if is_mirror { right - share * width } else { left + share * width };
        (along, beyond.min(rest - beyond), width * self.panels / rest)
    }

    /// Returns an elevation mirrored into the photo's column at an azimuth, and its angle above or below the photo.
    fn folded_elevation(&self, elevation: f32, azimuth: f32) -> (f32, f32) {
        let (bottom, top) = self.sides.elevations_rad(azimuth);
        // The planes of the two sides intersect beside wide, pitched photos.
        let height = (top - bottom).max(1e-3);
        let band = |border: f32| (MOST_BAND * border).clamp(LEAST_BAND * height, MOST_BAND * height);
        if elevation > top {
            (top - wave(elevation - top, band(top)), elevation - top)
        } else if elevation < bottom {
            (bottom + wave(bottom - elevation, band(-bottom)), bottom - elevation)
        } else {
            (elevation, 0.0)
        }
    }

    /// Projects a direction of the level frame; the half-angles of the cone are along azimuth and elevation.
    fn projected(&self, azimuth: f32, elevation: f32, [across, along]: [f32; 2], outside_rad: f32) -> PhotoFootprint {
        let (sin_az, cos_az) = azimuth.sin_cos();
        let (sin_el, cos_el) = elevation.sin_cos();
        let camera_from_level = self.level_from_camera.transpose();
        let direction = camera_from_level * Vec3::new(sin_az * cos_el, sin_el, -cos_az * cos_el);
        let turns = [
            camera_from_level * Vec3::new(cos_az, 0.0, sin_az) * across,
            camera_from_level * Vec3::new(-sin_az * sin_el, cos_el, cos_az * sin_el) * along,
        ];
        let Camera { fx, fy, cx, cy, .. } = self.camera;
        let (focal, centre) = (Vec2::new(fx as f32, -fy as f32), Vec2::new(cx as f32, cy as f32));
        // Folded directions are in the frustum, except some slightly outside its corners.
        let depth = (-direction.z).max(0.05);
        let flat = direction.truncate() / depth;
        let axes = turns.map(|turn| focal * (turn.truncate() + flat * turn.z) / depth);
        let size = self.size();
        let at = centre + focal * flat;
        PhotoFootprint { at: Vec2::new(wave(at.x, size.x), wave(at.y, size.y)), axes, outside_rad }
    }
}

impl FrustumSides {
    /// Returns the sides in the camera's frame.
    fn new(camera: &Camera) -> Self {
        let [fx, fy, cx, cy] = [camera.fx, camera.fy, camera.cx, camera.cy].map(|v| v as f32);
        let (width, height) = (camera.width as f32, camera.height as f32);
        Self {
            left: Vec3::new(fx, 0.0, -cx).normalize(),
            right: Vec3::new(-fx, 0.0, cx - width).normalize(),
            bottom: Vec3::new(0.0, fy, cy - height).normalize(),
            top: Vec3::new(0.0, -fy, -cy).normalize(),
        }
    }

    fn turned(self, turn: Mat3) -> Self {
        let Self { left, right, bottom, top } = self;
        Self { left: turn * left, right: turn * right, bottom: turn * bottom, top: turn * top }
    }

    /// Returns the angle to the nearest side; negative outside.
    fn inside_rad(&self, direction: Vec3) -> f32 {
        let sides = [self.left, self.right, self.bottom, self.top];
        let least = sides.into_iter().map(|side| side.dot(direction)).fold(f32::INFINITY, f32::min);
        least.clamp(-1.0, 1.0).asin()
    }

    /// Returns the azimuths of the left and right side, each at an elevation: `nx sin a − nz cos a = −ny tan e`.
    fn azimuths_rad(&self, elevations: [f32; 2]) -> (f32, f32) {
        let crossing = |normal: Vec3, elevation: f32| {
            let across = Vec2::new(normal.x, -normal.z);
            let turned = (-normal.y * elevation.tan() / across.length().max(1e-6)).clamp(-1.0, 1.0).asin();
            (turned, across.y.atan2(across.x))
        };
        let (left, right) = (crossing(self.left, elevations[0]), crossing(self.right, elevations[1]));
        (left.0 - left.1, PI - right.0 - right.1)
    }

    /// Returns the elevations of the bottom and the top at an azimuth.
    fn elevations_rad(&self, azimuth: f32) -> (f32, f32) {
        let crossing = |normal: Vec3| {
            let ahead = normal.x * azimuth.sin() - normal.z * azimuth.cos();
            // Of the two opposite directions, the one ahead.
            (-ahead / normal.y).atan()
        };
        (crossing(self.bottom), crossing(self.top))
    }
}

/// Returns whether azimuths about the vertical suit the photo: little roll, and neither zenith nor nadir in view.
fn is_level(camera: &Camera, up: Vec3) -> bool {
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    let grid = [0.0, 0.5, 1.0].map(|u| [0.0, 0.5, 1.0].map(|v| (u * width, v * height)));
    let is_flat = |&(u, v): &(f64, f64)| camera.direction(u, v).dot(up).abs() < LEVEL.0.sin();
    up.x.abs() < LEVEL.1 && grid.as_flattened().iter().all(is_flat)
}

/// Triangle wave: mirrors `x` at 0 and at `period` until it is in between.
fn wave(x: f32, period: f32) -> f32 {
    let turned = x.rem_euclid(2.0 * period);
    turned.min(2.0 * period - turned)
}

#[cfg(test)]
mod tests {
    use lo_geometry::Quat;
    use proptest::prelude::*;

    use super::*;

    fn mirroring(hfov_deg: f64, pitch: f32, roll: f32) -> Mirroring {
        let camera = Camera::from_hfov_deg(hfov_deg, 640, 480).expect("a valid lens");
        Mirroring::new(camera, Quat::from_rotation_z(roll) * Quat::from_rotation_x(pitch) * Vec3::Y)
    }

    fn direction(azimuth: f32, elevation: f32) -> Vec3 {
        Vec3::new(azimuth.sin() * elevation.cos(), elevation.sin(), -azimuth.cos() * elevation.cos())
    }

    #[test]
    fn mirror_images_end_at_the_other_side() {
        // 60°: five panels of 60° in the 300° beside the photo. The centre is mirrored at ± 60° and behind the camera.
        let level = mirroring(60.0, 0.0, 0.0);
        assert_eq!(level.panels, 5.0);
        for (azimuth_deg, expected_deg) in [(0.0f32, 0.0f32), (40.0, 20.0), (60.0, 0.0), (80.0, -20.0), (-40.0, -20.0)]
        {
            let footprint = level.footprint(direction(azimuth_deg.to_radians(), 0.0), 0.0);
            let expected = 320.0 * (1.0 + expected_deg.to_radians().tan() / 30f32.to_radians().tan());
            assert!(
                (footprint.at.x - expected).abs() < 0.1 && (footprint.at.y - 240.0).abs() < 0.1,
                "{azimuth_deg}: {footprint:?}"
            );
        }
        let behind = level.footprint(direction(PI, 0.0), 0.0);
        assert!((behind.at.x - 320.0).abs() < 0.1, "{behind:?}");
    }

    #[test]
    fn floors_are_continued_by_what_lies_below_the_horizon() {
        for pitch in [-0.15, 0.0, 0.2] {
            let mirroring = mirroring(70.0, pitch, 0.0);
            let camera_from_level = mirroring.level_from_camera.transpose();
            for i in 0..2000 {
                let level = lo_geometry::fibonacci_sphere(2000)[i];
                let footprint = mirroring.footprint(camera_from_level * level, 0.0);
                let seen = mirroring.camera.direction(f64::from(footprint.at.x), f64::from(footprint.at.y));
                let elevation = (mirroring.level_from_camera * seen).y;
                // Near the horizon, corners of the photo are mirrored a second time.
                assert!(level.y.abs() < 0.1 || elevation * level.y > 0.0, "{pitch}: {level} {elevation}");
            }
        }
    }

    proptest! {
        #[test]
        fn inside_it_is_the_projection(
            u in 0.01f64..0.99, v in 0.01f64..0.99, hfov_deg in 30.0f64..110.0, pitch in -1.5f32..1.5,
            roll in -0.7f32..0.7,
        ) {
            let mirroring = mirroring(hfov_deg, pitch, roll);
            let (u, v) = (640.0 * u, 480.0 * v);
            let footprint = mirroring.footprint(mirroring.camera.direction(u, v), 0.01);
            prop_assert!((footprint.at - Vec2::new(u as f32, v as f32)).length() < 0.05, "{footprint:?}");
            prop_assert!(footprint.outside_rad <= 0.0);
        }

        /// Adjacent directions map to adjacent positions: there is no seam at borders or behind the camera.
        #[test]
        fn it_is_continuous(
            azimuth in -PI..PI, elevation in -1.0f32..1.0, turn in 0.0..TAU, hfov_deg in 30.0f64..110.0,
            pitch in -1.5f32..1.5, roll in -0.7f32..0.7,
        ) {
            let mirroring = mirroring(hfov_deg, pitch, roll);
            let step = 1e-3;
            let first = direction(azimuth, elevation);
            let basis = lo_geometry::orthonormal_basis(first);
            let second = (first + (basis.x_axis * turn.cos() + basis.y_axis * turn.sin()) * step).normalize();
            let camera_from_level = mirroring.level_from_camera.transpose();
            let [a, b] = [first, second].map(|level| mirroring.footprint(camera_from_level * level, step));
            // A degree has more pixels in the photo's corners, and azimuths are closer together away from the horizon.
            let furthest = 100.0 * step * mirroring.camera.fx as f32;
            prop_assert!((a.at - b.at).length() < furthest, "{a:?} {b:?}");
            prop_assert!((a.outside_rad - b.outside_rad).abs() < 10.0 * step, "{a:?} {b:?}");
            prop_assert!(a.at.cmpge(Vec2::ZERO).all() && a.at.cmple(mirroring.size()).all());
            prop_assert!(a.axes.iter().all(|axis| axis.is_finite()));
        }
    }
}
