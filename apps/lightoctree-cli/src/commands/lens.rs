//! Options of the camera's lens.

use std::path::{Path, PathBuf};

use lo_geometry::{Camera, Distortion};
use lo_imaging::PhotoFile;
use lo_scene::poses::PhotoLens;

use super::parse;
use crate::usage::Usage;

/// Options of the lens.
#[derive(Clone, Debug, clap::Args)]
pub struct LensArgs {
    /// Focal lengths and principal point in pixels of the photo, or a file that states them [default: from EXIF, else
    /// estimated from the photo]
    ///
    /// Files are Record3D's metadata.json, transforms.json of NeRF programs, COLMAP's cameras.txt, and the pose files
    /// of --poses. Their sizes are scaled to the photo's, and their distortion is undone.
    #[arg(long, value_name = "FX,FY,CX,CY|FILE", value_parser = intrinsics, allow_hyphen_values = true, conflicts_with = "hfov_deg")]
    intrinsics: Option<Intrinsics>,

    /// Horizontal field of view in degrees, instead of --intrinsics
    #[arg(long, value_name = "A")]
    hfov_deg: Option<f64>,

    /// Lens distortion in OpenCV's order, which is undone: k1,k2,p1,p2[,k3[,k4,k5,k6]], or fisheye:k1,k2,k3,k4
    ///
    /// It needs a lens from --intrinsics, --hfov-deg or EXIF. The depth map has the same distortion. Composites of
    /// `insert` are distorted back.
    #[arg(long, value_name = "K1,K2,P1,P2[,K3]", value_parser = distortion, allow_hyphen_values = true)]
    distortion: Option<Distortion>,
}

/// Numbers of a lens, or a file that has them.
#[derive(Clone, Debug)]
enum Intrinsics {
    Numbers([f64; 4]),
    File(PathBuf),
}

/// A lens as given by options.
pub struct GivenLens {
    /// The camera, and what gave it.
    pub camera: Option<(Camera, String)>,
    /// Distortion of the lens.
    pub distortion: Option<Distortion>,
}

impl LensArgs {
    /// Returns the given options, for comparison with those of another run.
    pub fn settings(&self) -> serde_json::Value {
        let intrinsics = self.intrinsics.as_ref().map(|intrinsics| match intrinsics {
            Intrinsics::Numbers(numbers) => serde_json::json!(numbers),
            Intrinsics::File(file) => serde_json::json!(file),
        });
        serde_json::json!({ "intrinsics": intrinsics, "hfov_deg": self.hfov_deg, "distortion": self.distortion })
    }

    /// Returns the lens that the options give for a photo.
    pub fn of(&self, path: &Path, photo: &PhotoFile) -> anyhow::Result<GivenLens> {
        let given = self.without_exif(path, photo)?;
        if self.distortion.is_some() && given.camera.is_none() && photo.focal_px().is_none() {
            return Err(Usage("--distortion needs the lens: set --intrinsics or --hfov-deg".into()).into());
        }
        Ok(given)
    }

    /// Returns the lens that the options give for a photo, even if distortion is given without lens.
    pub fn without_exif(&self, path: &Path, photo: &PhotoFile) -> anyhow::Result<GivenLens> {
        let (width, height) = (photo.photo.width() as u32, photo.photo.height() as u32);
        let mut distortion = self.distortion;
        let camera = match (&self.intrinsics, self.hfov_deg) {
            (Some(Intrinsics::Numbers([fx, fy, cx, cy])), _) => {
                let camera = Camera::new(*fx, *fy, *cx, *cy, width, height);
                let camera = camera.map_err(|error| Usage(format!("--intrinsics: {error}")))?;
                Some((camera, "--intrinsics".to_owned()))
            }
            (Some(Intrinsics::File(file)), _) => {
                let lens = PhotoLens::read(file, path)?;
                distortion = distortion.or(lens.distortion);
                Some((lens.camera(width, height)?, format!("--intrinsics {}", file.display())))
            }
            (None, Some(hfov_deg)) => {
                let camera = Camera::from_hfov_deg(hfov_deg, width, height);
                let camera = camera.map_err(|error| Usage(format!("--hfov-deg: {error}")))?;
                Some((camera, "--hfov-deg".to_owned()))
            }
            (None, None) => None,
        };
        Ok(GivenLens { camera, distortion: distortion.filter(|distortion| !distortion.is_identity()) })
    }
}

/// Parses `FX,FY,CX,CY`, or takes the text for a file's name if it has none of these numbers.
fn intrinsics(text: &str) -> Result<Intrinsics, String> {
    let is_number = |part: &str| part.trim().parse::<f64>().is_ok();
    if !text.split(',').any(is_number) || Path::new(text).exists() {
        return Ok(Intrinsics::File(text.into()));
    }
    parse::intrinsics(text).map(Intrinsics::Numbers)
}

/// Parses `k1,k2,p1,p2[,k3[,k4,k5,k6]]` or `fisheye:k1,k2,k3,k4`.
fn distortion(text: &str) -> Result<Distortion, String> {
    let (is_fisheye, list) = match text.split_once(':') {
        Some(("fisheye", list)) => (true, list),
        Some((model, _)) => return Err(format!("unknown model `{model}`; the models are `fisheye:` and none")),
        None => (false, text),
    };
    let number = |part: &str| part.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    let numbers: Option<Vec<f64>> = list.split(',').map(number).collect();
    let numbers = numbers.ok_or_else(|| format!("`{list}` is not a list of finite numbers"))?;
    match (is_fisheye, &numbers[..]) {
        (true, &[k1, k2, k3, k4]) => Ok(Distortion::Fisheye([k1, k2, k3, k4])),
        (true, numbers) => Err(format!("fisheye: needs 4 numbers, got {}", numbers.len())),
        (false, numbers) if matches!(numbers.len(), 4 | 5 | 8) => Ok(Distortion::brown(numbers)),
        (false, numbers) => Err(format!("K1,K2,P1,P2[,K3[,K4,K5,K6]] needs 4, 5 or 8 numbers, got {}", numbers.len())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lenses_are_numbers_or_files() {
        assert!(matches!(intrinsics("525,525,319.5,239.5"), Ok(Intrinsics::Numbers([525.0, 525.0, 319.5, 239.5]))));
        assert!(matches!(intrinsics("metadata.json"), Ok(Intrinsics::File(_))));
        assert!(matches!(intrinsics("-1,x,2,3"), Err(error) if error.contains("`x`")));
        assert!(matches!(intrinsics("525,525"), Err(error) if error.contains("4 numbers, got 2")));
    }

    #[test]
    fn distortions_have_opencvs_order() {
        assert_eq!(distortion("-0.25, 0.05,0,0"), Ok(Distortion::brown(&[-0.25, 0.05])));
        let brown = Distortion::Brown { radial: [1.0, 2.0, 5.0, 0.0, 0.0, 0.0], tangential: [3.0, 4.0] };
        assert_eq!(distortion("1,2,3,4,5"), Ok(brown));
        assert_eq!(distortion("fisheye:1,2,3,4"), Ok(Distortion::Fisheye([1.0, 2.0, 3.0, 4.0])));
        for text in ["1", "1,2,3", "fisheye:1", "brown:1,2,3,4", "1,2,3,nan", "1,2,3,x", ""] {
            assert!(distortion(text).is_err(), "{text}");
        }
    }
}
