//! Rendering of views: first the G-buffer, then a few light samples per pixel, then a filter that shares them among
//! pixels of one surface, last the anti-aliasing of edges.

use std::f32::consts::PI;

use lo_geometry::{Vec2, Vec3};
use lo_imaging::{Image, RadianceImage};
use rayon::prelude::*;

use crate::baked::BakedWorld;
use crate::gbuffer::{Facet, GBufferSample, trace_view_ray};
use crate::lights::{EmitterShape, luminance};
use crate::pattern::{self, Rotations, shifted};
use crate::shade::{PixelLight, PixelSampler};
use crate::{RenderedView, View};

/// Offsets of the first samples at edges, in pixels from the centre: a rotated square.
const EDGE_SAMPLES: [[f32; 2]; 4] = [[-0.125, -0.375], [0.375, -0.125], [0.125, 0.375], [-0.375, 0.125]];

/// Light samples of each edge sample if no pixel can share its light.
const EDGE_RAYS: u32 = 4;

/// Contrasts of the edge samples from which more samples are taken, with the number of samples per view that this
/// corresponds to. A pixel takes as many as if all pixels of the view took them, at most [`MAX_EDGE_SAMPLES`]. Views
/// with few pixels have more of them at edges.
const CONTRASTS: [(f32, usize); 2] = [(0.5, 2_000_000), (0.1, 500_000)];
const MAX_EDGE_SAMPLES: usize = 64;

/// Largest extent of a lamp in pixels, and the samples of pixels that may contain it.
const SMALL_LAMPS: [(f32, usize); 2] = [(2.0, 256), (12.0, 64)];

/// Views with fewer pixels are supersampled, up to [`MAX_SUPERSAMPLING`] along each axis.
const SUPERSAMPLED_PIXELS: usize = 40_000;
const MAX_SUPERSAMPLING: usize = 8;

/// Light samples per view. A pixel takes at least [`crate::BakeSettings::pixel_rays`] and at most [`MAX_PIXEL_RAYS`].
/// In small views, fewer pixels see the same surface and share their samples.
const VIEW_RAYS: usize = 120_000;
const MAX_PIXEL_RAYS: u32 = 16;

/// Samples are clamped to this multiple of the mean around them.
const MAX_OUTLIER: f32 = 10.0;

/// Pixels that share with fewer others than this within the filter take samples of their own.
const MIN_SHARED: f32 = 6.0;

/// Distance of the taps of the second filter, in pixels.
const WIDE_TAP_PX: i64 = 4;

/// Light samples of a pixel that cannot share.
const UNSHARED_RAYS: u32 = 12;

impl BakedWorld {
    /// Renders a view. Light of lamps, sky and sun is sampled at each pixel. All other light on matte surfaces comes
    /// from the cache. Gloss and mirrors are traced.
    pub fn render(&self, view: &View) -> RenderedView {
        render(self, view)
    }
}

fn render(baked: &BakedWorld, view: &View) -> RenderedView {
    let (width, height) = view.size();
    let gbuffer = pixel_centres(baked, view);
    let radiance = match supersampling(gbuffer.len()) {
        1 => radiance(baked, view, &gbuffer),
        times => {
            let supersampled = view.supersampled(times);
            lo_imaging::resize(&radiance(baked, &supersampled, &pixel_centres(baked, &supersampled)), width, height)
        }
    };
    let camera_from_world = view.pose().rotation.conjugate();
    let image =
        |pixel: &dyn Fn(&GBufferSample) -> [f32; 3]| Image::new(width, height, gbuffer.iter().map(pixel).collect());
    RenderedView {
        radiance,
        depth_m: Image::new(width, height, gbuffer.iter().map(|s| view.depth_m(s.distance_m, s.direction)).collect()),
        normal: image(&|s| (camera_from_world * s.normal).to_array()),
        albedo: image(&|s| s.albedo.to_array()),
        specular: Image::new(width, height, gbuffer.iter().map(|s| s.specular).collect()),
    }
}

/// Traces the rays through the centres of all pixels.
fn pixel_centres(baked: &BakedWorld, view: &View) -> Vec<GBufferSample> {
    let (width, height) = view.size();
    let centre = |i: usize| trace_view_ray(baked, view, (i % width) as f32 + 0.5, (i / width) as f32 + 0.5);
    (0..width * height).into_par_iter().map(centre).collect()
}

/// Returns the supersampling factor along each axis. Pixels that share light samples must not be far apart, and their
/// surface must not vary much within them.
fn supersampling(pixels: usize) -> usize {
    ((SUPERSAMPLED_PIXELS / pixels.max(1)).isqrt()).clamp(1, MAX_SUPERSAMPLING)
}

/// Computes the radiance of all pixels, given the G-buffer at their centres.
fn radiance(baked: &BakedWorld, view: &View, gbuffer: &[GBufferSample]) -> RadianceImage {
    let (width, height) = view.size();
    let at = |i: usize| (i % width, i / width);
    let sampler = PixelSampler::new(baked, view);
    let least_rays = baked.settings().pixel_rays;
    let rays = (VIEW_RAYS.div_ceil(gbuffer.len().max(1)) as u32).clamp(least_rays, least_rays.max(MAX_PIXEL_RAYS));
    let sampled: Vec<PixelLight> =
        gbuffer.par_iter().enumerate().map(|(i, sample)| sampler.sample(sample, at(i), rays)).collect();
    let facets: Vec<Option<Facet>> = gbuffer.par_iter().map(|sample| sample.surface.as_ref().map(Facet::of)).collect();
    let filter = Filter { gbuffer, facets: &facets, sampled: &sampled, width, height, wraps: view.wraps() };
    let lit: Vec<PixelLight> = (0..gbuffer.len())
        .into_par_iter()
        .map(|i| {
            let (mut lit, shared) = filter.at(i);
            if shared < MIN_SHARED && gbuffer[i].surface.is_some() {
                let own = sampler.sample(&gbuffer[i], at(i), UNSHARED_RAYS);
                lit.mix(&own, shared * rays as f32, UNSHARED_RAYS as f32);
            }
            lit
        })
        .collect();
    let wide = Filter { sampled: &lit, ..filter };
    let lit: Vec<PixelLight> = (0..gbuffer.len()).into_par_iter().map(|i| wide.wider(i)).collect();
    // No two samples share a row or column, since lamps seen edge-on are thinner than any grid.
    let within_pixel: [Vec2; SMALL_LAMPS[0].1] = std::array::from_fn(|k| pattern::r2(k as u32));
    let shifts = Rotations::new("transport edges", baked.settings().seed);
    let lamps = lamp_samples(baked, view);
    let radiance = |i: usize| {
        let (x, y) = at(i);
        let within = |number: usize, [dx, dy]: [f32; 2], rays: u32| {
            let sub = trace_view_ray(baked, view, x as f32 + 0.5 + dx, y as f32 + 0.5 + dy);
            let light = match sub.surface.as_ref().filter(|_| lamps[i] == 0).and_then(|_| filter.like(&sub, x, y)) {
                Some(like) if baked.settings().sun_at_edges => {
                    let mut light = lit[like];
                    sampler.resample_sun(&sub, (x, y), number, &mut light);
                    light
                }
                Some(like) => lit[like],
                None => sampler.sample(&sub, (x, y), rays),
            };
            view_radiance(baked, &sub, &light)
        };
        let mean = |samples: usize| {
            // With many samples per pixel, each needs few light samples.
            let rays = (EDGE_SAMPLES.len() as u32 * UNSHARED_RAYS).div_ceil(samples as u32);
            let [dx, dy, ..] = shifts.of(i * 997);
            let offset = |at: &Vec2| [shifted(at.x, dx) - 0.5, shifted(at.y, dy) - 0.5];
            let each = within_pixel[..samples].iter().enumerate();
            each.map(|(number, at)| within(number, offset(at), rays)).sum::<Vec3>() / samples as f32
        };
        if lamps[i] > 0 {
            return mean(lamps[i]).to_array();
        }
        if !filter.is_edge(i) {
            return view_radiance(baked, &gbuffer[i], &lit[i]).to_array();
        }
        let few = std::array::from_fn(|number| within(number, EDGE_SAMPLES[number], EDGE_RAYS));
        let contrast = contrast(few);
        let wanted = CONTRASTS.iter().find(|(least, _)| contrast > *least);
        let samples = wanted.map_or(0, |(_, of_view)| (of_view / gbuffer.len()).min(MAX_EDGE_SAMPLES));
        if samples > few.len() {
            mean(samples).to_array()
        } else {
            (few.into_iter().sum::<Vec3>() / few.len() as f32).to_array()
        }
    };
    Image::new(width, height, (0..gbuffer.len()).into_par_iter().map(radiance).collect())
}

/// Returns the difference of the brightest and the darkest over their sum: 0 if all are equal, 1 if one is black.
fn contrast(lights: [Vec3; 4]) -> f32 {
    let brightness = lights.map(luminance);
    let high = brightness.into_iter().fold(0.0, f32::max);
    let low = brightness.into_iter().fold(high, f32::min);
    (high - low) / (high + low).max(f32::MIN_POSITIVE)
}

/// Returns the number of samples of each pixel that may contain small lamps. 0 for other pixels.
fn lamp_samples(baked: &BakedWorld, view: &View) -> Vec<usize> {
    let (width, height) = view.size();
    let wraps = view.wraps();
    let mut samples = vec![0; width * height];
    for emitter in &baked.cache().lighting.emitters.list {
        if emitter.shape == EmitterShape::Portal || emitter.sheet {
            continue;
        }
        let corners = emitter.corners().map(|corner| view.pixel(corner));
        let [Some(mut a), Some(mut b), Some(mut c), _] = corners else { continue };
        if wraps && (a.max(b).max(c) - a.min(b).min(c)).x > 0.5 * width as f32 {
            // Across the seam of the panorama.
            for corner in [&mut a, &mut b, &mut c] {
                corner.x += if corner.x < 0.5 * width as f32 { width as f32 } else { 0.0 };
            }
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let extent = (high - low).max_element();
        let Some(&(_, wanted)) = SMALL_LAMPS.iter().find(|(most, _)| extent <= *most) else { continue };
        let range =
            |from: f32, to: f32, end: usize| (from.floor().max(0.0) as usize)..(to.floor() as usize + 1).min(end);
        for y in range(low.y, high.y, height) {
            for x in range(low.x, high.x, if wraps { 2 * width } else { width }) {
                let pixel = &mut samples[y * width + x % width];
                *pixel = wanted.max(*pixel);
            }
        }
    }
    samples
}

/// Returns the radiance of a view ray, given the light on its surface.
fn view_radiance(baked: &BakedWorld, sample: &GBufferSample, lit: &PixelLight) -> Vec3 {
    let Some(surface) = &sample.surface else { return sample.light };
    let mut light = surface.diffuse * (lit.lamps + lit.sun + lit.indirect) / PI;
    if surface.through != Vec3::ZERO {
        light += surface.through * lit.behind / PI;
    }
    if surface.is_glossy() {
        light += lit.reflected(surface) * surface.coverage;
    }
    if surface.pass != Vec3::ZERO {
        light += surface.pass * baked.light_along(surface.ray(-surface.view));
    }
    if surface.mirror != Vec3::ZERO {
        light += surface.mirror * baked.light_along(surface.ray(surface.mirrored()));
    }
    sample.light + sample.tint * light
}

/// Shares samples among pixels that see one surface. The sample pattern repeats every four pixels, and so does the
/// window: five pixels wide, the outer ones with half the weight.
struct Filter<'a> {
    gbuffer: &'a [GBufferSample],
    /// The window's most frequent lookups, stored compactly.
    facets: &'a [Option<Facet>],
    sampled: &'a [PixelLight],
    width: usize,
    height: usize,
    wraps: bool,
}

impl Filter<'_> {
    fn index(&self, x: i64, y: i64) -> Option<usize> {
        let width = self.width as i64;
        let x = if self.wraps && !(0..width).contains(&x) { x.rem_euclid(width) } else { x };
        ((0..width).contains(&x) && (0..self.height as i64).contains(&y)).then(|| (y * width + x) as usize)
    }

    /// Returns the mean over the window, and the weight of the pixels that shared.
    fn at(&self, i: usize) -> (PixelLight, f32) {
        let mut sum = self.sampled[i].without_shared();
        let Some(facet) = &self.facets[i] else { return (sum, 0.0) };
        let footprint_m = self.gbuffer[i].footprint_m;
        let (x, y) = ((i % self.width) as i64, (i / self.width) as i64);
        let mut window = [(0, 0.0, 0.0); 25];
        let mut count = 0;
        let (mut weights, mut brightness, mut squares, mut weights2) = (0.0, 0.0, 0.0, 0.0);
        for dy in -2..=2_i64 {
            for dx in -2..=2_i64 {
                let Some(j) = self.index(x + dx, y + dy) else { continue };
                let Some(other) = &self.facets[j] else { continue };
                if j != i && !facet.is_like(footprint_m, other) {
                    continue;
                }
                let weight = if dx.abs() == 2 { 0.5 } else { 1.0 } * if dy.abs() == 2 { 0.5 } else { 1.0 };
                let own = self.sampled[j].brightness();
                window[count] = (j, weight, own);
                count += 1;
                weights += weight;
                brightness += weight * own;
                squares += weight * own * own;
                weights2 += weight * weight;
            }
        }
        for &(j, weight, own) in &window[..count] {
            let others = (brightness - weight * own) / (weights - weight).max(f32::MIN_POSITIVE);
            // A sample far brighter than all others around it is an outlier (firefly).
            let share = if count > 4 && own > MAX_OUTLIER * others { MAX_OUTLIER * others / own } else { 1.0 };
            sum.add(&self.sampled[j], weight * share);
        }
        sum.divide(weights);
        let variance = (squares / weights - (brightness / weights).powi(2)).max(0.0);
        sum.variance = variance * weights2 / (weights * weights);
        (sum, weights)
    }

    /// Removes remaining noise with a wider, sparser window that does not mix clearly different values.
    fn wider(&self, i: usize) -> PixelLight {
        let own = &self.sampled[i];
        let Some(facet) = &self.facets[i] else { return *own };
        let footprint_m = self.gbuffer[i].footprint_m;
        let (x, y) = ((i % self.width) as i64, (i / self.width) as i64);
        let mut sum = own.without_shared();
        let mut weights = 0.0;
        for dy in [-WIDE_TAP_PX, 0, WIDE_TAP_PX] {
            for dx in [-WIDE_TAP_PX, 0, WIDE_TAP_PX] {
                let Some(j) = self.index(x + dx, y + dy) else { continue };
                let Some(other) = &self.facets[j] else { continue };
                if j != i && !facet.is_like(footprint_m, other) {
                    continue;
                }
                let weight = own.likeness(&self.sampled[j]);
                sum.add(&self.sampled[j], weight);
                weights += weight;
            }
        }
        sum.divide(weights);
        sum
    }

    /// Whether a neighbouring pixel sees another surface.
    fn is_edge(&self, i: usize) -> bool {
        let (x, y) = ((i % self.width) as i64, (i / self.width) as i64);
        let here = &self.gbuffer[i];
        [(-1, 0), (1, 0), (0, -1), (0, 1)].into_iter().filter_map(|(dx, dy)| self.index(x + dx, y + dy)).any(|j| {
            let there = &self.gbuffer[j];
            let differs = |a: Vec3, b: Vec3| (a - b).abs().max_element() > 0.05 * (a + b).max_element() + 0.01;
            match (&here.surface, &there.surface) {
                (Some(a), Some(b)) => {
                    !Facet::of(a).is_like(here.footprint_m, &Facet::of(b))
                        || a.normal.dot(b.normal) < 0.95
                        || differs(a.base_color, b.base_color)
                        || differs(here.light, there.light)
                        || differs(here.tint, there.tint)
                        || differs(self.sampled[i].sun, self.sampled[j].sun)
                }
                (None, None) => differs(here.light, there.light),
                _ => true,
            }
        })
    }

    /// Returns a pixel nearby whose light can be reused for a view ray within this pixel.
    fn like(&self, sub: &GBufferSample, x: usize, y: usize) -> Option<usize> {
        let facet = Facet::of(sub.surface.as_ref()?);
        let offsets = [(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];
        let candidates = offsets.into_iter().filter_map(|(dx, dy)| self.index(x as i64 + dx, y as i64 + dy));
        candidates
            .filter_map(|j| {
                let other = self.facets[j].as_ref()?;
                let near = other.position.distance_squared(facet.position);
                let close = near < (4.0 * sub.footprint_m + 0.01).powi(2);
                (close && facet.is_like(0.5 * sub.footprint_m, other)).then_some((j, near))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(j, _)| j)
    }
}
