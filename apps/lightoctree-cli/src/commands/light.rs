//! Which guessed light a scene is lit by: options that `insert`, `envmap`, `probes` and `export` share.

use lightoctree::{Document, GuessedLight, LightEffect, LightMode, LightPurpose, LightTuning, LitScene};

use super::parse;
use crate::choice::{Choice, choice};
use crate::progress::Stages;
use crate::usage::Usage;

/// Choices of light.
static LIGHTS: [Choice<LightMode>; 3] = [
    ("even", LightMode::Even, "The likeliest radiance: lamps and windows that no photo shows vanish"),
    ("expected", LightMode::Expected, "The expected energy: right on average, softer than real rooms"),
    (
        "plausible",
        LightMode::Plausible,
        "The expected energy gathered into lamps and windows: contrast and shadows of real rooms",
    ),
];

/// Options of guessed light.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct LightArgs {
    /// Light of what no photo shows [default: what the viewer saved, else plausible for insert and export, expected for envmap and probes]
    #[arg(long, value_name = "LIGHT", value_parser = choice(&LIGHTS))]
    pub light: Option<LightMode>,

    /// Contrast of plausible light, as a factor on that of similar rooms in stops
    #[arg(long, value_name = "FACTOR", value_parser = parse::contrast)]
    pub contrast: Option<f64>,

    /// Stops by which guessed light is redder than estimated; below 0 bluer
    #[arg(long, value_name = "EV", allow_hyphen_values = true, value_parser = parse::warmth)]
    pub warmth: Option<f64>,

    /// This pixel of the photo shows something white: guessed light gets the colour that it has there
    #[arg(long, value_name = "U,V", value_parser = parse::pixel)]
    pub white: Option<[f64; 2]>,

    /// The former name of --light plausible
    #[arg(long, hide = true, conflicts_with_all = ["light", "no_lamp"])]
    lamp: bool,

    /// The former name of --light even
    #[arg(long, hide = true, conflicts_with = "light")]
    no_lamp: bool,
}

/// A choice of light in words, with what differs from the estimate.
pub fn words(guessed: &GuessedLight) -> String {
    let GuessedLight { light, tuning: LightTuning { contrast, warmth_ev, white } } = guessed.in_effect();
    let usual = LightTuning::default();
    let parts = [
        Some(light.name().to_owned()),
        (contrast != usual.contrast).then(|| format!("contrast {contrast}")),
        (warmth_ev != usual.warmth_ev).then(|| format!("warmth {warmth_ev:+} EV")),
        white.map(|[u, v]| format!("white at {u},{v}")),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// A document in the light for a purpose; reports how lamps were fitted.
///
/// # Errors
/// Edits of lights that do not exist, and a white pixel without a colour.
pub fn lit(document: &Document, purpose: LightPurpose, stages: &mut Stages) -> anyhow::Result<LitScene> {
    let (lit, report) = stages.stage("lights", || document.lit_with_report(purpose))?;
    report.fit.warning().iter().for_each(|warning| stages.warn(warning));
    Ok(lit)
}

impl LightArgs {
    /// The light asked for; `None` without any option.
    ///
    /// # Errors
    /// Options that have no effect on it.
    fn chosen(&self, usual: LightMode) -> anyhow::Result<Option<GuessedLight>> {
        let tunes = self.contrast.is_some() || self.warmth.is_some() || self.white.is_some();
        if !(self.light.is_some() || self.lamp || self.no_lamp || tunes) {
            return Ok(None);
        }
        let mode = match self.light {
            _ if self.lamp => LightMode::Plausible,
            _ if self.no_lamp => LightMode::Even,
            None => usual,
            Some(light) => light,
        };
        if self.contrast.is_some() && mode != LightMode::Plausible {
            return Err(Usage("--contrast: only plausible light has one; add --light plausible".into()).into());
        }
        if (self.warmth.is_some() || self.white.is_some()) && mode == LightMode::Even {
            return Err(Usage("--warmth and --white change expected and plausible light, not even light".into()).into());
        }
        let usual = LightTuning::default();
        let tuning = LightTuning {
            contrast: self.contrast.map_or(usual.contrast, |contrast| contrast as f32),
            warmth_ev: self.warmth.map_or(usual.warmth_ev, |warmth| warmth as f32),
            white: self.white,
        };
        Ok(Some(GuessedLight { light: mode, tuning }))
    }

    /// A document in the light that options, its own choice or the purpose ask for, in this order.
    ///
    /// # Errors
    /// Options without effect, edits of lights that do not exist, and a white pixel without a colour.
    pub fn lit(&self, document: &mut Document, purpose: LightPurpose, stages: &mut Stages) -> anyhow::Result<LitScene> {
        if let Some(chosen) = self.chosen(purpose.default_light())? {
            document.light_edits.guessed = Some(chosen);
        }
        let tuning = document.guessed_light(purpose).in_effect().tuning;
        if tuning != LightTuning::default() && LightEffect::of(&document.estimate) != LightEffect::Expected {
            stages.note("the scene has no expected light: contrast, warmth and white change nothing");
        }
        lit(document, purpose, stages)
    }
}
