//! A baseline's training example, made from a sample.

use lo_baselines::{BaselineExample, CELL, PROBE_MAP, PhotoFeatures, Planes, Probe};
use lo_cone::{ConeTracer, Settings};
use lo_dataset::{NovelView, Sample};
use lo_geometry::{Camera, Vec3};
use lo_imaging::{
    DepthMap, Image, RadianceImage, resize_equirectangular, rotate_equirectangular, rotate_equirectangular_nearest,
};
use lo_nets::depth::DepthNet;
use lo_nets::light::MAX_RADIANCE;
use lo_random::{RngExt, Stream};

use crate::augmentation::Variation;
use crate::example::{PANORAMA, UnusableSample, invalid, surroundings, true_panorama};

/// Depths of the octree from which the light at surfaces is rendered.
const OCTREE_DEPTHS: [u32; 2] = [4, 7];

/// Distance of a probe from its surface: metres, and at least this many leaves, so that it is not inside of one.
const DISTANCE_M: f32 = 0.1;
const DISTANCE_LEAVES: f32 = 1.5;

/// Largest ratio of depths around a pixel on one surface.
const SAME_SURFACE: f32 = 1.1;

/// Smallest length of a mean normal of a cell that shows one surface.
const MIN_NORMAL: f32 = 0.9;

/// Makes an example with `probes` probes in front of surfaces that the photo shows, and one at each panorama.
pub(super) fn baseline_example(
    sample: &Sample,
    variation: &Variation,
    depth_net: &DepthNet,
    probes: usize,
    stream: &mut Stream,
) -> Result<BaselineExample, UnusableSample> {
    let depth_m = sample.depth_m.as_ref().ok_or(UnusableSample::Missing("true depth"))?;
    if sample.points.is_empty() {
        return Err(UnusableSample::Missing("surface points"));
    }
    let panorama = true_panorama(sample, variation)?.ok_or(UnusableSample::Missing("panorama at its camera"))?;
    let photo = variation.photo(&sample.photo);
    let camera = variation.camera(&sample.camera);
    let features = PhotoFeatures::new(depth_net, &photo, &camera);
    let size = [photo.width(), photo.height()];
    let albedo = match &sample.albedo {
        Some(albedo) => features.cell_means(depth_net, &variation.framed(albedo)),
        None => Planes::from_fn(features.photo.size, |_, _, _| 0.0),
    };
    let depth_m = &variation.depth(depth_m);
    let normal = match &sample.normal {
        Some(normal) => unit_normals(&features.cell_means(depth_net, &variation.framed(normal)), variation.scale()),
        None => {
            let normal = depth_normals(depth_m, &camera.resized(depth_m.width() as u32, depth_m.height() as u32));
            unit_normals(&features.cell_means(depth_net, &normal), Vec3::ONE)
        }
    };
    let seen = SeenSurface { depth_m, normal: &normal, camera: &camera, size };
    let mut made = seen.probes(sample, variation, &features, probes, stream)?;
    let surface = features.surface();
    let nearest = |position: Vec3| {
        let distance = |point: &Vec3| (*point - position).length_squared();
        surface.iter().min_by(|a, b| distance(&a.1).total_cmp(&distance(&b.1))).map(|(cell, _)| *cell)
    };
    for view in &sample.views {
        let position_m = view.position_m * variation.scale();
        made.extend(nearest(position_m).map(|cell| view_probe(view, variation, position_m, cell)));
    }
    if made.is_empty() {
        return Err(UnusableSample::Missing("surface or panorama at which light is known"));
    }
    debug_assert_eq!([panorama.width(), panorama.height()], [PANORAMA.0, PANORAMA.1]);
    Ok(BaselineExample { features, panorama: limited(panorama), albedo, normal, probes: made })
}

/// True surfaces of a photo.
struct SeenSurface<'a> {
    depth_m: &'a DepthMap,
    normal: &'a Planes,
    camera: &'a Camera,
    /// Width and height of the photo.
    size: [usize; 2],
}

impl SeenSurface<'_> {
    /// Draws cells and renders the light in front of their surfaces.
    fn probes(
        &self,
        sample: &Sample,
        variation: &Variation,
        features: &PhotoFeatures,
        count: usize,
        stream: &mut Stream,
    ) -> Result<Vec<Probe>, UnusableSample> {
        if count == 0 {
            return Ok(Vec::new());
        }
        let octree = surroundings(sample, variation, OCTREE_DEPTHS)?;
        let leaf_m = octree.cube.node_edge_m(octree.octree.depth());
        let distance_m = DISTANCE_M.max(DISTANCE_LEAVES * leaf_m);
        let [rows, columns] = features.shown;
        let mut cells: Vec<([usize; 2], Vec3)> = (0..rows)
            .flat_map(|row| (0..columns).map(move |column| [row, column]))
            .filter_map(|cell| Some((cell, self.point(cell, features.shown, distance_m)?)))
            .filter(|(_, point)| octree.cube.contains(*point))
            .collect();
        let mut drawn = Vec::new();
        while drawn.len() < count && !cells.is_empty() {
            drawn.push(cells.swap_remove(stream.random_range(0..cells.len())));
        }
        let tracer = ConeTracer::new(&octree, Settings::default()).map_err(invalid)?;
        let points: Vec<Vec3> = drawn.iter().map(|(_, point)| *point).collect();
        let renderings = tracer.panoramas(&points, PROBE_MAP[0], PROBE_MAP[1]);
        let probe = |((cell, position_m), rendering): (([usize; 2], Vec3), lo_cone::Rendering)| Probe {
            cell,
            position_m,
            radiance: limited(rendering.radiance),
            distance_m: rendering.distance_m,
        };
        Ok(drawn.into_iter().zip(renderings).map(probe).collect())
    }

    /// Returns the point in front of a cell's surface, if surface and normal are known.
    fn point(&self, [row, column]: [usize; 2], shown: [usize; 2], distance_m: f32) -> Option<Vec3> {
        let normal = self.normal.vector(row, column);
        // The middle of the cell, as a share of the photo: cells are blocks of the network's input.
        let middle = |cell: usize, count: usize, size: usize| {
            ((cell * CELL + CELL / 2) as f64 / (count * CELL) as f64 * size as f64).min(size as f64 - 0.5)
        };
        let (u, v) = (middle(column, shown[1], self.size[0]), middle(row, shown[0], self.size[1]));
        let at = |t: f64, from: usize, to: usize| ((t * to as f64 / from as f64) as usize).min(to - 1);
        let pixel = (at(u, self.size[0], self.depth_m.width()), at(v, self.size[1], self.depth_m.height()));
        let depth_m = self.depth_m[pixel];
        let known = depth_m.is_finite() && depth_m > 0.0 && normal != Vec3::ZERO;
        known.then(|| self.camera.unproject(u, v, f64::from(depth_m)) + normal * distance_m)
    }
}

/// Returns the normals of a depth map, towards the camera; 0 at depth edges and where depth is unknown.
fn depth_normals(depth_m: &DepthMap, camera: &Camera) -> Image<[f32; 3]> {
    let (width, height) = (depth_m.width(), depth_m.height());
    let point = |x: usize, y: usize| camera.unproject(x as f64 + 0.5, y as f64 + 0.5, depth_m[(x, y)].into());
    Image::from_fn(width, height, |x, y| {
        let (left, right) = (x.saturating_sub(1), (x + 1).min(width - 1));
        let (upper, lower) = (y.saturating_sub(1), (y + 1).min(height - 1));
        let around = [(left, y), (right, y), (x, upper), (x, lower)].map(|at| depth_m[at]);
        let (least, most) = around.iter().fold((f32::MAX, 0.0f32), |(low, high), &z| (low.min(z), high.max(z)));
        if least.is_nan() || least <= 0.0 || most > SAME_SURFACE * least {
            return [0.0; 3];
        }
        let across = point(right, y) - point(left, y);
        let normal = across.cross(point(x, upper) - point(x, lower)).normalize_or_zero();
        (normal * -normal.dot(point(x, y)).signum()).to_array()
    })
}

/// Returns the unit normals of the augmented room; 0 where a cell shows several surfaces or none.
fn unit_normals(means: &Planes, scale: Vec3) -> Planes {
    Planes::from_fn(means.size, |channel, row, column| {
        let mean = means.vector(row, column);
        if mean.length() < MIN_NORMAL { 0.0 } else { (mean / scale).normalize()[channel] }
    })
}

/// Returns the light at a panorama.
fn view_probe(view: &NovelView, variation: &Variation, position_m: Vec3, cell: [usize; 2]) -> Probe {
    let [width, height] = PROBE_MAP;
    let (fine_width, fine_height) = (view.radiance.width().max(width), view.radiance.height().max(height));
    let turned = rotate_equirectangular(&view.radiance, view.rotation, fine_width, fine_height);
    let turned = resize_equirectangular(&turned, width, height);
    let column = |x: usize| if variation.mirrored { width - 1 - x } else { x };
    let radiance = RadianceImage::from_fn(width, height, |x, y| variation.light(turned[(column(x), y)]));
    let distance_m = match &view.depth_m {
        Some(depth_m) => {
            let turned = rotate_equirectangular_nearest(depth_m, view.rotation, width, height);
            DepthMap::from_fn(width, height, |x, y| turned[(column(x), y)].max(0.0))
        }
        None => DepthMap::from_fn(width, height, |_, _| 0.0),
    };
    Probe { cell, position_m, radiance: limited(radiance), distance_m }
}

/// Limits radiance to what 16 bits hold.
fn limited(radiance: RadianceImage) -> RadianceImage {
    radiance.map(|rgb| rgb.map(|v| v.clamp(0.0, MAX_RADIANCE)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_dataset::{Generator, GeneratorConfig};
    use lo_imaging::sample_equirectangular;
    use lo_nets::Device;
    use lo_nets::depth::EncoderKind;
    use lo_synth::SynthConfig;

    use super::*;

    fn sample() -> Sample {
        let room = SynthConfig { crop_size: [120, 80], ..SynthConfig::default() };
        let config = GeneratorConfig {
            room,
            shots: 1,
            panoramas: 2,
            panorama_height: 32,
            octree_depth: 6,
            ..Default::default()
        };
        Generator::new(3, config).unwrap().record(1).unwrap().sample(0)
    }

    #[test]
    fn probes_see_the_surfaces_that_the_photo_shows() {
        let sample = sample();
        let net = DepthNet::new(EncoderKind::EfficientNetLite0, 16, 1, &Device::flex());
        let wrong = Variation { mirrored: true, gains: [1.4, 1.1, 1.2], focal: 1.0, zoom: 1.2 };
        for variation in [Variation::NONE, wrong] {
            let stream = &mut lo_random::stream(1, "test", 0);
            let example = baseline_example(&sample, &variation, &net, 24, stream).unwrap();
            let camera = variation.camera(&sample.camera);
            assert_eq!(example.probes.len(), 24 + sample.views.len());
            let (mut close, mut known) = (0, 0);
            for probe in &example.probes[..24] {
                let (u, v, _) = camera.project(probe.position_m).unwrap();
                let [row, column] = probe.cell;
                let normal = example.normal.vector(row, column);
                assert!(normal.dot(probe.position_m) < 0.35 * probe.position_m.length(), "normals face the camera");
                // The light from the surface is what the photo shows there, where the photo is not clipped.
                let shown = [0, 1, 2].map(|c| example.features.photo.at(c, row, column));
                let seen = sample_equirectangular(&probe.radiance, -normal);
                // 120 × 80 pixels are the network's input; zoomed photos are smaller.
                let near =
                    |pixel: f64, cell: usize| (pixel - (CELL * cell + CELL / 2) as f64).abs() < 6.0 * CELL as f64;
                assert!(near(v, row) && near(u, column), "{:?} {u} {v}", probe.cell);
                if shown[1] < 0.8 {
                    known += 1;
                    close += usize::from((shown[1].ln_1p() - seen[1].ln_1p()).abs() < 0.12);
                }
            }
            assert!(known >= 10 && 10 * close > 7 * known, "{close} of {known}");
            // A probe at a panorama has its light, in the photo's frame.
            let (view, probe) = (&sample.views[0], &example.probes[24]);
            let direction = Vec3::new(0.3, 0.5, -0.8).normalize();
            let mirror = if variation.mirrored { Vec3::new(-1.0, 1.0, 1.0) } else { Vec3::ONE };
            let truth = sample_equirectangular(&view.radiance, view.rotation.inverse() * (direction * mirror));
            let got = sample_equirectangular(&probe.radiance, direction);
            assert!((got[1].ln_1p() - (variation.gains[1] * truth[1]).ln_1p()).abs() < 0.25, "{got:?} {truth:?}");
        }
    }

    #[test]
    fn normals_of_depth_are_those_of_the_room() {
        let sample = sample();
        let (depth_m, normal) = (sample.depth_m.as_ref().unwrap(), sample.normal.as_ref().unwrap());
        let got = depth_normals(depth_m, &sample.camera);
        let pairs = got.pixels().iter().zip(normal.pixels()).map(|(a, b)| (Vec3::from_array(*a), Vec3::from_array(*b)));
        let cosines: Vec<f32> =
            pairs.filter(|(a, b)| *a != Vec3::ZERO && *b != Vec3::ZERO).map(|(a, b)| a.dot(b)).collect();
        let close = cosines.iter().filter(|cosine| **cosine > 0.98).count();
        assert!(cosines.len() > got.pixels().len() / 2 && 10 * close > 8 * cosines.len(), "{close} {}", cosines.len());
    }

    #[test]
    fn what_is_missing_is_said() {
        let whole = sample();
        let net = DepthNet::new(EncoderKind::EfficientNetLite0, 16, 1, &Device::flex());
        let message = |sample: &Sample| {
            let stream = &mut lo_random::stream(1, "test", 0);
            baseline_example(sample, &Variation::NONE, &net, 4, stream).unwrap_err().to_string()
        };
        assert_eq!(message(&Sample { depth_m: None, ..whole.clone() }), "the sample has no true depth");
        assert_eq!(message(&Sample { points: Vec::new(), ..whole.clone() }), "the sample has no surface points");
    }
}
