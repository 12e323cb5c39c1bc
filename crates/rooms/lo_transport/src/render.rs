//! Views: first what each pixel sees, then a few light samples at each, then a filter that shares them among pixels of one
//! surface, last the edges.

use std::f32::consts::PI;

use lo_geometry::{Vec2, Vec3};
use lo_imaging::{Image, RadianceImage};
use rayon::prelude::*;

use crate::baked::BakedWorld;
use crate::gbuffer::{Facet, Seen, look};
use crate::lights::{Source, luminance};
use crate::pattern::{self, Rotations, shifted};
use crate::shade::{Lit, Sampler};
use crate::{RenderedView, View};

/// Places of the first samples at edges, in pixels from the middle: a rotated square.
const EDGE_SAMPLES: [[f32; 2]; 4] = [[-0.125, -0.375], [0.375, -0.125], [0.125, 0.375], [-0.375, 0.125]];

/// Light samples of each of them where nobody shares.
const EDGE_RAYS: u32 = 4;

/// Where these samples differ by more than the given share of their brightness, how much of the pixel is bright counts. It takes so
/// many samples as would be this many if all pixels of the view did, but at most [`MAX_EDGE_SAMPLES`]: in pictures of few pixels
/// more of them lie at edges.
const CONTRASTS: [(f32, usize); 2] = [(0.5, 2_000_000), (0.1, 500_000)];
const MAX_EDGE_SAMPLES: usize = 64;

/// Lamps that fit into a square of so many pixels, and the samples that pixels take which see them.
const LAMPS: [(f32, usize); 2] = [(2.0, 256), (12.0, 64)];

/// Views of fewer pixels are rendered more finely, up to so many times as finely each way.
const FINE_PIXELS: usize = 40_000;
const MAX_FINENESS: usize = 8;

/// Light samples of a view, as long as its pixels take no fewer than [`crate::BakeSettings::pixel_light_rays`] and no more than
/// [`MAX_PIXEL_RAYS`]: where pixels are few, fewer of them see the same surface and share what they found.
const VIEW_RAYS: usize = 120_000;
const MAX_PIXEL_RAYS: u32 = 16;

/// A sample is no brighter than this many times the mean of those around it.
const FIREFLY: f32 = 10.0;

/// Fewer pixels of the same surface than this within the filter, and a pixel takes samples of its own.
const MIN_SHARED: f32 = 6.0;

/// Distance of the taps of the second filter, pixels.
const WIDE: i64 = 4;

/// Light samples where there is nobody to share with.
const LONELY_RAYS: u32 = 12;

impl BakedWorld {
    /// Renders a view: light of lamps, sky and sun is sampled at each pixel, all other light on matte surfaces comes
    /// from the cache, gloss and mirrors are traced.
    pub fn render(&self, view: &View) -> RenderedView {
        render(self, view)
    }
}

fn render(baked: &BakedWorld, view: &View) -> RenderedView {
    let (width, height) = view.size();
    let seen = middles(baked, view);
    let radiance = match fineness(seen.len()) {
        1 => radiance(baked, view, &seen),
        times => {
            let fine = view.finer(times);
            lo_imaging::resize(&radiance(baked, &fine, &middles(baked, &fine)), width, height)
        }
    };
    let camera_from_world = view.pose().rotation.conjugate();
    let image = |pixel: &dyn Fn(&Seen) -> [f32; 3]| Image::new(width, height, seen.iter().map(pixel).collect());
    RenderedView {
        radiance,
        depth_m: Image::new(width, height, seen.iter().map(|s| view.depth_m(s.distance_m, s.direction)).collect()),
        normal: image(&|s| (camera_from_world * s.normal).to_array()),
        albedo: image(&|s| s.albedo.to_array()),
        specular: Image::new(width, height, seen.iter().map(|s| s.specular).collect()),
    }
}

/// What the rays through the middles of all pixels see.
fn middles(baked: &BakedWorld, view: &View) -> Vec<Seen> {
    let (width, height) = view.size();
    let middle = |i: usize| look(baked, view, (i % width) as f32 + 0.5, (i / width) as f32 + 0.5);
    (0..width * height).into_par_iter().map(middle).collect()
}

/// How many times as fine each way a view of so many pixels is rendered, to be averaged: pixels that share light samples
/// must not be far apart, nor what they see differ much within them.
fn fineness(pixels: usize) -> usize {
    ((FINE_PIXELS / pixels.max(1)).isqrt()).clamp(1, MAX_FINENESS)
}

/// Radiance of all pixels, given what their middles see.
fn radiance(baked: &BakedWorld, view: &View, seen: &[Seen]) -> RadianceImage {
    let (width, height) = view.size();
    let at = |i: usize| (i % width, i / width);
    let sampler = Sampler::new(baked, view);
    let least_rays = baked.settings().pixel_light_rays;
    let rays = (VIEW_RAYS.div_ceil(seen.len().max(1)) as u32).clamp(least_rays, least_rays.max(MAX_PIXEL_RAYS));
    let sampled: Vec<Lit> = seen.par_iter().enumerate().map(|(i, seen)| sampler.sample(seen, at(i), rays)).collect();
    let facets: Vec<Option<Facet>> = seen.par_iter().map(|seen| seen.surface.as_ref().map(Facet::of)).collect();
    let filter = Filter { seen, facets: &facets, sampled: &sampled, width, height, wraps: view.wraps() };
    let lit: Vec<Lit> = (0..seen.len())
        .into_par_iter()
        .map(|i| {
            let (mut lit, shared) = filter.at(i);
            if shared < MIN_SHARED && seen[i].surface.is_some() {
                let own = sampler.sample(&seen[i], at(i), LONELY_RAYS);
                lit.mix(&own, shared * rays as f32, LONELY_RAYS as f32);
            }
            lit
        })
        .collect();
    let wide = Filter { sampled: &lit, ..filter };
    let lit: Vec<Lit> = (0..seen.len()).into_par_iter().map(|i| wide.wider(i)).collect();
    // No two in a row or column: lamps seen edge-on are thinner than any grid.
    let within_pixel: [Vec2; LAMPS[0].1] = std::array::from_fn(|k| pattern::r2(k as u32));
    let shifts = Rotations::new("transport edges", baked.settings().seed);
    let lamps = lamp_samples(baked, view);
    let radiance = |i: usize| {
        let (x, y) = at(i);
        let within = |number: usize, [dx, dy]: [f32; 2], rays: u32| {
            let sub = look(baked, view, x as f32 + 0.5 + dx, y as f32 + 0.5 + dy);
            let light = match sub.surface.as_ref().filter(|_| lamps[i] == 0).and_then(|_| filter.like(&sub, x, y)) {
                Some(like) if baked.settings().sun_at_edges => {
                    let mut light = lit[like];
                    sampler.renew_sun(&sub, (x, y), number, &mut light);
                    light
                }
                Some(like) => lit[like],
                None => sampler.sample(&sub, (x, y), rays),
            };
            shown(baked, &sub, &light)
        };
        let mean = |samples: usize| {
            // Many samples of a pixel need few light samples each.
            let rays = (EDGE_SAMPLES.len() as u32 * LONELY_RAYS).div_ceil(samples as u32);
            let [dx, dy, ..] = shifts.of(i * 997);
            let place = |at: &Vec2| [shifted(at.x, dx) - 0.5, shifted(at.y, dy) - 0.5];
            let each = within_pixel[..samples].iter().enumerate();
            each.map(|(number, at)| within(number, place(at), rays)).sum::<Vec3>() / samples as f32
        };
        if lamps[i] > 0 {
            return mean(lamps[i]).to_array();
        }
        if !filter.is_edge(i) {
            return shown(baked, &seen[i], &lit[i]).to_array();
        }
        let few = std::array::from_fn(|number| within(number, EDGE_SAMPLES[number], EDGE_RAYS));
        let contrast = contrast(few);
        let wanted = CONTRASTS.iter().find(|(least, _)| contrast > *least);
        let samples = wanted.map_or(0, |(_, of_view)| (of_view / seen.len()).min(MAX_EDGE_SAMPLES));
        if samples > few.len() {
            mean(samples).to_array()
        } else {
            (few.into_iter().sum::<Vec3>() / few.len() as f32).to_array()
        }
    };
    Image::new(width, height, (0..seen.len()).into_par_iter().map(radiance).collect())
}

/// Difference of the brightest and the darkest over their sum: 0 where all are alike, 1 where one is black.
fn contrast(lights: [Vec3; 4]) -> f32 {
    let brightness = lights.map(luminance);
    let high = brightness.into_iter().fold(0.0, f32::max);
    let low = brightness.into_iter().fold(high, f32::min);
    (high - low) / (high + low).max(f32::MIN_POSITIVE)
}

/// How many samples each pixel takes because small lamps may lie in it; 0 where none do.
fn lamp_samples(baked: &BakedWorld, view: &View) -> Vec<usize> {
    let (width, height) = view.size();
    let wraps = view.wraps();
    let mut samples = vec![0; width * height];
    for emitter in &baked.cache().lighting.emitters.list {
        if emitter.source == Source::Portal || emitter.sheet {
            continue;
        }
        let corners = emitter.corners().map(|corner| view.pixel(corner));
        let [Some(mut a), Some(mut b), Some(mut c), _] = corners else { continue };
        if wraps && (a.max(b).max(c) - a.min(b).min(c)).x > 0.5 * width as f32 {
            // Across the seam.
            for corner in [&mut a, &mut b, &mut c] {
                corner.x += if corner.x < 0.5 * width as f32 { width as f32 } else { 0.0 };
            }
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let extent = (high - low).max_element();
        let Some(&(_, wanted)) = LAMPS.iter().find(|(most, _)| extent <= *most) else { continue };
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

/// Radiance of a view ray, from the light on its surface.
fn shown(baked: &BakedWorld, seen: &Seen, lit: &Lit) -> Vec3 {
    let Some(surface) = &seen.surface else { return seen.light };
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
    seen.light + seen.tint * light
}

/// Shares samples among pixels that see one surface. The pattern of samples repeats every four pixels, and so does the
/// window: five pixels wide, the outer ones with half the weight.
struct Filter<'a> {
    seen: &'a [Seen],
    /// What the window looks at most, close together.
    facets: &'a [Option<Facet>],
    sampled: &'a [Lit],
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

    /// The mean over the window, and how many pixels shared.
    fn at(&self, i: usize) -> (Lit, f32) {
        let mut sum = self.sampled[i].nothing();
        let Some(facet) = &self.facets[i] else { return (sum, 0.0) };
        let footprint_m = self.seen[i].footprint_m;
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
            // One sample among many that is far brighter than all of them says little of the light here.
            let share = if count > 4 && own > FIREFLY * others { FIREFLY * others / own } else { 1.0 };
            sum.add(&self.sampled[j], weight * share);
        }
        sum.divide(weights);
        let variance = (squares / weights - (brightness / weights).powi(2)).max(0.0);
        sum.variance = variance * weights2 / (weights * weights);
        (sum, weights)
    }

    /// What is left of the noise, taken away by a wider and sparser window that does not mix what differs much.
    fn wider(&self, i: usize) -> Lit {
        let own = &self.sampled[i];
        let Some(facet) = &self.facets[i] else { return *own };
        let footprint_m = self.seen[i].footprint_m;
        let (x, y) = ((i % self.width) as i64, (i / self.width) as i64);
        let mut sum = own.nothing();
        let mut weights = 0.0;
        for dy in [-WIDE, 0, WIDE] {
            for dx in [-WIDE, 0, WIDE] {
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

    /// Whether a neighbour sees something else.
    fn is_edge(&self, i: usize) -> bool {
        let (x, y) = ((i % self.width) as i64, (i / self.width) as i64);
        let here = &self.seen[i];
        [(-1, 0), (1, 0), (0, -1), (0, 1)].into_iter().filter_map(|(dx, dy)| self.index(x + dx, y + dy)).any(|j| {
            let there = &self.seen[j];
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

    /// A pixel around whose light serves a view ray within it.
    fn like(&self, sub: &Seen, x: usize, y: usize) -> Option<usize> {
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
