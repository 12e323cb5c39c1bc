use std::path::Path;

use lo_geometry::{pixel_direction, pixel_solid_angle_sr};
use lo_imaging::{RadianceImage, luminance};
use lo_random::Stream;
use lo_transport::{Outdoors, Sun};

use crate::chance::{between, count};
use crate::error::SynthError;
use crate::folder::files_in;
use crate::photometry::SUN_RADIUS_RAD;

const HEIGHT: usize = 256;
/// Ratio to the sky's median luminance above which a pixel belongs to the sun; clouds stay below it.
const SUN_RATIO: f32 = 60.0;

/// Draws one of the folder's panoramas, rotates it about the vertical and scales its sky to daytime luminance.
pub(super) fn load_random(random: &mut Stream, folder: &Path) -> Result<Outdoors, SynthError> {
    let failed = |source| SynthError::Folder { path: folder.to_owned(), source };
    let files = files_in(folder, &["hdr", "exr"]).map_err(failed)?;
    if files.is_empty() {
        return Err(SynthError::NoPanorama { path: folder.to_owned() });
    }
    let path = &files[count(random, 0, files.len() - 1)];
    let image = lo_imaging::read_radiance(path)?;
    let (width, height) = (image.width(), image.height());
    if width != 2 * height {
        return Err(SynthError::NotEquirectangular { path: path.clone(), width, height });
    }
    let small = lo_imaging::resize_equirectangular(&image, 2 * HEIGHT, HEIGHT);
    let shift = count(random, 0, 2 * HEIGHT - 1);
    let turned = RadianceImage::from_fn(2 * HEIGHT, HEIGHT, |x, y| {
        small[((x + shift) % (2 * HEIGHT), y)].map(|c| if c.is_finite() { c.max(0.0) } else { 0.0 })
    });
    // Panoramas hold relative radiance; a daytime sky has 1,500 to 6,000 cd/m².
    Ok(extract_sun(turned, between(random, 15.0, 60.0)))
}

/// Scales the upper half (without the sun) to the mean luminance `sky` and moves the sun into a disc of equal power.
fn extract_sun(mut image: RadianceImage, sky: f32) -> Outdoors {
    let (width, height) = (image.width(), image.height());
    let weight = |y: usize| pixel_solid_angle_sr(y, width, height);
    let mut order: Vec<f32> = image.pixels()[..width * height / 2].iter().map(|&p| luminance(p)).collect();
    order.sort_by(f32::total_cmp);
    let median = order[order.len() / 2].max(1e-9);
    let limit = SUN_RATIO * median;
    let (mut mean, mut solid_angle) = (0.0, 0.0);
    let (mut power, mut direction) = ([0.0f32; 3], lo_geometry::Vec3::ZERO);
    for y in 0..height / 2 {
        for x in 0..width {
            let (p, bright) = (image[(x, y)], luminance(image[(x, y)]));
            mean += bright.min(limit) * weight(y);
            solid_angle += weight(y);
            if bright > limit {
                let excess = (bright - limit) / bright;
                for c in 0..3 {
                    power[c] += p[c] * excess * weight(y);
                }
                direction += pixel_direction(x, y, width, height) * (bright - limit) * weight(y);
                image[(x, y)] = p.map(|c| c * (1.0 - excess));
            }
        }
    }
    let scale = sky / (mean / solid_angle).max(1e-9);
    for p in image.pixels_mut() {
        *p = p.map(|c| c * scale);
    }
    let disc_sr = std::f32::consts::PI * SUN_RADIUS_RAD * SUN_RADIUS_RAD;
    let sun = (direction.length() > 0.0).then(|| Sun {
        direction: direction.normalize(),
        angular_radius_rad: SUN_RADIUS_RAD,
        radiance: power.map(|c| c * scale / disc_sr),
    });
    Outdoors { radiance: image, sun }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_sun_is_taken_out_with_its_power() {
        let mut image = RadianceImage::from_fn(64, 32, |_, y| if y < 16 { [0.5; 3] } else { [0.1; 3] });
        image[(40, 8)] = [5000.0; 3];
        let outdoors = extract_sun(image.clone(), 20.0);
        let sun = outdoors.sun.unwrap();
        assert!((sun.direction - pixel_direction(40, 8, 64, 32)).length() < 1e-3);
        // Power is conserved: the disc and the clipped pixel sum to the original pixel.
        let weight = pixel_solid_angle_sr(8, 64, 32);
        let scale = outdoors.radiance[(0, 0)][0] / 0.5;
        let disc = std::f32::consts::PI * sun.angular_radius_rad.powi(2);
        let found = sun.radiance[0] * disc + outdoors.radiance[(40, 8)][0] * weight;
        assert!((found / (5000.0 * scale * weight) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn an_empty_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let error = load_random(&mut lo_random::stream(1, "", 0), folder.path()).unwrap_err();
        assert!(matches!(error, SynthError::NoPanorama { .. }));
    }
}
