//! Restoration of the radiance of clipped highlights.

use lo_geometry::Vec3;
use lo_imaging::{Image, RadianceImage, luminance};
use lo_scene::Frame;

/// Clipping level of a channel: 250 of 255 in linear light, before exposure.
const CLIP_LEVEL: f32 = 0.956;

/// Statistics of restored highlights.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HighlightReport {
    /// Share of the photo's pixels that are clipped.
    pub clipped_share: f32,
    /// Number of connected regions that were brightened.
    pub brightened_regions: usize,
    /// Greatest radiance of a brightened region.
    pub peak_radiance: f32,
}

impl HighlightReport {
    /// Combines the reports of `photos` photos.
    pub(crate) fn combined_with(self, other: Self, photos: usize) -> Self {
        Self {
            clipped_share: self.clipped_share + other.clipped_share / photos as f32,
            brightened_regions: self.brightened_regions + other.brightened_regions,
            peak_radiance: self.peak_radiance.max(other.peak_radiance),
        }
    }
}

/// Returns the photo's radiance with plausible values in clipped pixels.
///
/// Connected regions of clipped pixels (a channel at 250 of 255 or more) are treated as lamps and windows as far as all
/// three channels are clipped; a white wall or a saturated red box clips in one. Let `f` be the share of such pixels in
/// the region, `A` its share of the photo and `w = clamp((f − 0.4) / 0.5, 0, 1)`. The region's mean radiance is
/// multiplied by `1 + w (G − 1)`, `G = 2.46 (A / 2·10⁻⁴)^0.19`, with A limited to 10⁻⁴…2·10⁻²: 2.2 for a glint, 5.9 for
/// a window.
///
/// Within the region, radiance grows from its edge inwards, as in the expand map of Banterle et al. 2006 and the
/// brightness enhancement function of Rempel et al. 2007. Half of the hue is taken from the surrounding pixels.
/// Surfaces in `lit_only` (such as those facing up: tables, floors, paper) reflect light instead of emitting it: their
/// share of a region counts as not clipped.
///
/// The constants are least squares in log radiance on 322 regions, tested on the 107 of 154 crops (240 × 160, 55–75°
/// wide, median exposed to 0.2 ± ½ EV, clipped at 1) of 11 HDR panoramas of real interiors in which at least 0.2 % is
/// clipped. RMS error of ln(sum over clipped pixels) 0.77, bias −0.12; left as clipped 1.53, bias −1.2. Single lamps
/// are off by a factor of three up or down, which nothing in the photo reveals.
fn recover(frame: &Frame, lit_only: impl Fn(usize, usize) -> bool) -> (RadianceImage, HighlightReport) {
    let mut radiance = frame.radiance();
    let clipped = frame.clipped();
    let count = clipped.pixels().iter().filter(|&&c| c).count();
    if count == 0 {
        return (radiance, HighlightReport::default());
    }
    let (width, height) = (clipped.width(), clipped.height());
    let level = CLIP_LEVEL * frame.exposure;
    let inwards = distance_inwards(&clipped);
    let mut visited = clipped.map(|&c| !c);
    let mut report =
        HighlightReport { clipped_share: count as f32 / (width * height) as f32, ..HighlightReport::default() };
    for start in 0..width * height {
        if visited.pixels()[start] {
            continue;
        }
        visited.pixels_mut()[start] = true;
        let mut region = vec![(start % width, start / width)];
        let (mut full, mut depth_sum) = (0usize, 0usize);
        let (mut hue, mut rim) = ([0.0f32; 3], 0usize);
        let mut next = 0;
        while next < region.len() {
            let (x, y) = region[next];
            next += 1;
            full += usize::from(radiance[(x, y)].iter().all(|&c| c >= level) && !lit_only(x, y));
            depth_sum += usize::from(inwards[(x, y)]);
            for (dx, dy) in [(-1, 0), (1, 0), (0, -1), (0, 1)] {
                let (Some(nx), Some(ny)) = (x.checked_add_signed(dx), y.checked_add_signed(dy)) else { continue };
                if nx >= width || ny >= height {
                    continue;
                }
                if !clipped[(nx, ny)] {
                    let around = radiance[(nx, ny)];
                    let scale = luminance(around).max(1e-6);
                    hue = std::array::from_fn(|c| hue[c] + around[c] / scale);
                    rim += 1;
                } else if !visited[(nx, ny)] {
                    visited[(nx, ny)] = true;
                    region.push((nx, ny));
                }
            }
        }
        let gain = gain(full as f32 / region.len() as f32, region.len() as f32 / (width * height) as f32);
        if gain <= 1.0 {
            continue;
        }
        report.brightened_regions += 1;
        let hue = hue.map(|h| if rim > 0 { h / rim as f32 } else { 1.0 });
        let mean_depth = depth_sum as f32 / region.len() as f32;
        for (x, y) in region {
            let own = radiance[(x, y)];
            let added = (gain - 1.0) * luminance(own) * f32::from(inwards[(x, y)]) / mean_depth;
            let scale = luminance(own).max(1e-6);
            radiance[(x, y)] = std::array::from_fn(|c| own[c] + added * 0.5 * (own[c] / scale + hue[c]));
            report.peak_radiance = report.peak_radiance.max(luminance(radiance[(x, y)]));
        }
    }
    (radiance, report)
}

/// Applies [`recover`], treating upward-facing surfaces as reflecting: white tables and papers are often clipped.
/// `normals` may have a different resolution than the photo.
pub(crate) fn restore_highlights(
    frame: &Frame,
    normals: &Image<Option<Vec3>>,
    up: Vec3,
) -> (RadianceImage, HighlightReport) {
    let (width, height) = (frame.photo.width(), frame.photo.height());
    recover(frame, |x, y| {
        let pixel = (x * normals.width() / width, y * normals.height() / height);
        normals[pixel].is_some_and(|normal| normal.dot(up) > 0.6)
    })
}

/// Returns the factor on the mean radiance of a region, where `full` is its share that is clipped in all channels and
/// `area` its share of the photo.
fn gain(full: f32, area: f32) -> f32 {
    let weight = ((full - 0.4) / 0.5).clamp(0.0, 1.0);
    1.0 + weight * (2.46 * (area.clamp(1e-4, 2e-2) / 2e-4).powf(0.19) - 1.0)
}

/// Returns the city-block distance of each clipped pixel from the nearest unclipped one, at most 255; the image border
/// is not an edge.
fn distance_inwards(clipped: &Image<bool>) -> Image<u8> {
    let (width, height) = (clipped.width(), clipped.height());
    let mut distance = clipped.map(|&c| if c { u8::MAX } else { 0 });
    for y in 0..height {
        for x in 0..width {
            let left = if x > 0 { distance[(x - 1, y)] } else { u8::MAX };
            let above = if y > 0 { distance[(x, y - 1)] } else { u8::MAX };
            distance[(x, y)] = distance[(x, y)].min(left.min(above).saturating_add(1));
        }
    }
    for y in (0..height).rev() {
        for x in (0..width).rev() {
            let right = if x + 1 < width { distance[(x + 1, y)] } else { u8::MAX };
            let below = if y + 1 < height { distance[(x, y + 1)] } else { u8::MAX };
            distance[(x, y)] = distance[(x, y)].min(right.min(below).saturating_add(1));
        }
    }
    distance
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::path::PathBuf;

    use lo_geometry::{Camera, Mat3, uv_from_direction};
    use lo_imaging::Photo;
    use lo_testdata::shared_data;

    use super::*;

    fn frame(photo: RadianceImage) -> Frame {
        let (width, height) = (photo.width(), photo.height());
        let camera = Camera::from_hfov_deg(65.0, width as u32, height as u32).unwrap();
        let depth_m = Image::new(width, height, vec![2.0; width * height]);
        Frame { camera, photo: Photo::Linear(photo), depth_m, exposure: 1.0 }
    }

    #[test]
    fn windows_shine_glints_little_and_coloured_things_not_at_all() {
        let photo = RadianceImage::from_fn(100, 100, |x, y| match (x, y) {
            (10..40, 10..40) => [1.0, 1.0, 1.0],
            (60..62, 60..62) => [1.0, 1.0, 1.0],
            (60..90, 10..40) => [1.0, 0.2, 0.1],
            _ => [0.2, 0.2, 0.3],
        });
        let (bright, report) = recover(&frame(photo.clone()), |_, _| false);
        let mean = |x0: usize, y0: usize, side: usize| {
            let pixels = (0..side * side).map(|i| luminance(bright[(x0 + i % side, y0 + i / side)]));
            pixels.sum::<f32>() / (side * side) as f32
        };
        assert!((mean(10, 10, 30) - 5.9).abs() < 0.1, "{}", mean(10, 10, 30));
        assert!((mean(60, 60, 2) - 2.8).abs() < 0.1, "{}", mean(60, 60, 2));
        assert_eq!(bright[(70, 20)], photo[(70, 20)]);
        assert_eq!(bright[(50, 50)], photo[(50, 50)]);
        assert!(luminance(bright[(25, 25)]) > luminance(bright[(10, 25)]));
        assert_eq!(report.brightened_regions, 2);
        // A sheet of paper on a table with the same pixels as the window.
        let (paper, _) = recover(&frame(photo.clone()), |_, y| y < 50);
        assert_eq!(paper[(25, 25)], [1.0; 3]);
    }

    #[test]
    fn fully_and_never_clipped_photos_are_handled() {
        let (white, _) = recover(&frame(Image::new(300, 2, vec![[1.0; 3]; 600])), |_, _| false);
        assert!(white.pixels().iter().flatten().all(|c| c.is_finite() && *c >= 1.0));
        let dark = Image::new(1, 1, vec![[0.0; 3]]);
        assert_eq!(recover(&frame(dark.clone()), |_, _| false).0, dark);
    }

    /// Crops of real HDR panoramas, clipped: the restored sum must be nearer to the true one than the clipped sum.
    #[test]
    fn recovered_sums_are_nearer_to_the_truth_than_clipped_ones() {
        let Some(folder) = shared_data("hdr", "highlights of five real panoramas") else { return };
        let names =
            ["lebombo_1k", "brown_photostudio_02_1k", "st_fagans_interior_1k", "autoshop_01_1k", "thatch_chapel_1k"];
        let (crops, error, clipped_error) = errors_of_sums(&names.map(|name| folder.join(format!("{name}.hdr"))));
        assert!(crops > 20 && error < 0.7 * clipped_error);
    }

    /// Returns the number of crops with highlights, and the RMS log errors of their restored and clipped sums.
    fn errors_of_sums(files: &[PathBuf]) -> (u32, f64, f64) {
        let (mut error, mut clipped_error, mut crops) = (0.0f64, 0.0f64, 0);
        for file in files {
            let panorama = lo_imaging::read_radiance(file).unwrap();
            let (width, height) = (panorama.width(), panorama.height());
            for step in 0..10 {
                let turn = Mat3::from_rotation_y(0.628 * step as f32) * Mat3::from_rotation_x(-0.15);
                let camera = Camera::from_hfov_deg(65.0, 180, 120).unwrap();
                let mut crop = RadianceImage::from_fn(180, 120, |x, y| {
                    let uv = uv_from_direction(turn * camera.direction(x as f64 + 0.5, y as f64 + 0.5));
                    let at = |share: f64, count: usize| ((share * count as f64) as usize).min(count - 1);
                    panorama[(at(uv.x.into(), width), at(uv.y.into(), height))]
                });
                let mut sorted: Vec<f32> = crop.pixels().iter().map(|&p| luminance(p)).collect();
                sorted.sort_by(f32::total_cmp);
                let scale = 0.2 / sorted[sorted.len() / 2].max(1e-4);
                crop = crop.map(|p| p.map(|c| c * scale));
                let low_range = frame(crop.map(|p| p.map(|c| c.min(1.0))));
                let (recovered, _) = recover(&low_range, |_, _| false);
                let clipped = low_range.clipped();
                let sum = |image: &RadianceImage| -> f64 {
                    let pairs = image.pixels().iter().zip(clipped.pixels());
                    pairs.filter(|(_, c)| **c).map(|(p, _)| f64::from(luminance(*p))).sum()
                };
                if clipped.pixels().iter().filter(|&&c| c).count() * 500 < 180 * 120 {
                    continue;
                }
                error += (sum(&recovered) / sum(&crop)).ln().powi(2);
                clipped_error += (sum(&low_range.radiance()) / sum(&crop)).ln().powi(2);
                crops += 1;
            }
        }
        let rms = |e: f64| (e / f64::from(crops)).sqrt();
        println!("{crops} crops: RMS log error {:.2}, clipped {:.2}", rms(error), rms(clipped_error));
        (crops, rms(error), rms(clipped_error))
    }
}
