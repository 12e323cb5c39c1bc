//! Options of inferred light, shared by `insert`, `envmap`, `probes` and `export`.

use lightoctree::{Document, InferredLight, LightMode, LightPurpose, LightTuning, LitScene};
use lo_scene::LightEffect;

use super::parse;
use crate::choice::{Choice, choice};
use crate::progress::Stages;
use crate::usage::Usage;

/// Choices of inferred light.
static LIGHTS: [Choice<LightMode>; 3] = [
    ("even", LightMode::Even, "Most probable radiance: unobserved lamps and windows vanish"),
    ("expected", LightMode::Expected, "Expected energy: right on average, softer than in real rooms"),
    (
        "plausible",
        LightMode::Plausible,
        "Expected energy gathered into lamps and windows: contrast and shadows as in real rooms",
    ),
];

/// Options of inferred light.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct LightArgs {
    /// Light of unobserved regions [default: as saved by the viewer, else plausible for insert and export, expected for
    /// envmap and probes]
    #[arg(long, value_name = "LIGHT", value_parser = choice(&LIGHTS))]
    pub light: Option<LightMode>,

    /// Factor on the contrast of plausible light in stops, 0 to 3; 1 is that of similar rooms [default: 1]
    #[arg(long, value_name = "FACTOR", value_parser = parse::contrast, allow_hyphen_values = true)]
    pub contrast: Option<f64>,

    /// Stops by which inferred light is redder (above 0) or bluer than estimated, -4 to 4 [default: 0]
    #[arg(long, value_name = "EV", allow_hyphen_values = true, value_parser = parse::warmth)]
    pub warmth: Option<f64>,

    /// Pixel of the photo that shows something white; inferred light gets the colour that it has there
    #[arg(long, value_name = "U,V", value_parser = parse::pixel, allow_hyphen_values = true)]
    pub white: Option<[f64; 2]>,

    /// Former name of --light plausible
    #[arg(long, hide = true, conflicts_with_all = ["light", "no_lamp"])]
    lamp: bool,

    /// Former name of --light even
    #[arg(long, hide = true, conflicts_with = "light")]
    no_lamp: bool,
}

/// Describes a choice of light and its tuning, as far as it differs from the default.
pub fn description(inferred: &InferredLight) -> String {
    let InferredLight { light, tuning: LightTuning { contrast, warmth_ev, white } } = inferred.in_effect();
    let default = LightTuning::default();
    let parts = [
        Some(light.name().to_owned()),
        (contrast != default.contrast).then(|| format!("contrast {contrast}")),
        (warmth_ev != default.warmth_ev).then(|| format!("warmth {warmth_ev:+} EV")),
        white.map(|[u, v]| format!("white at {u},{v}")),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// Applies a document's light for a purpose, and reports how lamps were fitted.
///
/// # Errors
/// Edits of lights that do not exist, and a white pixel without a colour.
pub fn lit(document: &Document, purpose: LightPurpose, stages: &mut Stages) -> anyhow::Result<LitScene> {
    let (lit, report) = stages.stage("lights", || document.lit_with_report(purpose))?;
    report.fit.warning().iter().for_each(|warning| stages.warn(warning));
    Ok(lit)
}

impl LightArgs {
    /// Returns whether any of the options is given.
    pub fn is_given(&self) -> bool {
        let tunes = self.contrast.is_some() || self.warmth.is_some() || self.white.is_some();
        self.light.is_some() || self.lamp || self.no_lamp || tunes
    }

    /// Returns the light selected by the options; `None` without any option.
    ///
    /// # Errors
    /// Options that have no effect on this light.
    fn selected(&self, default: LightMode) -> anyhow::Result<Option<InferredLight>> {
        if !self.is_given() {
            return Ok(None);
        }
        let mode = match self.light {
            _ if self.lamp => LightMode::Plausible,
            _ if self.no_lamp => LightMode::Even,
            None => default,
            Some(light) => light,
        };
        if self.contrast.is_some() && mode != LightMode::Plausible {
            return Err(Usage("--contrast applies to plausible light only; add --light plausible".into()).into());
        }
        if (self.warmth.is_some() || self.white.is_some()) && mode == LightMode::Even {
            return Err(Usage(
                "--warmth and --white do not apply to even light; use --light expected or plausible".into(),
            )
            .into());
        }
        let untuned = LightTuning::default();
        let tuning = LightTuning {
            contrast: self.contrast.map_or(untuned.contrast, |contrast| contrast as f32),
            warmth_ev: self.warmth.map_or(untuned.warmth_ev, |warmth| warmth as f32),
            white: self.white,
        };
        Ok(Some(InferredLight { light: mode, tuning }))
    }

    /// Applies the light selected by the options, else by the document, else by the purpose.
    ///
    /// # Errors
    /// Options without effect, edits of lights that do not exist, and a white pixel without a colour.
    pub fn lit(&self, document: &mut Document, purpose: LightPurpose, stages: &mut Stages) -> anyhow::Result<LitScene> {
        if let Some(selected) = self.selected(purpose.default_light())? {
            document.light_edits.inferred = Some(selected);
        }
        let tuning = document.inferred_light(purpose).in_effect().tuning;
        if tuning != LightTuning::default() && LightEffect::of(&document.estimate) != LightEffect::Expected {
            stages.note("the scene has no expected light: contrast, warmth and white have no effect");
        }
        lit(document, purpose, stages)
    }
}
