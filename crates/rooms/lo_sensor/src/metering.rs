//! Automatic exposure and white balance.

use lo_imaging::{RadianceImage, luminance};

/// Maximum number of zones along a side. Cameras meter on a coarse grid too.
const MAX_ZONES: usize = 96;

/// Standard deviation of the centre weighting, in units of half the image's side.
const CENTRE: f32 = 0.6;

/// Minkowski exponent of the illuminant estimate (Finlayson & Trezzi, "Shades of Gray and Colour Constancy", CIC 2004:
/// p = 6 is best).
const MINKOWSKI: i32 = 6;

/// Maximum correction of red or blue against green. Below about 2500 K, cameras leave an image warm.
const MAX_GAIN: f32 = 2.2;

/// Targets of the automatic exposure and white balance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Metering {
    /// Target mean level of the centre-weighted image, relative to white. ISO 2720 and common practice use the 18 %
    /// grey card.
    pub grey_level: f32,
    /// Share of the image that may be clipped before the exposure is lowered, by at most one stop.
    pub highlight_share: f32,
    /// Share of the illuminant's colour that is removed: 0 none, 1 all.
    pub white_balance: f32,
}

/// Returns the per-channel gains from radiance to exposed light (white is 1) that automatic exposure and white balance
/// choose.
///
/// Exposure is centre-weighted average metering of *clipped* light, as the sensor records it: a window counts as white,
/// however bright it is. White balance assumes that the mean light (with exponent 6, which favours bright surfaces) is
/// grey, and ignores clipped zones. A black image gets gains of 1.
pub fn meter(radiance: &RadianceImage, metering: &Metering) -> [f32; 3] {
    let zones = zones(radiance);
    let Some(raw) = exposure(&zones, [1.0; 3], metering) else { return [1.0; 3] };
    let balance = white_balance(&zones, raw, metering.white_balance);
    let exposure = exposure(&zones, balance, metering).unwrap_or(raw);
    balance.map(|gain| gain * exposure)
}

/// Mean radiance of an image zone and its weight in the exposure.
struct Zone {
    radiance: [f32; 3],
    weight: f32,
}

fn zones(radiance: &RadianceImage) -> Vec<Zone> {
    let (width, height) = (radiance.width(), radiance.height());
    let (columns, rows) = (width.min(MAX_ZONES), height.min(MAX_ZONES));
    let mut zones = Vec::with_capacity(columns * rows);
    for row in 0..rows {
        for column in 0..columns {
            let (xs, ys) = (
                column * width / columns..(column + 1) * width / columns,
                row * height / rows..(row + 1) * height / rows,
            );
            let mut sum = [0.0f32; 3];
            for y in ys.clone() {
                for x in xs.clone() {
                    for (s, v) in sum.iter_mut().zip(radiance[(x, y)]) {
                        *s += if v.is_finite() { v.max(0.0) } else { 0.0 };
                    }
                }
            }
            let count = (xs.len() * ys.len()) as f32;
            let offset = |index: usize, count: usize| (2.0 * (index as f32 + 0.5) / count as f32 - 1.0) / CENTRE;
            let (dx, dy) = (offset(column, columns), offset(row, rows));
            zones.push(Zone { radiance: sum.map(|s| s / count), weight: (-0.5 * (dx * dx + dy * dy)).exp() });
        }
    }
    zones
}

/// Returns the factor that brings the weighted mean of clipped luminance to the grey level. `None` for a black image.
fn exposure(zones: &[Zone], balance: [f32; 3], metering: &Metering) -> Option<f32> {
    let light: Vec<f32> = zones
        .iter()
        .map(|zone| {
            let [r, g, b] = zone.radiance;
            luminance([r * balance[0], g * balance[1], b * balance[2]])
        })
        .collect();
    let brightest = light.iter().copied().fold(0.0, f32::max);
    if !(brightest > 0.0 && brightest.is_finite()) {
        return None;
    }
    let total: f32 = zones.iter().map(|zone| zone.weight).sum();
    let mean = |factor: f32| {
        zones.iter().zip(&light).map(|(zone, l)| zone.weight * (l * factor).min(1.0)).sum::<f32>() / total
    };
    // The mean increases with the factor; at 1 / brightest nothing is clipped. 2^±40 covers every image that is not
    // nearly all black.
    let (mut low, mut high) = (-40.0f32, 40.0f32);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if mean(middle.exp2() / brightest) < metering.grey_level {
            low = middle;
        } else {
            high = middle;
        }
    }
    let metered = low.exp2() / brightest;
    // Highlights: the luminance at the given rank may just be clipped.
    let mut sorted = light;
    sorted.sort_unstable_by(f32::total_cmp);
    let rank = ((1.0 - metering.highlight_share.clamp(0.0, 1.0)) * (sorted.len() - 1) as f32) as usize;
    let highlight = sorted[rank].max(f32::MIN_POSITIVE);
    Some(metered.min((1.0 / highlight).max(0.5 * metered)))
}

fn white_balance(zones: &[Zone], exposure: f32, strength: f32) -> [f32; 3] {
    let mut sums = [0.0f64; 3];
    for zone in zones {
        let exposed = zone.radiance.map(|v| v * exposure);
        if exposed.iter().all(|&v| v < 1.0) {
            for (sum, v) in sums.iter_mut().zip(exposed) {
                *sum += f64::from(v).powi(MINKOWSKI);
            }
        }
    }
    let [r, g, b] = sums.map(|sum| sum.powf(1.0 / f64::from(MINKOWSKI)) as f32);
    let gain = |channel: f32| {
        let gain = (g / channel).powf(strength);
        if gain.is_finite() { gain.clamp(1.0 / MAX_GAIN, MAX_GAIN) } else { 1.0 }
    };
    [gain(r), 1.0, gain(b)]
}

#[cfg(test)]
mod tests {
    use super::*;

    const METERING: Metering = Metering { grey_level: 0.18, highlight_share: 1.0, white_balance: 1.0 };

    #[test]
    fn a_grey_wall_becomes_the_grey_level_at_any_brightness() {
        for brightness in [1e-6f32, 0.3, 7e4] {
            let wall = RadianceImage::new(48, 32, vec![[brightness; 3]; 48 * 32]);
            for gain in meter(&wall, &METERING) {
                assert!((gain * brightness - 0.18).abs() < 1e-4, "{brightness}: {gain}");
            }
        }
    }

    #[test]
    fn a_bright_lamp_counts_as_white_no_matter_how_bright() {
        let room = |lamp: f32| RadianceImage::from_fn(48, 32, |x, y| if x < 4 && y < 4 { [lamp; 3] } else { [0.2; 3] });
        let (dim, bright) = (meter(&room(50.0), &METERING)[0], meter(&room(5e5), &METERING)[0]);
        assert!((dim / bright - 1.0).abs() < 1e-5 && dim > 0.7, "{dim} {bright}");
    }

    #[test]
    fn white_balance_takes_out_the_light_of_a_lamp_in_part() {
        let warm = RadianceImage::new(48, 32, vec![[0.6, 0.4, 0.25]; 48 * 32]);
        let full = meter(&warm, &METERING);
        assert!((full[0] * 0.6 - full[1] * 0.4).abs() < 1e-4 && (full[2] * 0.25 - full[1] * 0.4).abs() < 1e-4);
        let none = meter(&warm, &Metering { white_balance: 0.0, ..METERING });
        assert!((none[0] - none[1]).abs() < 1e-6);
        let half = meter(&warm, &Metering { white_balance: 0.5, ..METERING });
        // √(0.4/0.6): half of the way in stops.
        assert!((half[0] / half[1] - (0.4f32 / 0.6).sqrt()).abs() < 1e-4);
        // A candle's red is not removed completely.
        let candle = RadianceImage::new(48, 32, vec![[1.0, 0.2, 0.01]; 48 * 32]);
        assert!((meter(&candle, &METERING)[2] / meter(&candle, &METERING)[1] - 2.2).abs() < 1e-4);
    }

    #[test]
    fn highlights_lower_the_exposure_by_a_stop_at_most() {
        let half_bright = RadianceImage::from_fn(48, 32, |x, _| if x < 8 { [9.0; 3] } else { [0.05; 3] });
        let free = meter(&half_bright, &METERING)[0];
        let held = meter(&half_bright, &Metering { highlight_share: 0.02, ..METERING })[0];
        assert!((held / free - 0.5).abs() < 1e-4, "{held} {free}");
    }

    #[test]
    fn darkness_and_broken_pixels_do_no_harm() {
        assert_eq!(meter(&RadianceImage::new(4, 4, vec![[0.0; 3]; 16]), &METERING), [1.0; 3]);
        let broken =
            RadianceImage::from_fn(8, 8, |x, _| if x == 0 { [f32::NAN, f32::INFINITY, -1.0] } else { [0.5; 3] });
        assert!(meter(&broken, &METERING).iter().all(|g| g.is_finite() && *g > 0.0));
        assert_eq!(meter(&RadianceImage::new(0, 0, Vec::new()), &METERING), [1.0; 3]);
    }
}
