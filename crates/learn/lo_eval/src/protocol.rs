//! The two published protocols used by DiffusionLight (Phongthawee et al. 2024).
//!
//! They follow the code and scene files of DiffusionLight-evaluation (commit 7939661). `docs/evaluation.md` lists the
//! details and differences.

use std::borrow::Cow;
use std::path::Path;

use lo_dataset::{CropModel, Dataset, DatasetError, Metadata, NovelView, Panoramas, Sample};
use lo_geometry::{Camera, Quat, Vec2, Vec3, direction_from_uv};
use lo_imaging::{
    Image, RadianceImage, perspective_from_equirectangular, resize_equirectangular, sample_equirectangular,
    view_rotation,
};
use lo_metrics::{angular_error_deg, rmse, si_rmse};
use lo_sensor::{Interval, PhotoModel};

use crate::spheres::{Material, SphereView, Transport, single_sphere, sphere_array};

/// A published protocol: crops of HDR panoramas, and metrics of estimated panoramas.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// StyleLight (Wang et al. 2022): one crop per panorama with a vertical field of view of 60°, three spheres under
    /// tone-mapped panoramas.
    ThreeSpheres,
    /// Editable indoor lighting estimation (Weber et al. 2022): ten crops of 50° per panorama, nine diffuse spheres on
    /// a plane.
    SphereArray,
}

/// Size of the panoramas that are compared.
const MAP: [usize; 2] = [256, 128];

/// Photos cropped from a folder of panoramas by a protocol.
#[derive(Debug)]
pub struct ProtocolCrops {
    panoramas: Panoramas,
    protocol: Protocol,
}

impl Protocol {
    /// Returns the number of crops per panorama.
    fn crops(self) -> usize {
        match self {
            Self::ThreeSpheres => 1,
            Self::SphereArray => 10,
        }
    }

    fn camera(self) -> Camera {
        let camera = match self {
            Self::ThreeSpheres => {
                let focal = 96.0 / 30f64.to_radians().tan();
                Camera::new(focal, focal, 128.0, 96.0, 256, 192)
            }
            Self::SphereArray => Camera::from_hfov_deg(50.0, 256, 192),
        };
        camera.expect("field of view and size are valid constants")
    }

    /// Returns the published gain and gamma: photos are `gain · value^(1 / gamma)`.
    fn exposure(self, panorama: &RadianceImage) -> (f32, f32) {
        let values = panorama.pixels().iter().flatten().copied();
        match self {
            Self::ThreeSpheres => {
                let gamma = 2.4;
                let powers: Vec<f32> = values.filter(|v| *v > 0.0).map(|v| v.powf(1.0 / gamma)).collect();
                (0.9 / (percentile(powers, 99.0) + 1e-10), gamma)
            }
            Self::SphereArray => {
                let gamma = 2.2;
                let gain = 0.8 / (percentile(values.collect(), 90.0) + 1e-10);
                (gain.powf(1.0 / gamma), gamma)
            }
        }
    }
}

impl ProtocolCrops {
    /// Opens a folder of panoramas.
    ///
    /// # Errors
    /// See [`Panoramas::open`].
    pub fn open(folder: &Path, protocol: Protocol) -> Result<Self, DatasetError> {
        // The unchanged panorama is required: full size, no white balance error.
        let neutral = Interval::new(0.0, 0.0);
        let photo = PhotoModel { white_balance: neutral, white_balance_error: neutral, ..PhotoModel::default() };
        let model = CropModel { width: 16, height: 16, panorama_height: 1024, photo, ..CropModel::default() };
        Ok(Self { panoramas: Panoramas::open(folder, model)?, protocol })
    }
}

impl Dataset for ProtocolCrops {
    fn len(&self) -> usize {
        self.panoramas.len() * self.protocol.crops()
    }

    fn scene_id(&self, index: usize) -> Cow<'_, str> {
        self.panoramas.scene_id(index / self.protocol.crops())
    }

    fn get(&self, index: usize) -> Result<Sample, DatasetError> {
        let crops = self.protocol.crops();
        let mut sample = self.panoramas.get(index / crops)?;
        let Some(view) = sample.views.pop() else {
            return Err(DatasetError::Index { index, len: self.len() });
        };
        let panorama = view.radiance;
        let (gain, gamma) = self.protocol.exposure(&panorama);
        let azimuth = std::f32::consts::TAU * (index % crops) as f32 / crops as f32;
        let rotation = view_rotation(azimuth, 0.0, 0.0);
        let camera = self.protocol.camera();
        let seen = perspective_from_equirectangular(&panorama, &camera, rotation);
        // The photo's white in units of the panorama.
        let white = gain.powf(-gamma);
        let scaled = |rgb: &[f32; 3]| rgb.map(|v| v / white);
        let turned = turned(&panorama, |direction| rotation * direction);
        Ok(Sample {
            id: if crops > 1 { format!("{}-{}", sample.scene_id, index % crops) } else { sample.scene_id.clone() },
            photo: seen.map(|rgb| rgb.map(|v| (255.0 * (gain * v.max(0.0).powf(1.0 / gamma)).min(1.0)) as u8)),
            camera,
            up: Some(Vec3::Y),
            radiance: Some(seen.map(scaled)),
            views: vec![NovelView {
                position_m: Vec3::ZERO,
                rotation: Quat::IDENTITY,
                radiance: turned.map(scaled),
                depth_m: None,
            }],
            metadata: Metadata::new(),
            ..sample
        })
    }

    fn block(&self) -> usize {
        self.protocol.crops()
    }
}

/// Rotates and resizes a panorama; `turn` maps directions of the camera to the panorama's.
fn turned(panorama: &RadianceImage, turn: impl Fn(Vec3) -> Vec3) -> RadianceImage {
    let (width, height) = (panorama.width(), panorama.height());
    let turned = Image::from_fn(width, height, |x, y| {
        let uv = Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
        sample_equirectangular(panorama, turn(direction_from_uv(uv)))
    });
    resize_equirectangular(&turned, MAP[0], MAP[1])
}

/// Renders a protocol's spheres under panoramas in the camera's frame, and compares them.
#[derive(Debug)]
pub struct ProtocolRenders {
    protocol: Protocol,
    /// The spheres (diffuse, silver, mirror), or the array of spheres.
    renders: Vec<(&'static str, Transport)>,
}

/// StyleLight's camera: 16 radii away and 2 up, 85 mm on a sensor of 36 mm, 960 pixels wide. Blender's −Y is our +X.
const STYLELIGHT_VIEW: SphereView = SphereView { eye: Vec3::new(16.0, 2.0, 0.0), focal_px: 960.0 * 85.0 / 36.0 };
/// Number of pixels of its image.
const STYLELIGHT_PIXELS: f64 = 960.0 * 540.0;

impl ProtocolRenders {
    /// Precomputes the transport of the protocol's spheres.
    pub fn new(protocol: Protocol) -> Self {
        let renders = match protocol {
            Protocol::SphereArray => vec![("array", sphere_array())],
            Protocol::ThreeSpheres => [
                ("diffuse", Material::Plastic { albedo: 0.8, roughness: 0.364 }),
                ("silver", Material::Metal { reflectance: 0.8, roughness: 0.3271 }),
                ("mirror", Material::Mirror { reflectance: 0.8 }),
            ]
            .map(|(name, material)| (name, single_sphere(material, STYLELIGHT_VIEW)))
            .into(),
        };
        Self { protocol, renders }
    }

    /// Compares two panoramas; returns names and values of the figures.
    pub fn figures(&self, truth: &RadianceImage, got: &RadianceImage) -> Vec<(String, f64)> {
        let toned = |map: &RadianceImage| match self.protocol {
            Protocol::ThreeSpheres => stylelight_tone(map),
            Protocol::SphereArray => map.clone(),
        };
        let (truth, got) = (toned(truth), toned(got));
        let mut figures = Vec::new();
        for (name, transport) in &self.renders {
            let (a, b) = (transport.render(&truth), transport.render(&got));
            let found = match self.protocol {
                Protocol::ThreeSpheres => three_spheres_figures(&a, &b),
                Protocol::SphereArray => array_figures(&a, &b),
            };
            figures.extend(found.into_iter().filter_map(|(figure, value)| Some((format!("{name}_{figure}"), value?))));
        }
        figures
    }
}

/// Applies `α I^(1/2.4)`, where α maps the median of the non-black values to 0.5. Not clipped.
fn stylelight_tone(map: &RadianceImage) -> RadianceImage {
    let powers = map.map(|rgb| rgb.map(|v| v.max(0.0).powf(1.0 / 2.4)));
    let lit: Vec<f32> = powers.pixels().iter().flatten().copied().filter(|v| *v > 0.0).collect();
    let gain = 0.5 / (percentile(lit, 50.0) + 1e-10);
    powers.map(|rgb| rgb.map(|v| gain * v))
}

type Figures = [(&'static str, Option<f64>); 4];

/// Returns StyleLight's figures. Its squared errors are summed over channels, not averaged: √3 times ours.
fn three_spheres_figures(truth: &RadianceImage, got: &RadianceImage) -> Figures {
    let ones = vec![1.0; truth.pixels().len()];
    let summed = |value: Option<f64>| value.map(|v| 3f64.sqrt() * v);
    let normalised = |map: &RadianceImage| {
        // Percentiles are taken over the whole image, which is black around the sphere.
        let values: Vec<f32> = map.pixels().iter().flatten().copied().collect();
        let step = (STYLELIGHT_SPHERE_PIXELS / map.pixels().len() as f64).max(1.0);
        let black = ((STYLELIGHT_PIXELS - STYLELIGHT_SPHERE_PIXELS) / step * 3.0) as usize;
        let padded: Vec<f32> = values.into_iter().chain(std::iter::repeat_n(0.0, black)).collect();
        let [low, high] = [0.01, 99.9].map(|p| percentile(padded.clone(), p));
        map.map(|rgb| rgb.map(|v| (v - low) / (high - low)))
    };
    [
        ("rmse", summed(rmse(truth, got, &ones))),
        ("si_rmse", summed(si_rmse(truth, got, &ones))),
        ("angular_deg", angular_error_deg(truth, got, &ones)),
        ("normalised_rmse", summed(rmse(&normalised(truth), &normalised(got), &ones))),
    ]
}

/// Number of pixels of the sphere, of radius 140.84 pixels.
const STYLELIGHT_SPHERE_PIXELS: f64 = 62_320.0;

/// Returns Weber et al.'s figures. Both images are scaled so that the truth's 90th percentile is 0.8.
fn array_figures(truth: &RadianceImage, got: &RadianceImage) -> Figures {
    let ones = vec![1.0; truth.pixels().len()];
    let gain = 0.8 / (percentile(truth.pixels().iter().flatten().copied().collect(), 90.0) + 1e-10);
    let exposed = |map: &RadianceImage| map.map(|rgb| rgb.map(|v| gain * v));
    let (truth, got) = (exposed(truth), exposed(got));
    let error = rmse(&truth, &got, &ones);
    let most = truth.pixels().iter().chain(got.pixels()).flatten().copied().fold(0.0f32, f32::max);
    [
        ("rmse", error),
        ("si_rmse", si_rmse(&truth, &got, &ones)),
        ("angular_deg", angular_error_deg(&truth, &got, &ones)),
        // The peak is the brightest pixel of both images, as published.
        ("psnr_db", error.map(|error| (20.0 * (f64::from(most) / error).log10()).min(100.0))),
    ]
}

/// Returns NumPy's percentile with linear interpolation; 0 without values.
fn percentile(mut values: Vec<f32>, percent: f64) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let position = percent / 100.0 * (values.len() - 1) as f64;
    let first = position as usize;
    let (_, &mut low, above) = values.select_nth_unstable_by(first, f32::total_cmp);
    let next = above.iter().copied().min_by(f32::total_cmp).unwrap_or(low);
    low + (position - first as f64) as f32 * (next - low)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn percentiles_are_numpys() {
        // numpy.percentile([4, 1, 3, 2], [0, 50, 90, 100])
        for (percent, expected) in [(0.0, 1.0), (50.0, 2.5), (90.0, 3.7), (100.0, 4.0)] {
            assert!((percentile(vec![4.0, 1.0, 3.0, 2.0], percent) - expected).abs() < 1e-6);
        }
    }

    fn map(seed: u64, scale: f32) -> RadianceImage {
        use lo_random::RngExt;
        let mut stream = lo_random::stream(seed, "map", 0);
        RadianceImage::from_fn(256, 128, |_, _| [0, 1, 2].map(|_| scale * stream.random::<f32>().powi(4)))
    }

    #[test]
    fn equal_light_has_no_error_and_scale_does_not_matter() {
        for protocol in [Protocol::ThreeSpheres, Protocol::SphereArray] {
            let renders = ProtocolRenders::new(protocol);
            let truth = map(1, 1.0);
            for (name, value) in renders.figures(&truth, &map(1, 7.0)) {
                let scales_count = name == "array_rmse" || name == "array_psnr_db";
                assert!(scales_count || value < 1e-3, "{protocol:?} {name}: {value}");
            }
            let other = renders.figures(&truth, &map(2, 1.0));
            assert!(other.iter().all(|(_, value)| value.is_finite() && *value > 1e-3), "{other:?}");
        }
    }

    #[test]
    fn the_median_becomes_a_half() {
        let toned = stylelight_tone(&map(3, 40.0));
        let values: Vec<f32> = toned.pixels().iter().flatten().copied().collect();
        assert!((percentile(values, 50.0) - 0.5).abs() < 1e-5);
    }

    #[test]
    fn the_sphere_covers_what_the_published_picture_shows() {
        // π r² with r = f / √(d² − 1), d² = 260
        let radius = 960.0 * 85.0 / 36.0 / 259f64.sqrt();
        assert!((std::f64::consts::PI * radius * radius / STYLELIGHT_SPHERE_PIXELS - 1.0).abs() < 1e-3);
        let mirror = single_sphere(Material::Mirror { reflectance: 0.8 }, STYLELIGHT_VIEW);
        let shown = mirror.render(&map(1, 1.0)).pixels().len() as f64;
        assert!((shown / STYLELIGHT_SPHERE_PIXELS - 1.0).abs() < 0.02, "{shown}");
    }
}
