use lo_geometry::{Vec2, Vec3};
use lo_imaging::{Image, luminance};
use lo_scene::Frame;
use rayon::prelude::*;

/// Side of the tiles of which the strongest edge is measured, pixels.
const TILE: usize = 32;

/// Most tiles that are measured, evenly distributed.
const MOST_TILES: usize = 3000;

/// Half the length of an edge's profile, pixels.
const REACH: usize = 6;

/// Samples of a profile per pixel.
const SAMPLES: usize = 4;

/// Samples at each end of a profile that form a plateau.
const PLATEAU: usize = 9;

/// Least contrast of an edge: its step over the sum of its plateaus.
const LEAST_CONTRAST: f32 = 0.25;

/// Greatest variation along a plateau, over the edge's step.
const MOST_VARIATION: f32 = 0.2;

/// Fewest edges for a measurement.
const LEAST_EDGES: usize = 8;

/// Share of the edges that are sharper than the photo's lens: the others are soft themselves.
const SHARPER_SHARE: f32 = 0.2;

/// Width of rendered edges by the same measure, pixels; see `rendered_edges_have_their_width`.
const RENDERED_PX: f32 = 0.63;

/// Greatest blur of an object, pixels.
const MOST_BLUR_PX: f32 = 6.0;

/// Standard deviations over the distance between the quartiles of a normal distribution.
const DEVIATIONS: f32 = 1.0 / 1.349;

/// Distance in the photo at which an edge counts little, as a share of its longer side.
const NEAR_SHARE: f32 = 0.3;

/// Relative difference of inverse distances, to which blur is proportional, at which an edge counts little.
const NEAR_FOCUS: f32 = 0.3;

/// Sharpness of a photo: the widths of its edges.
#[derive(Clone, Debug)]
pub(crate) struct Sharpness {
    edges: Vec<Edge>,
}

#[derive(Clone, Debug)]
struct Edge {
    /// Place, as a share of the photo's longer side.
    at: Vec2,
    /// Depth of the nearer side, if it is known.
    depth_m: Option<f32>,
    /// Standard deviation of the edge's spread, pixels.
    width_px: f32,
}

impl Sharpness {
    /// Measures the edges of a frame's photo.
    pub fn measure(frame: &Frame) -> Self {
        let (width, height) = (frame.photo.width(), frame.photo.height());
        let side = TILE + 2 * (REACH + 2);
        if width < side || height < side {
            return Self { edges: Vec::new() };
        }
        let (columns, rows) = ((width - side) / TILE + 1, (height - side) / TILE + 1);
        let step = ((columns * rows) as f64 / MOST_TILES as f64).sqrt().ceil().max(1.0) as usize;
        let tiles: Vec<(usize, usize)> = (0..rows)
            .step_by(step)
            .flat_map(|y| (0..columns).step_by(step).map(move |x| (x * TILE, y * TILE)))
            .collect();
        let edge = |(left, top): (usize, usize)| {
            let tile = Image::from_fn(side, side, |x, y| luminance(frame.photo.linear_at((left + x, top + y))));
            let (at, across, width_px) = strongest_edge(&tile)?;
            let at = at + Vec2::new(left as f32, top as f32);
            let side = |sign: f32| depth_at(frame, at + across * (sign * REACH as f32));
            let depth_m = match (side(-1.0), side(1.0)) {
                (Some(a), Some(b)) => Some(a.min(b)),
                (a, b) => a.or(b),
            };
            Some(Edge { at: at / width.max(height) as f32, depth_m, width_px })
        };
        Self { edges: tiles.into_par_iter().filter_map(edge).collect() }
    }

    /// Returns the standard deviation of the blur, in pixels, that gives a rendered object the sharpness of the photo
    /// at a place (a share of the longer side) and depth: that of the sharper edges there.
    pub fn blur_px(&self, at: Vec2, depth_m: f32) -> f32 {
        if self.edges.len() < LEAST_EDGES {
            return 0.0;
        }
        let weight = |edge: &Edge| {
            let off = edge.at.distance(at) / NEAR_SHARE;
            let focus = edge.depth_m.map_or(1.0, |depth| (depth_m / depth - 1.0) / NEAR_FOCUS);
            // some weight for all edges, since there may be none at this depth
            (-0.5 * (off * off + focus * focus)).exp() + 0.003
        };
        let mut edges: Vec<(f32, f32)> = self.edges.iter().map(|edge| (edge.width_px, weight(edge))).collect();
        edges.sort_by(|a, b| a.0.total_cmp(&b.0));
        let sum: f32 = edges.iter().map(|edge| edge.1).sum();
        let mut rest = SHARPER_SHARE * sum;
        let width_px = edges.iter().find(|(_, weight)| {
            rest -= weight;
            rest <= 0.0
        });
        let width_px = width_px.map_or(RENDERED_PX, |edge| edge.0);
        (width_px * width_px - RENDERED_PX * RENDERED_PX).max(0.0).sqrt().min(MOST_BLUR_PX)
    }
}

/// Returns the depth at a place of the photo, in metres.
fn depth_at(frame: &Frame, at: Vec2) -> Option<f32> {
    let depth = &frame.depth_m;
    let (u, v) = (at.x / frame.photo.width() as f32, at.y / frame.photo.height() as f32);
    let inside = (0.0..1.0).contains(&u) && (0.0..1.0).contains(&v);
    let pixel = inside.then(|| ((u * depth.width() as f32) as usize, (v * depth.height() as f32) as usize))?;
    Some(depth[pixel]).filter(|&depth| depth > 0.0)
}

/// Finds the strongest edge of a tile with a border: its place, the unit vector across it towards its brighter side,
/// and its width. `None` if it is not a step between two plateaus.
fn strongest_edge(tile: &Image<f32>) -> Option<(Vec2, Vec2, f32)> {
    let border = REACH + 2;
    let inner = border..border + TILE;
    let slope =
        |x: usize, y: usize| Vec2::new(tile[(x + 1, y)] - tile[(x - 1, y)], tile[(x, y + 1)] - tile[(x, y - 1)]);
    let places = inner.clone().flat_map(|y| inner.clone().map(move |x| (x, y)));
    let (x, y) = places.max_by(|a, b| slope(a.0, a.1).length().total_cmp(&slope(b.0, b.1).length()))?;
    let across = slope(x, y).try_normalize()?;
    let middle = Vec2::new(x as f32, y as f32);
    let profile: [f32; 2 * REACH * SAMPLES + 1] =
        std::array::from_fn(|i| interpolated(tile, middle + across * (i as f32 / SAMPLES as f32 - REACH as f32)));
    let (low, high) = (&profile[..PLATEAU], &profile[profile.len() - PLATEAU..]);
    let mean = |plateau: &[f32]| plateau.iter().sum::<f32>() / PLATEAU as f32;
    let (from, to) = (mean(low), mean(high));
    let step = to - from;
    let is_flat = |plateau: &[f32]| {
        let (least, most) = plateau.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), &v| (a.min(v), b.max(v)));
        most - least <= MOST_VARIATION * step
    };
    let overshoots = profile.iter().any(|v| (v - from) / step < -MOST_VARIATION || (v - to) / step > MOST_VARIATION);
    if step < LEAST_CONTRAST * (from + to) || !is_flat(low) || !is_flat(high) || overshoots {
        return None;
    }
    let quartile = |share: f32| {
        let value = from + share * step;
        let next = (1..profile.len()).find(|&i| profile[i - 1] < value && profile[i] >= value)?;
        Some((next - 1) as f32 + (value - profile[next - 1]) / (profile[next] - profile[next - 1]))
    };
    let width_px = (quartile(0.75)? - quartile(0.25)?) / SAMPLES as f32 * DEVIATIONS;
    (width_px > 0.0).then_some((middle + Vec2::splat(0.5), across, width_px))
}

/// Interpolates between four pixels; `at` counts from the middle of the first.
fn interpolated(tile: &Image<f32>, at: Vec2) -> f32 {
    let (x, y) = (at.x as usize, at.y as usize);
    let (fx, fy) = (at.x.fract(), at.y.fract());
    let row = |y: usize| tile[(x, y)] * (1.0 - fx) + tile[(x + 1, y)] * fx;
    row(y) * (1.0 - fy) + row(y + 1) * fy
}

/// Share of an object in a pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Cover {
    /// Radiance of the visible share, premultiplied by it.
    pub radiance: Vec3,
    /// Share of the pixel that shows the object.
    pub visible: f32,
    /// Share of the pixel in which real surfaces hide the object.
    pub hidden: f32,
}

impl Cover {
    fn plus(self, other: Self, weight: f32) -> Self {
        Self {
            radiance: self.radiance + other.radiance * weight,
            visible: self.visible + other.visible * weight,
            hidden: self.hidden + other.hidden * weight,
        }
    }
}

/// Blurs an object by a Gaussian of a standard deviation in pixels. Edges of what hides it stay as they are.
pub(crate) fn softened(cover: &Image<Cover>, deviation_px: f32) -> Image<Cover> {
    let soft = blurred(cover, deviation_px);
    Image::from_fn(cover.width(), cover.height(), |x, y| {
        let (sharp, soft) = (cover[(x, y)], soft[(x, y)]);
        // beside the object, as many of the spread pixels are hidden as of the object nearby
        let of = if sharp.visible + sharp.hidden > 0.0 { sharp } else { soft };
        let shown = of.visible / (of.visible + of.hidden).max(f32::MIN_POSITIVE);
        let visible = (soft.visible + soft.hidden).min(1.0) * shown;
        Cover { radiance: soft.radiance * (visible / soft.visible.max(f32::MIN_POSITIVE)), visible, ..sharp }
    })
}

fn blurred(cover: &Image<Cover>, deviation_px: f32) -> Image<Cover> {
    let reach = (3.0 * deviation_px).ceil() as usize;
    let weight = |offset: usize| (-0.5 * (offset as f32 / deviation_px).powi(2)).exp();
    let sum: f32 = weight(0) + 2.0 * (1..=reach).map(weight).sum::<f32>();
    let weights: Vec<f32> = (0..=reach).map(|offset| weight(offset) / sum).collect();
    let (width, height) = (cover.width(), cover.height());
    let near = |at: usize, length: usize| at.saturating_sub(reach)..(at + reach + 1).min(length);
    let image = |pixel: &(dyn Fn(usize, usize) -> Cover + Sync)| {
        let pixels = (0..width * height).into_par_iter().map(|i| pixel(i % width, i / width)).collect();
        Image::new(width, height, pixels)
    };
    let rows: Image<Cover> = image(&|x, y| {
        near(x, width).fold(Cover::default(), |sum, other| sum.plus(cover[(other, y)], weights[other.abs_diff(x)]))
    });
    image(&|x, y| {
        near(y, height).fold(Cover::default(), |sum, other| sum.plus(rows[(x, other)], weights[other.abs_diff(y)]))
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lo_geometry::Camera;
    use lo_imaging::{DepthMap, Photo, RadianceImage};

    /// Coverage of a pixel by the side of an edge, by 16 × 16 samples.
    fn coverage(x: usize, y: usize, normal: Vec2, offset: f32) -> f32 {
        let inside = |i: usize| {
            let sample = Vec2::new((i % 16) as f32, (i / 16) as f32) / 16.0 + Vec2::splat(0.5 / 16.0);
            (Vec2::new(x as f32, y as f32) + sample).dot(normal) > offset
        };
        (0..256).filter(|&i| inside(i)).count() as f32 / 256.0
    }

    /// A photo of squares, each crossed by an edge of another direction, with the blur of a lens.
    fn edges(blur_px: f32) -> Frame {
        let tile = 64;
        let (columns, rows) = (8, 6);
        let image = Image::from_fn(tile * columns, tile * rows, |x, y| {
            let index = y / tile * columns + x / tile;
            let angle = index as f32 * 2.4;
            let normal = Vec2::new(angle.cos(), angle.sin());
            let middle = 32.0 + 0.37 * (index % 5) as f32;
            let share = coverage(x % tile, y % tile, normal, Vec2::splat(middle).dot(normal));
            Cover { radiance: Vec3::splat(0.2 + 0.5 * share), visible: 1.0, hidden: 0.0 }
        });
        let image = if blur_px > 0.0 { blurred(&image, blur_px) } else { image };
        let radiance =
            RadianceImage::new(image.width(), image.height(), image.map(|p| p.radiance.to_array()).into_pixels());
        let camera = Camera::from_hfov_deg(60.0, image.width() as u32, image.height() as u32).unwrap();
        // left half at 1 m, right half at 4 m
        let depth = DepthMap::from_fn(16, 12, |x, _| if x < 8 { 1.0 } else { 4.0 });
        Frame::new(Photo::Linear(radiance), depth, camera, 1.0).unwrap()
    }

    #[test]
    fn rendered_edges_have_their_width() {
        let sharpness = Sharpness::measure(&edges(0.0));
        let mut widths: Vec<f32> = sharpness.edges.iter().map(|edge| edge.width_px).collect();
        assert!(widths.len() > 30, "{}", widths.len());
        widths.sort_by(f32::total_cmp);
        let median = widths[widths.len() / 2];
        assert!((median - RENDERED_PX).abs() < 0.05, "{median}");
        assert!(sharpness.blur_px(Vec2::new(0.5, 0.4), 2.0) < 0.2);
    }

    #[test]
    fn blur_of_a_lens_is_found() {
        for blur_px in [0.6, 1.0, 1.6, 2.4] {
            let found = Sharpness::measure(&edges(blur_px)).blur_px(Vec2::new(0.5, 0.4), 2.0);
            assert!((found / blur_px - 1.0).abs() < 0.12, "{found} instead of {blur_px}");
        }
    }

    #[test]
    fn the_blur_is_that_of_the_depth() {
        let (sharp, soft) = (edges(0.0), edges(2.0));
        let mut mixed = sharp.clone();
        let (Photo::Linear(image), Photo::Linear(other)) = (&mut mixed.photo, &soft.photo) else { panic!() };
        let half = image.width() / 2;
        for y in 0..image.height() {
            for x in half..image.width() {
                image[(x, y)] = other[(x, y)];
            }
        }
        let sharpness = Sharpness::measure(&mixed);
        let middle = Vec2::new(0.5, 0.4);
        let (near, far) = (sharpness.blur_px(middle, 1.0), sharpness.blur_px(middle, 4.0));
        assert!(near < 0.2 && (far - 2.0).abs() < 0.3, "{near} {far}");
    }

    #[test]
    fn photos_without_edges_blur_nothing() {
        let camera = Camera::from_hfov_deg(60.0, 320, 240).unwrap();
        let grey = RadianceImage::new(320, 240, vec![[0.4; 3]; 320 * 240]);
        let frame = Frame::new(Photo::Linear(grey), DepthMap::from_fn(8, 6, |_, _| 2.0), camera, 1.0).unwrap();
        assert_eq!(Sharpness::measure(&frame).blur_px(Vec2::splat(0.5), 2.0), 0.0);
    }

    #[test]
    fn blur_keeps_the_sum() {
        let dot = Image::from_fn(41, 31, |x, y| Cover {
            radiance: Vec3::ONE,
            visible: f32::from(u8::from((x, y) == (20, 15))),
            hidden: 0.0,
        });
        let soft = blurred(&dot, 2.0);
        let moment = |of: &dyn Fn(usize, usize) -> f32| -> f32 {
            (0..41 * 31).map(|i| of(i % 41, i / 41) * soft[(i % 41, i / 41)].visible).sum()
        };
        assert!((moment(&|_, _| 1.0) - 1.0).abs() < 1e-4);
        let variance = moment(&|x, _| (x as f32 - 20.0).powi(2));
        // less what is beyond three deviations
        assert!((variance.sqrt() / 2.0 - 1.0).abs() < 0.02, "{variance}");
    }

    #[test]
    fn edges_of_what_hides_an_object_stay_sharp() {
        // columns 10 to 29 show an object, of which a surface hides those from 20 on
        let cover = Image::from_fn(40, 9, |x, _| Cover {
            radiance: if (10..20).contains(&x) { Vec3::splat(2.0) } else { Vec3::ZERO },
            visible: f32::from(u8::from((10..20).contains(&x))),
            hidden: f32::from(u8::from((20..30).contains(&x))),
        });
        let soft = softened(&cover, 1.0);
        let visible: Vec<f32> = (0..40).map(|x| soft[(x, 4)].visible).collect();
        assert!(visible[8] > 0.05 && visible[8] < 0.1 && visible[9] > 0.25 && visible[10] < 0.75, "{visible:?}");
        assert!(visible[19] > 0.99 && visible[20..].iter().all(|&v| v < 1e-3), "{visible:?}");
        // the colour stays
        for x in 8..20 {
            let colour = soft[(x, 4)].radiance / soft[(x, 4)].visible;
            assert!((colour - Vec3::splat(2.0)).abs().max_element() < 1e-4, "{x}: {colour}");
        }
    }
}
