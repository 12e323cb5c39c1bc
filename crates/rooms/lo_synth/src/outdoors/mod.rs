//! The outdoors behind the windows: a panorama of absolute radiance and a sun.

mod houses_and_trees;
mod panorama;
mod sky;
mod surroundings;

use lo_geometry::{Vec3, pixel_direction};
use lo_imaging::RadianceImage;
use lo_random::Stream;
use lo_transport::{Outdoors, Sun};

use crate::chance::{between, chance, pick};
use crate::config::SynthConfig;
use crate::description::Weather;
use crate::error::SynthError;
use crate::photometry::{SUN_RADIUS_RAD, UNIT_CD_M2, luminance_color};
use crate::plan::Plan;
use crate::texture::Noise;
use lo_random::RngExt;
use sky::{Clouds, Sky, sun_radiance};
use surroundings::{SunLight, Surroundings};

const HEIGHT: usize = 256;

/// Generates the outdoors of a room. With `sun_stream`, the sun is in front of a window.
pub(crate) fn generate(
    random: &mut Stream,
    weather: Weather,
    plan: &Plan,
    config: &SynthConfig,
    sun_stream: Option<&mut Stream>,
) -> Result<Outdoors, SynthError> {
    if let (Weather::Panorama, Some(folder)) = (weather, &config.panorama_folder) {
        return panorama::load_random(random, folder);
    }
    let night = weather == Weather::Night;
    let surroundings = Surroundings::draw(random, night);
    let noise = Noise::new(random.random());
    let (sky, sun) = match weather {
        Weather::Overcast => {
            let lux = pick(random, &[4_000.0, 8_000.0, 12_000.0, 20_000.0]) * between(random, 0.7, 1.3);
            (Sky::overcast(lux, noise), None)
        }
        Weather::Night => {
            let glow = luminance_color(between(random, 2200.0, 9000.0));
            let luminance = between(random, 0.01, 0.15) / UNIT_CD_M2;
            (Sky::Night { glow: glow.map(|c| c * luminance) }, None)
        }
        _ => {
            let low = weather == Weather::Sunset;
            let elevation = if low { between(random, 2.0, 10.0) } else { between(random, 15.0, 62.0) }.to_radians();
            let usual = draw_azimuth(random, plan);
            let azimuth = sun_stream.and_then(|own| azimuth_facing_window(own, plan)).unwrap_or(usual);
            let direction = Vec3::new(azimuth.x * elevation.cos(), elevation.sin(), azimuth.z * elevation.cos());
            let turbidity = between(random, 2.2, if low { 4.0 } else { 6.0 });
            let radiance = sun_radiance(elevation, turbidity);
            let solid_angle = std::f32::consts::PI * SUN_RADIUS_RAD * SUN_RADIUS_RAD;
            // A white cloud scatters back most of the incident light.
            let cloud = radiance.map(|c| c * solid_angle / std::f32::consts::PI * 0.6 + 12.0);
            let cover = if chance(random, 0.55) { between(random, 0.1, 0.8) } else { 0.0 };
            let sky = Sky::clear(direction, turbidity, Clouds { noise, cover, radiance: cloud });
            (sky, Some(Sun { direction, angular_radius_rad: SUN_RADIUS_RAD, radiance }))
        }
    };
    Ok(Outdoors { radiance: render(&sky, &surroundings, sun), sun })
}

/// Draws the sun's azimuth: in front of a window in at least half of the rooms, as in real homes.
fn draw_azimuth(random: &mut Stream, plan: &Plan) -> Vec3 {
    let outward = window_normals(plan);
    let angle = between(random, 0.0, std::f32::consts::TAU);
    if outward.is_empty() || chance(random, 0.5) {
        return Vec3::new(angle.cos(), 0.0, angle.sin());
    }
    let wall = pick(random, &outward);
    lo_geometry::Quat::from_rotation_y(between(random, -1.1, 1.1)) * wall
}

/// Draws an azimuth within ±0.85 rad of a window's outward normal; `None` without windows.
fn azimuth_facing_window(random: &mut Stream, plan: &Plan) -> Option<Vec3> {
    let outward = window_normals(plan);
    (!outward.is_empty()).then(|| {
        let wall = pick(random, &outward);
        lo_geometry::Quat::from_rotation_y(between(random, -0.85, 0.85)) * wall
    })
}

/// Outward normals of the walls that have windows.
fn window_normals(plan: &Plan) -> Vec<Vec3> {
    let with_windows = plan.walls.iter().filter(|wall| wall.openings.iter().any(|o| o.is_window()));
    with_windows.map(|wall| Vec3::new(-wall.inward().x, 0.0, -wall.inward().y)).collect()
}

fn render(sky: &Sky, surroundings: &Surroundings, sun: Option<Sun>) -> RadianceImage {
    let ambient = sky.mean_radiance();
    let light = sun.map(|sun| {
        let solid_angle = std::f32::consts::PI * sun.angular_radius_rad * sun.angular_radius_rad;
        let radiosity = sun.radiance.map(|c| c * solid_angle / std::f32::consts::PI);
        SunLight { direction: sun.direction, radiosity }
    });
    let (width, height) = (2 * HEIGHT, HEIGHT);
    RadianceImage::from_fn(width, height, |x, y| {
        // Four samples per pixel near the horizon, where the detail is, one elsewhere.
        let fine = if y > height / 4 && y < height * 7 / 8 { 2 } else { 1 };
        let mut sum = [0.0; 3];
        for (i, j) in (0..fine).flat_map(|i| (0..fine).map(move |j| (i, j))) {
            let direction = pixel_direction(x * fine + i, y * fine + j, width * fine, height * fine);
            let radiance = surroundings.radiance(direction, sky, ambient, light);
            for c in 0..3 {
                sum[c] += radiance[c] / (fine * fine) as f32;
            }
        }
        sum
    })
}
