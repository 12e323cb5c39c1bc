//! Paths of the objects in the true room.

use lo_eval::LevelSurfaces;
use lo_geometry::{Quat, Vec3};
use lo_mesh::PreparedModel;
use lo_random::{RngExt, Stream};

/// Number of random pixels to try.
const TRIES: usize = 2000;

/// Largest angle between a path and the image's horizontal, seen from above, radians.
const MAX_HEADING_RAD: f32 = 0.5;

/// Distance between the centres of both objects, in radii: they never touch, however they are turned.
const GAP_RADII: f32 = 2.6;

/// Shortest and longest way of an object, in radii.
const TRAVEL_RADII: (f32, f32) = (3.0, 9.0);

/// Distance at which space along a path is checked, in radii.
const STEP_RADII: f32 = 0.25;

/// Share of the largest sphere in an object's cylinder that must be free of other surfaces, among them the support.
const FREE_SHARE: f32 = 0.9;

/// Upright cylinder around a model at any yaw, in the model's units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    /// Largest horizontal distance from the centre of the base.
    radius: f32,
    height: f32,
}

impl Extent {
    /// Measures a model.
    pub fn new(model: &PreparedModel) -> Self {
        let (bounds, vertices) = (model.bounds(), &model.model().positions);
        let middle = bounds.center();
        let distance = |p: &Vec3| (p.x - middle.x).hypot(p.z - middle.z);
        Self { radius: vertices.iter().map(distance).fold(0.0, f32::max), height: bounds.size().y }
    }
}

/// Straight path on a level surface of a room, in the room's frame. Both objects move on it, one behind the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ObjectPath {
    /// Point between the objects when they are halfway.
    middle_m: Vec3,
    /// Unit direction, to the right in the photo.
    direction: Vec3,
    /// Distance between the objects.
    gap_m: f32,
    /// Way of each object.
    travel_m: f32,
    /// Metres per unit of the model.
    pub scale: f32,
}

impl ObjectPath {
    /// Returns the base of the left (0) or right (1) object; `share` is 0 at the left end and 1 at the right end.
    pub fn base_m(&self, object: usize, share: f32) -> Vec3 {
        self.point_m((object as f32 - 0.5) * self.gap_m + (share - 0.5) * self.travel_m)
    }

    /// Returns points from the leftmost base to the rightmost one, evenly spaced.
    pub fn points_m(&self, count: usize) -> impl Iterator<Item = Vec3> + '_ {
        let length_m = self.gap_m + self.travel_m;
        (0..count).map(move |i| self.point_m((i as f32 / (count - 1) as f32 - 0.5) * length_m))
    }

    fn point_m(&self, along_m: f32) -> Vec3 {
        self.middle_m + self.direction * along_m
    }

    /// Finds the longest of many random paths on which both objects stand freely and are visible.
    ///
    /// `object_size` is the larger of the apparent height and width in the middle, as a share of the photo's height.
    /// `None` if the photo shows no level surface with enough space.
    pub fn find(surfaces: &LevelSurfaces, extent: &Extent, object_size: f32, random: &mut Stream) -> Option<Self> {
        let mut best: Option<Self> = None;
        for _ in 0..TRIES {
            let path = Self::at_random_pixel(surfaces, extent, object_size, random);
            let is_longer = |path: &Self| best.is_none_or(|best| path.in_radii(extent) > best.in_radii(extent));
            best = path.filter(is_longer).or(best);
            if best.is_some_and(|best| best.in_radii(extent) >= TRAVEL_RADII.1) {
                break;
            }
        }
        best
    }

    /// Returns its way in radii of the object.
    fn in_radii(&self, extent: &Extent) -> f32 {
        self.travel_m / (self.scale * extent.radius)
    }

    fn at_random_pixel(
        surfaces: &LevelSurfaces,
        extent: &Extent,
        object_size: f32,
        random: &mut Stream,
    ) -> Option<Self> {
        let (camera, pose) = (&surfaces.view.camera, &surfaces.view.pose);
        let pixel = [
            random.random_range(0.2..0.8) * f64::from(camera.width),
            random.random_range(0.3..0.95) * f64::from(camera.height),
        ];
        let heading_rad = random.random_range(-MAX_HEADING_RAD..MAX_HEADING_RAD);
        let (start_m, axis_m) = surfaces.at_pixel(pixel)?;
        let size_m = object_size * camera.height as f32 / camera.fy as f32 * axis_m;
        let scale = size_m / extent.height.max(2.0 * extent.radius);
        let right = pose.rotation * Vec3::X;
        let level = Vec3::new(right.x, 0.0, right.z).try_normalize()?;
        let direction = Quat::from_rotation_y(heading_rad) * level;
        let (radius_m, height_m) = (scale * extent.radius, scale * extent.height);
        let stands = |along_m: f32| stands(surfaces, start_m + direction * along_m, radius_m, height_m);
        if !stands(0.0) {
            return None;
        }
        let gap_m = GAP_RADII * radius_m;
        // Alternately to both sides, so that the start stays in the middle of free space.
        let (step_m, longest_m) = (STEP_RADII * radius_m, gap_m + TRAVEL_RADII.1 * radius_m);
        let (mut ends_m, mut is_open) = ([0.0_f32; 2], [true; 2]);
        while is_open != [false; 2] && ends_m[0] + ends_m[1] < longest_m {
            for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
                is_open[side] = is_open[side] && stands(sign * (ends_m[side] + step_m));
                ends_m[side] += if is_open[side] { step_m } else { 0.0 };
            }
        }
        let travel_m = (ends_m[0] + ends_m[1]).min(longest_m) - gap_m;
        let middle_m = start_m + direction * (0.5 * (ends_m[1] - ends_m[0]));
        (travel_m >= TRAVEL_RADII.0 * radius_m).then_some(Self { middle_m, direction, gap_m, travel_m, scale })
    }
}

/// Whether an upright cylinder stands freely on a level surface and its outline is visible.
fn stands(surfaces: &LevelSurfaces, base_m: Vec3, radius_m: f32, height_m: f32) -> bool {
    let right = surfaces.view.pose.rotation * Vec3::X;
    let to_camera = surfaces.view.pose.position - base_m;
    let front = Vec3::new(to_camera.x, 0.0, to_camera.z).normalize_or_zero();
    let outline = || {
        let at = |side: f32, height: f32| base_m + right * (side * radius_m) + Vec3::Y * (height * height_m);
        let sides = [at(-1.0, 0.1), at(1.0, 0.1), at(-1.0, 0.5), at(1.0, 0.5), at(-0.7, 1.0), at(0.7, 1.0)];
        [at(0.0, 0.02), at(0.0, 0.02) + front * radius_m].into_iter().chain(sides)
    };
    surfaces.carries(base_m, radius_m)
        && outline().all(|point| surfaces.shows(point, 0.01 * radius_m))
        && has_space(surfaces, base_m, radius_m, height_m)
}

/// Whether an upright cylinder is free of surfaces, except close to its ends.
fn has_space(surfaces: &LevelSurfaces, base_m: Vec3, radius_m: f32, height_m: f32) -> bool {
    let inner_m = radius_m.min(0.5 * height_m);
    let margin_m = FREE_SHARE * inner_m;
    let layers = (0.5 * height_m / inner_m).ceil() as usize;
    let height_of = |layer: usize| inner_m + (height_m - 2.0 * inner_m) * layer as f32 / (layers - 1).max(1) as f32;
    // A flat object also needs spheres along its rim.
    let rim_m = radius_m - inner_m;
    let around = if rim_m > 0.1 * radius_m { 8 } else { 0 };
    let rim = (0..around).map(|i| {
        let (sin, cos) = (std::f32::consts::TAU * i as f32 / around as f32).sin_cos();
        Vec3::new(cos, 0.0, sin) * rim_m
    });
    let centres: Vec<Vec3> = std::iter::once(Vec3::ZERO).chain(rim).collect();
    (0..layers).all(|layer| {
        let middle_m = base_m + Vec3::Y * height_of(layer);
        centres.iter().all(|&offset_m| surfaces.interior.is_free(middle_m + offset_m, margin_m))
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_mesh::{Material, Model};
    use lo_synth::{Interior, SynthConfig};

    use super::*;

    #[test]
    fn both_objects_stand_freely_and_visibly_along_the_whole_path() {
        let extent = Extent::new(&PreparedModel::new(Model::sphere(2.0, 3, Material::default()).unwrap()));
        assert!((extent.radius - 2.0).abs() < 0.02 && (extent.height - 4.0).abs() < 0.02, "{extent:?}");
        let mut found = 0;
        for index in 12..22 {
            let interior = Interior::generate(5, index, &SynthConfig::default()).unwrap();
            let view = interior.camera_poses(1)[0];
            let model = PreparedModel::new(interior.world.model.clone());
            let surfaces = LevelSurfaces { interior: &interior, model: &model, view: &view };
            let find = || ObjectPath::find(&surfaces, &extent, 0.2, &mut lo_random::stream(1, "paths", index));
            let path = find();
            assert_eq!(path, find());
            let Some(path) = path else { continue };
            found += 1;
            let radius_m = 2.0 * path.scale;
            assert!((3.0..=9.01).contains(&(path.travel_m / radius_m)), "{path:?}");
            for share in [0.0, 0.3, 1.0] {
                let bases = [0, 1].map(|object| path.base_m(object, share));
                assert!((bases[0] - bases[1]).length() > 2.0 * radius_m);
                let pixels = bases.map(|base_m| {
                    let local = |point: Vec3| view.pose.rotation.inverse() * (point - view.pose.position);
                    assert!(interior.is_free(base_m + Vec3::Y * radius_m, 0.8 * radius_m), "{index} {share}");
                    assert!(!interior.is_free(base_m + Vec3::Y * radius_m, 1.05 * radius_m), "it floats");
                    let top = view.camera.project(local(base_m + Vec3::Y * (2.0 * radius_m))).unwrap();
                    let bottom = view.camera.project(local(base_m)).unwrap();
                    assert!(top.1 > 0.0 && bottom.1 < f64::from(view.camera.height));
                    bottom.0
                });
                assert!(pixels[0] < pixels[1], "the first object is on the left");
            }
            let ends: Vec<Vec3> = path.points_m(2).collect();
            assert!((ends[0] - path.base_m(0, 0.0)).length() < 1e-4 && (ends[1] - path.base_m(1, 1.0)).length() < 1e-4);
        }
        assert!(found >= 3, "{found}");
    }
}
