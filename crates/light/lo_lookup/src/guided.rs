//! Depth upsampled to the photo's resolution, with edges aligned to the photo.

use lo_geometry::Vec3;
use lo_imaging::{DepthMap, Image, Photo};
use lo_scene::resized_photo;
use rayon::prelude::*;

use crate::edges::edges;

/// Radius of the readings considered for a pixel's depth, in pixels of the depth map.
const REACH: usize = 2;

/// Standard deviations of the readings' weights: in colour (square root of radiance) and in pixels.
const COLOUR: f32 = 0.06;
const PIXELS: f32 = 1.0;

/// Greatest relative difference of the inverse depths of readings on one surface.
const ON_SURFACE: f32 = 0.05;

/// Scale factor from which a depth map is coarse: its edges follow its own pixels instead of the photo's edges.
const COARSE: f32 = 1.5;

/// Resamples to inverse depth at `width` × `height`; 0 where there is no reading nearby.
///
/// Near depth edges, each pixel of a coarse map belongs entirely to one side. Each output pixel there, and each without
/// a reading, gets the depth of one side: the one with the greatest total weight. This is joint bilateral upsampling
/// (Kopf et al. 2007) that does not blend across an edge, a weighted mode (Min et al. 2012). All other pixels are
/// resampled ([`lo_imaging::resize_depth`]).
pub(crate) fn guided_inverse(depth_m: &DepthMap, photo: &Photo, width: usize, height: usize) -> Image<f32> {
    let inverse_of = |depth_m: &DepthMap| depth_m.map(|&z| if z > 0.0 { 1.0 / z } else { 0.0 });
    let coarse = inverse_of(depth_m);
    let (columns, rows) = (coarse.width(), coarse.height());
    let fine = inverse_of(&lo_imaging::resize_depth(depth_m, width, height));
    let is_coarse = width as f32 >= COARSE * columns as f32;
    let near_edge = beside_edges(&coarse);
    let colour = |width, height| {
        let linear = resized_photo(photo, width, height).into_radiance();
        linear.map(|&rgb| Vec3::from(rgb).max(Vec3::ZERO).map(f32::sqrt))
    };
    let (own, of_reading) = (colour(width, height), colour(columns, rows));
    let chosen = |x: usize, y: usize| {
        let at = |index: usize, of: usize, size: usize| (index as f32 + 0.5) * size as f32 / of as f32;
        let (u, v) = (at(x, width, columns), at(y, height, rows));
        let (column, row) = ((u as usize).min(columns - 1), (v as usize).min(rows - 1));
        let known = fine[(x, y)];
        if known > 0.0 && !(is_coarse && near_edge[(column, row)]) {
            return known;
        }
        let around = (row.saturating_sub(REACH)..rows.min(row + REACH + 1))
            .flat_map(|y| (column.saturating_sub(REACH)..columns.min(column + REACH + 1)).map(move |x| (x, y)));
        let weight = |at: (usize, usize)| {
            let colour = (own[(x, y)] - of_reading[at]).length_squared() / (COLOUR * COLOUR);
            let (du, dv) = (at.0 as f32 + 0.5 - u, at.1 as f32 + 0.5 - v);
            (-0.5 * (colour + (du * du + dv * dv) / (PIXELS * PIXELS))).exp().max(1e-30)
        };
        let readings: Vec<(f32, f32)> =
            around.filter(|&at| coarse[at] > 0.0).map(|at| (coarse[at], weight(at))).collect();
        // Sums of weights, and of weight × inverse depth, over the readings of one surface; the surface with the
        // greatest weight wins.
        let surface = |&(of, _): &(f32, f32)| {
            let on = readings.iter().filter(|(inverse, _)| (inverse - of).abs() < ON_SURFACE * of);
            on.fold((0.0, 0.0), |(total, sum), (inverse, weight)| (total + weight, sum + weight * inverse))
        };
        let best = readings.iter().map(surface).max_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or(0.0, |(total, sum)| sum / total)
    };
    let rows: Vec<Vec<f32>> = (0..height).into_par_iter().map(|y| (0..width).map(|x| chosen(x, y)).collect()).collect();
    Image::new(width, height, rows.into_iter().flatten().collect())
}

/// Returns the pixels at a depth edge or a hole, and their neighbours.
fn beside_edges(inverse: &Image<f32>) -> Image<bool> {
    let (edge, _) = edges(inverse);
    let (width, height) = (inverse.width(), inverse.height());
    Image::from_fn(width, height, |x, y| {
        let rows = y.saturating_sub(2)..height.min(y + 2);
        let mut around = rows.flat_map(|y| (x.saturating_sub(2)..width.min(x + 2)).map(move |x| (x, y)));
        around.any(|at| edge[at])
    })
}
