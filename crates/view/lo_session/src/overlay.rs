//! Overlays on the photo: depth, normals, octree levels and provenance.

use lightoctree::Estimate;
use lo_cone::{ConeTracer, Settings};
use lo_geometry::Vec3;
use lo_imaging::{DepthMap, Image};
use serde::{Deserialize, Serialize};

use crate::{OpenScene, SessionError};

/// Longer side of an overlay, pixels.
const SIDE: f64 = 640.0;

/// An overlay on the photo.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum Overlay {
    /// Depth, from red (near) to blue (far).
    Depth,
    /// Surface normals: x, y and z as red, green and blue.
    Normals,
    /// Octree depth of the visible leaves.
    Levels,
    /// Where the radiance comes from: photo, panorama or inference.
    #[serde(rename = "origins")]
    Provenance,
}

/// An overlay with its legend.
#[derive(Clone, Debug)]
pub struct OverlayImage {
    /// sRGB with straight alpha, in the photo's view; transparent where nothing is known.
    pub image: Image<[u8; 4]>,
    /// Colours and their meanings.
    pub legend: Vec<([u8; 3], String)>,
}

/// Source of the radiance at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RadianceOrigin {
    Photo,
    Panorama,
    Inferred,
    Nothing,
}

/// Colours of octree depths from [`FIRST_LEVEL`] on, distinct in lightness, too.
const LEVEL_COLORS: [[u8; 3]; 6] =
    [[68, 1, 84], [65, 68, 135], [42, 120, 142], [34, 168, 132], [122, 209, 81], [253, 231, 37]];

/// Octree depth of the first colour.
const FIRST_LEVEL: u32 = 4;

/// Renders an overlay of a scene.
///
/// # Errors
/// If the light cannot be traced.
pub fn overlay(scene: &OpenScene, what: Overlay) -> Result<OverlayImage, SessionError> {
    Ok(match what {
        Overlay::Depth => depth(scene.surfaces.depth_m()),
        Overlay::Normals => normals(scene.surfaces.normals()),
        Overlay::Levels => levels(scene.estimate())?,
        Overlay::Provenance => origins(scene.estimate())?,
    })
}

fn depth(depth_m: &DepthMap) -> OverlayImage {
    let range_m = DepthRange::of(depth_m);
    let image = depth_m.map(|&z| if z > 0.0 { opaque(range_m.color(z)) } else { [0; 4] });
    let DepthRange { near, far } = range_m;
    let steps = [0.0, 0.25, 0.5, 0.75, 1.0].map(|share| near + share * (far - near));
    let legend = if far > 0.0 { steps.map(|z| (range_m.color(z), format!("{z:.2} m"))).to_vec() } else { Vec::new() };
    OverlayImage { image, legend }
}

/// Range of a photo's depth readings, metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DepthRange {
    near: f32,
    far: f32,
}

impl DepthRange {
    pub fn of(depth_m: &DepthMap) -> Self {
        let known = depth_m.pixels().iter().copied().filter(|z| *z > 0.0);
        let (near, far) = known.fold((f32::INFINITY, 0.0f32), |(near, far), z| (near.min(z), far.max(z)));
        Self { near, far }
    }

    /// Maps a depth to a colour, from red (near) to blue (far).
    pub fn color(&self, z: f32) -> [u8; 3] {
        let share = if self.far > self.near { (z - self.near) / (self.far - self.near) } else { 0.0 };
        turbo(1.0 - share)
    }
}

fn normals(normals: &Image<Vec3>) -> OverlayImage {
    let image = normals.map(|&n| if n == Vec3::ZERO { [0; 4] } else { opaque(normal_color(n)) });
    let sides = [(Vec3::X, "to the right"), (Vec3::Y, "up in the image"), (Vec3::Z, "towards the camera")];
    OverlayImage { image, legend: sides.map(|(n, text)| (normal_color(n), text.to_owned())).to_vec() }
}

/// Maps x, y and z of a unit vector to red, green and blue.
pub(crate) fn normal_color(normal: Vec3) -> [u8; 3] {
    normal.to_array().map(|c| (127.5 + 127.5 * c) as u8)
}

/// Returns the colour of an octree depth.
pub(crate) fn level_color(depth: u32) -> [u8; 3] {
    LEVEL_COLORS[(depth.saturating_sub(FIRST_LEVEL) as usize).min(LEVEL_COLORS.len() - 1)]
}

fn levels(estimate: &Estimate) -> Result<OverlayImage, SessionError> {
    let depth = estimate.light.octree.depth();
    let image = render_hits(estimate, |direction, distance_m| {
        leaf(estimate, Vec3::ZERO, direction, distance_m).map(|(depth, _)| level_color(depth))
    })?;
    let text = |depth: u32| format!("depth {depth}, {:.1} cm", 100.0 * estimate.light.cube.node_edge_m(depth));
    let legend = (FIRST_LEVEL.min(depth)..=depth).map(|depth| (level_color(depth), text(depth))).collect();
    Ok(OverlayImage { image, legend })
}

fn origins(estimate: &Estimate) -> Result<OverlayImage, SessionError> {
    let image =
        render_hits(estimate, |direction, distance_m| match origin_of(estimate, Vec3::ZERO, direction, distance_m) {
            RadianceOrigin::Nothing => None,
            origin => Some(origin_color(origin)),
        })?;
    let all = [
        (RadianceOrigin::Photo, "observed in the photo"),
        (RadianceOrigin::Panorama, "from the panorama"),
        (RadianceOrigin::Inferred, "inferred"),
    ];
    let shown =
        all.into_iter().filter(|(origin, _)| *origin != RadianceOrigin::Panorama || estimate.panorama.is_some());
    Ok(OverlayImage { image, legend: shown.map(|(origin, text)| (origin_color(origin), text.to_owned())).collect() })
}

pub(crate) fn origin_color(origin: RadianceOrigin) -> [u8; 3] {
    match origin {
        RadianceOrigin::Photo => [86, 180, 233],
        RadianceOrigin::Panorama => [0, 158, 115],
        RadianceOrigin::Inferred => [230, 159, 0],
        RadianceOrigin::Nothing => [0; 3],
    }
}

/// Returns the source of the radiance at a distance along a direction.
pub(crate) fn origin_of(estimate: &Estimate, from: Vec3, direction: Vec3, distance_m: f32) -> RadianceOrigin {
    leaf(estimate, from, direction, distance_m)
        .map_or(RadianceOrigin::Nothing, |(depth, row)| origin_of_leaf(estimate, depth, row))
}

/// Returns the source of a leaf's radiance.
pub(crate) fn origin_of_leaf(estimate: &Estimate, depth: u32, row: usize) -> RadianceOrigin {
    let share = |shares: &[Vec<u8>]| shares[depth as usize][row];
    if share(&estimate.light.seen) >= 128 {
        RadianceOrigin::Photo
    } else if estimate.panorama.as_ref().is_some_and(|laid| share(&laid.share) >= 128) {
        RadianceOrigin::Panorama
    } else {
        RadianceOrigin::Inferred
    }
}

/// Finds depth and row of the leaf that a ray hits at about a distance.
fn leaf(estimate: &Estimate, from: Vec3, direction: Vec3, distance_m: f32) -> Option<(u32, usize)> {
    /// The distance is a mean over a cone, so the leaf may be off by these multiples of the finest leaf edge.
    const STEPS: [f32; 6] = [0.0, 0.5, -0.5, 1.0, 1.5, 2.0];
    if !distance_m.is_finite() {
        return None;
    }
    let light = &estimate.light;
    let edge_m = light.cube.node_edge_m(light.octree.depth());
    STEPS.iter().find_map(|step| {
        let point = from + direction * (distance_m + step * edge_m);
        let (depth, node) = light.locate(point, light.octree.depth())?;
        let row = usize::try_from(light.octree.levels()[depth as usize].rows[node]).ok()?;
        Some((depth, row))
    })
}

/// Renders an overlay by colouring the camera's hits in the octree.
fn render_hits(
    estimate: &Estimate,
    color: impl Fn(Vec3, f32) -> Option<[u8; 3]>,
) -> Result<Image<[u8; 4]>, SessionError> {
    let camera = estimate.frame.camera;
    let scale = (SIDE / f64::from(camera.width.max(camera.height))).min(1.0);
    let scaled = |side: u32| ((f64::from(side) * scale).round() as u32).max(1);
    let camera = camera.resized(scaled(camera.width), scaled(camera.height));
    let tracer = ConeTracer::new(&estimate.light.seen_from(Vec3::ZERO), Settings::default())?;
    let distance_m = tracer.perspective(&camera).distance_m;
    Ok(Image::from_fn(camera.width as usize, camera.height as usize, |x, y| {
        let direction = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
        color(direction, distance_m[(x, y)]).map_or([0; 4], opaque)
    }))
}

fn opaque([r, g, b]: [u8; 3]) -> [u8; 4] {
    [r, g, b, 255]
}

/// Evaluates the Turbo colour map (Anton Mikhailov, 2019) by its published polynomials; 0 blue … 1 red.
fn turbo(share: f32) -> [u8; 3] {
    const COEFFICIENTS: [[f32; 6]; 3] = [
        [0.135_721_38, 4.615_392_6, -42.660_32, 132.131_08, -152.942_4, 59.286_38],
        [0.091_402_61, 2.194_188_4, 4.842_966_6, -14.185_033, 4.277_298_6, 2.829_566],
        [0.106_673_3, 12.641_946, -60.582_05, 110.362_77, -89.903_11, 27.348_25],
    ];
    let x = share.clamp(0.0, 1.0);
    COEFFICIENTS.map(|c| {
        let value = c.iter().rev().fold(0.0, |sum, c| sum * x + c);
        (255.0 * value.clamp(0.0, 1.0)) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turbo_goes_from_blue_to_red() {
        // The ends of the published table: (48, 18, 59) and (122, 4, 3). The polynomials are off by up to 32 there.
        let near = |a: [u8; 3], b: [u8; 3]| a.iter().zip(b).all(|(&a, b)| a.abs_diff(b) <= 32);
        assert!(near(turbo(0.0), [48, 18, 59]) && near(turbo(1.0), [122, 4, 3]), "{:?} {:?}", turbo(0.0), turbo(1.0));
        let middle = turbo(0.5);
        assert!(middle[1] > 230, "{middle:?}");
    }
}
