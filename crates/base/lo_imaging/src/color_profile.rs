//! Colour profiles: ICC, and the primaries and curves that PNG and EXIF state.

use std::fmt;
use std::sync::{Arc, LazyLock};

use crate::color::{linear_from_srgb, linear_from_srgb8, srgb_from_linear, srgb8_from_linear};
use moxcms::{
    Chromaticity, CicpProfile, ColorPrimaries, ColorProfile as IccProfile, DataColorSpace, Layout, LocalizableString,
    Matrix3d, ProfileText, RenderingIntent, ToneCurveEvaluator, ToneReprCurve, TransformOptions, XyY, curve_from_gamma,
};

/// Largest ICC profile that is used, in bytes; profiles of printers have about 3 MB.
pub(crate) const MAX_PROFILE_BYTES: usize = 16 << 20;

type Curve = Arc<dyn ToneCurveEvaluator + Send + Sync>;

/// An RGB colour space given by tone curves and primaries: sRGB's conversion to and from it.
///
/// Colorimetric intent relative to the white points: white stays white (ICC.1:2022, annex F.3).
#[derive(Clone)]
pub struct ColorProfile {
    name: String,
    icc: Vec<u8>,
    /// Whether each colour is that of sRGB to within half a code; then sRGB's own curve is used.
    is_srgb: bool,
    curves: [Curve; 3],
    /// Linear value of each 8-bit code.
    linear: [[f32; 256]; 3],
    /// Linear values halfway between the codes, to encode.
    limits: [[f32; 255]; 3],
    rec709_from_rgb: [[f32; 3]; 3],
    rgb_from_rec709: [[f32; 3]; 3],
}

impl fmt::Debug for ColorProfile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ColorProfile").field("name", &self.name).finish_non_exhaustive()
    }
}

impl PartialEq for ColorProfile {
    fn eq(&self, other: &Self) -> bool {
        self.icc == other.icc
    }
}

/// An ICC profile by its kind.
pub(crate) enum IccKind {
    /// RGB or grey with curves and primaries.
    Matrix(Box<ColorProfile>),
    /// RGB or CMYK with tables.
    Table(Box<TableProfile>),
}

/// Conversion of 8-bit samples to sRGB by the tables of an ICC profile.
pub(crate) struct TableProfile {
    source: IccProfile,
}

impl ColorProfile {
    /// Reads an ICC profile with curves and primaries.
    ///
    /// Returns `None` for damaged profiles, for those with tables only (printers), and for other colour models than
    /// RGB and grey.
    pub fn from_icc(icc: &[u8]) -> Option<Self> {
        match read_icc(icc)? {
            IccKind::Matrix(profile) => Some(*profile),
            IccKind::Table(_) => None,
        }
    }

    /// Adobe RGB (1998), which EXIF denotes by the interoperability index R03.
    pub(crate) fn adobe_rgb() -> Option<Self> {
        Self::encoded(&IccProfile::new_adobe_rgb())
    }

    /// Colour space by code points of ITU-T H.273: primaries and transfer characteristics. `None` for reserved ones.
    pub(crate) fn from_code_points(primaries: u8, transfer: u8) -> Option<Self> {
        let cicp = CicpProfile {
            color_primaries: primaries.try_into().ok()?,
            transfer_characteristics: transfer.try_into().ok()?,
            matrix_coefficients: moxcms::MatrixCoefficients::Identity,
            full_range: true,
        };
        let mut profile = IccProfile::new_from_cicp(cicp);
        profile.red_trc.as_ref()?;
        if profile.description.is_none() {
            profile.description = Some(english(format!("ITU-T H.273 primaries {primaries}, transfer {transfer}")));
        }
        Self::encoded(&profile)
    }

    /// Colour space by gamma (linear = value^gamma; `None` for sRGB's curve) and CIE xy of red, green, blue and white.
    pub(crate) fn from_gamma(gamma: Option<f32>, primaries: Option<[[f32; 2]; 4]>) -> Option<Self> {
        let mut profile = IccProfile::new_srgb();
        profile.cicp = None;
        profile.description = Some(english("gamma and primaries of a PNG".to_owned()));
        if let Some(gamma) = gamma {
            let curve = || Some(curve_from_gamma(gamma));
            (profile.red_trc, profile.green_trc, profile.blue_trc) = (curve(), curve(), curve());
        }
        if let Some([red, green, blue, white]) = primaries {
            let xy = |[x, y]: [f32; 2]| Chromaticity { x, y };
            let primaries = ColorPrimaries { red: xy(red), green: xy(green), blue: xy(blue) };
            let [x, y] = white.map(f64::from);
            profile.update_rgb_colorimetry(XyY { x, y, yb: 1.0 }, primaries);
        }
        Self::encoded(&profile)
    }

    fn encoded(profile: &IccProfile) -> Option<Self> {
        // by way of the file, so that reading a scene gives the same values
        let icc = profile.encode().ok()?;
        Self::of(&IccProfile::new_from_slice(&icc).ok()?, icc)
    }

    fn of(profile: &IccProfile, icc: Vec<u8>) -> Option<Self> {
        static SRGB: LazyLock<IccProfile> = LazyLock::new(IccProfile::new_srgb);
        let curve = |trc: &Option<ToneReprCurve>| trc.as_ref()?.make_linear_evaluator().ok().map(Arc::from);
        let curves = [curve(&profile.red_trc)?, curve(&profile.green_trc)?, curve(&profile.blue_trc)?];
        let at = |curve: &Curve, code: f32| curve.evaluate_value(code / 255.0);
        let linear = [0, 1, 2].map(|c| std::array::from_fn(|code| at(&curves[c], code as f32)));
        let limits = [0, 1, 2].map(|c| std::array::from_fn(|code| at(&curves[c], code as f32 + 0.5)));
        let (rec709_from_rgb, rgb_from_rec709) = (profile.transform_matrix(&SRGB), SRGB.transform_matrix(profile));
        let (rec709_from_rgb, rgb_from_rec709) = (white_to_white(rec709_from_rgb)?, white_to_white(rgb_from_rec709)?);
        let increases = |curve: &[f32; 256]| curve.iter().all(|v| v.is_finite()) && curve.is_sorted();
        if !linear.iter().all(increases) || linear.iter().any(|curve| curve[255] <= 0.0) {
            return None;
        }
        let name = profile.description.as_ref().map(description).unwrap_or_default();
        let name = if name.is_empty() { "without a name".to_owned() } else { name };
        let is_srgb = false;
        let mut profile = Self { name, icc, is_srgb, curves, linear, limits, rec709_from_rgb, rgb_from_rec709 };
        profile.is_srgb = profile.agrees_with_srgb();
        Some(profile)
    }

    /// Whether its colours are those of sRGB.
    pub fn is_srgb(&self) -> bool {
        self.is_srgb
    }

    /// Name that the profile states, for messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The ICC profile.
    pub fn icc(&self) -> &[u8] {
        &self.icc
    }

    /// Converts an 8-bit pixel to linear Rec. 709. Colours outside its gamut have negative values.
    #[inline]
    pub fn linear(&self, pixel: [u8; 3]) -> [f32; 3] {
        if self.is_srgb {
            return pixel.map(linear_from_srgb8);
        }
        self.linear_by_curves(pixel)
    }

    fn linear_by_curves(&self, pixel: [u8; 3]) -> [f32; 3] {
        let [r, g, b] = [0, 1, 2].map(|c| self.linear[c][usize::from(pixel[c])]);
        self.rec709_from_rgb.map(|row| row[0] * r + row[1] * g + row[2] * b)
    }

    /// Returns the linear value of each 16-bit code of each channel, in its own primaries.
    pub(crate) fn tables16(&self) -> [Vec<f32>; 3] {
        [0, 1, 2].map(|c| {
            let linear = |code: u16| match self.is_srgb {
                true => linear_from_srgb(f32::from(code) / 65535.0),
                false => self.curves[c].evaluate_value(f32::from(code) / 65535.0),
            };
            (0..=u16::MAX).map(linear).collect()
        })
    }

    /// Converts linear values in its own primaries to Rec. 709.
    pub(crate) fn rec709_from_linear(&self, [r, g, b]: [f32; 3]) -> [f32; 3] {
        if self.is_srgb {
            return [r, g, b];
        }
        self.rec709_from_rgb.map(|row| row[0] * r + row[1] * g + row[2] * b)
    }

    /// Returns the nearest 8-bit pixel to linear Rec. 709: the inverse of [`ColorProfile::linear`].
    #[inline]
    pub fn code(&self, linear: [f32; 3]) -> [u8; 3] {
        if self.is_srgb {
            return linear.map(srgb8_from_linear);
        }
        let [r, g, b] = linear;
        let own = self.rgb_from_rec709.map(|row| row[0] * r + row[1] * g + row[2] * b);
        [0, 1, 2].map(|c| self.limits[c].partition_point(|&limit| limit <= own[c]) as u8)
    }

    /// Returns whether greys and the most saturated colours are the same in sRGB, to within half a code.
    fn agrees_with_srgb(&self) -> bool {
        let near = |code: [u8; 3]| {
            let srgb = self.linear_by_curves(code).map(|v| srgb_from_linear(v) * 255.0);
            srgb.iter().zip(code).all(|(v, code)| (v - f32::from(code)).abs() < 0.5)
        };
        (0..=255).all(|v| [[v; 3], [v, 0, 0], [0, v, 0], [0, 0, v], [255, v, 0], [0, 255, v]].into_iter().all(near))
    }
}

/// Reads an ICC profile. `None` if it is damaged or has no conversion for this program.
pub(crate) fn read_icc(icc: &[u8]) -> Option<IccKind> {
    if icc.len() > MAX_PROFILE_BYTES {
        return None;
    }
    let mut profile = IccProfile::new_from_slice(icc).ok()?;
    match profile.color_space {
        DataColorSpace::Rgb if profile.red_trc.is_some() && profile.pcs == DataColorSpace::Xyz => {
            ColorProfile::of(&profile, icc.to_vec()).map(|profile| IccKind::Matrix(Box::new(profile)))
        }
        DataColorSpace::Gray => {
            // grey photos become RGB photos, whose composites need an RGB profile
            let curve = profile.gray_trc.take()?;
            let mut rgb = IccProfile::new_srgb();
            rgb.cicp = None;
            rgb.description = profile.description;
            (rgb.red_trc, rgb.green_trc, rgb.blue_trc) = (Some(curve.clone()), Some(curve.clone()), Some(curve));
            ColorProfile::encoded(&rgb).map(|profile| IccKind::Matrix(Box::new(profile)))
        }
        DataColorSpace::Rgb | DataColorSpace::Cmyk => {
            let table = TableProfile { source: profile };
            // a profile without a usable table fails here
            table.srgb8(&[[0; 4]; 1]).map(|_| IccKind::Table(Box::new(table)))
        }
        _ => None,
    }
}

impl TableProfile {
    /// Whether the profile converts CMYK (0 = no ink) instead of RGB.
    pub fn is_cmyk(&self) -> bool {
        self.source.color_space == DataColorSpace::Cmyk
    }

    /// Converts samples to 8-bit sRGB: CMYK, or RGB and an unused value.
    pub fn srgb8(&self, pixels: &[[u8; 4]]) -> Option<Vec<[u8; 3]>> {
        let options = TransformOptions {
            rendering_intent: RenderingIntent::RelativeColorimetric,
            prefer_fixed_point: false,
            ..TransformOptions::default()
        };
        let srgb = IccProfile::new_srgb();
        let transform = self.source.create_transform_8bit(Layout::Rgba, &srgb, Layout::Rgb, options).ok()?;
        let mut converted = vec![[0u8; 3]; pixels.len()];
        transform.transform(pixels.as_flattened(), converted.as_flattened_mut()).ok()?;
        Some(converted)
    }
}

/// Scales the rows to sum 1, so that white stays white exactly. `None` for primaries that do not form a triangle.
fn white_to_white(matrix: Matrix3d) -> Option<[[f32; 3]; 3]> {
    let rows = matrix.v.map(|row| row.map(|v| (v / row.iter().sum::<f64>()) as f32));
    rows.iter().flatten().all(|v| v.is_finite() && v.abs() < 1e3).then_some(rows)
}

fn english(text: String) -> ProfileText {
    ProfileText::Localizable(vec![LocalizableString::new("en".to_owned(), "US".to_owned(), text)])
}

fn description(text: &moxcms::ProfileText) -> String {
    let text = match text {
        moxcms::ProfileText::PlainString(text) => text.clone(),
        moxcms::ProfileText::Localizable(texts) => texts.first().map(|t| t.value.clone()).unwrap_or_default(),
        moxcms::ProfileText::Description(text) => text.ascii_string.clone(),
    };
    text.chars().filter(|c| !c.is_control()).take(60).collect::<String>().trim().to_owned()
}
