use lo_geometry::Vec3;
use serde::{Deserialize, Serialize};

use crate::objects::ranges;
use crate::{Align, Base, Ground, InsertError, Placement};

/// Path of a moving object: keyframes over time, read from JSON.
///
/// ```json
/// {"interpolation": "catmull-rom",
///  "keyframes": [{"time_s": 0, "position_m": [0, -1, -3], "yaw_deg": 0},
///                {"time_s": 1, "pixel": [320, 400], "yaw_deg": 90}]}
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(deny_unknown_fields)]
pub struct Path {
    /// Interpolation of positions and yaw between keyframes.
    #[serde(default)]
    pub interpolation: Interpolation,
    /// Keyframes by ascending time; at least one.
    pub keyframes: Vec<Keyframe>,
}

/// Interpolation between keyframes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// Piecewise linear.
    #[default]
    Linear,
    /// Smooth through every keyframe (cubic Hermite, tangents from differences of the neighbours).
    CatmullRom,
}

/// Position and yaw at one time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS), ts(optional_fields))]
#[serde(deny_unknown_fields)]
pub struct Keyframe {
    /// Time in seconds.
    pub time_s: f64,
    /// World position of the object's base in metres; alternative to `pixel`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position_m: Option<[f64; 3]>,
    /// Photo position whose surface the object rests on; alternative to `position_m`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pixel: Option<[f64; 2]>,
    /// Rotation about the up axis in degrees; not wrapped, so 0 → 720 is two turns.
    #[serde(default)]
    pub yaw_deg: f64,
}

/// Placement options that all keyframes share.
#[derive(Clone, Copy, Debug)]
pub struct PathPlacement<'a> {
    /// Metres per unit of the model.
    pub scale: f32,
    /// Alignment of its up.
    pub align: Align,
    /// Contact area with the surface. Without it, the path is not that of an object: pixels may show any surface, and
    /// their height is that of the pixel alone.
    pub base: Option<&'a Base>,
}

impl Default for PathPlacement<'_> {
    /// Returns the model's own size, against gravity.
    fn default() -> Self {
        Self { scale: 1.0, align: Align::Gravity, base: None }
    }
}

impl PathPlacement<'_> {
    fn at_key(&self, ground: Ground<'_>, key: &Keyframe) -> Result<Placement, InsertError> {
        match (key.position_m, key.pixel) {
            (Some(position), _) => {
                let position_m = Vec3::from_array(position.map(|x| x as f32));
                Ok(Placement::at(ground.estimate, position_m, self.align).scaled(self.scale))
            }
            (None, Some([u, v])) => {
                let of_key = |resting: Placement| resting.scaled(self.scale).turned(key.yaw_deg.to_radians() as f32);
                match self.base {
                    Some(base) => {
                        Ok(of_key(Placement::stand_on_pixel(ground, u, v, self.align)?).settled(ground, base))
                    }
                    None => Ok(of_key(Placement::rest_on_pixel(ground, u, v, self.align)?)),
                }
            }
            (None, None) => Err(InsertError::Path("a keyframe has no position".into())),
        }
    }
}

impl Path {
    /// Largest number of keyframes of a path.
    const MAX_KEYFRAMES: usize = 100_000;

    /// Parses and validates a path.
    ///
    /// # Errors
    /// If the JSON is invalid, or times, positions or yaw are.
    pub fn from_json(text: &str) -> Result<Self, InsertError> {
        let path: Self = serde_json::from_str(text)?;
        path.check()?;
        Ok(path)
    }

    pub(crate) fn check(&self) -> Result<(), InsertError> {
        let fail = |message: String| Err(InsertError::Path(message));
        if self.keyframes.is_empty() || self.keyframes.len() > Self::MAX_KEYFRAMES {
            return fail(format!("needs 1 to {} keyframes, has {}", Self::MAX_KEYFRAMES, self.keyframes.len()));
        }
        for (i, key) in self.keyframes.iter().enumerate() {
            ranges::POSITION_M
                .check(key.position_m.iter().flatten())
                .and_then(|()| ranges::PIXEL.check(key.pixel.iter().flatten()))
                .and_then(|()| ranges::TIME_S.check([&key.time_s]))
                .and_then(|()| ranges::YAW_DEG.check([&key.yaw_deg]))
                .or_else(|wrong| fail(format!("keyframe {i}: {wrong}")))?;
            if key.position_m.is_some() == key.pixel.is_some() {
                return fail(format!("keyframe {i} needs either \"position_m\" or \"pixel\""));
            }
            if i > 0 && key.time_s <= self.keyframes[i - 1].time_s {
                return fail(format!("keyframe {i} is not later than the one before it"));
            }
        }
        Ok(())
    }

    /// Returns the times of the first and the last keyframe, in seconds.
    ///
    /// # Errors
    /// If the path is invalid.
    pub fn span_s(&self) -> Result<[f64; 2], InsertError> {
        self.check()?;
        Ok([self.keyframes[0].time_s, self.keyframes[self.keyframes.len() - 1].time_s])
    }

    /// Returns `frames` placements at equal time steps from the first keyframe to the last.
    ///
    /// # Errors
    /// If a keyframe's pixel has no surface, or the path is invalid.
    pub fn placements<'a>(
        &self,
        ground: impl Into<Ground<'a>>,
        options: &PathPlacement,
        frames: usize,
    ) -> Result<Vec<Placement>, InsertError> {
        self.placements_at(ground, options, &frame_times_s(self.span_s()?, frames))
    }

    /// Returns the placements at given times in seconds. Before the first keyframe and after the last one the object
    /// rests.
    ///
    /// # Errors
    /// If a keyframe's pixel has no surface, or the path is invalid.
    pub fn placements_at<'a>(
        &self,
        ground: impl Into<Ground<'a>>,
        options: &PathPlacement,
        times_s: &[f64],
    ) -> Result<Vec<Placement>, InsertError> {
        self.check()?;
        let ground = ground.into();
        let keys = self.keyframes.iter().map(|key| options.at_key(ground, key)).collect::<Result<Vec<_>, _>>()?;
        Ok(times_s.iter().map(|&time_s| self.placement_at(&keys, time_s)).collect())
    }

    fn placement_at(&self, keys: &[Placement], time_s: f64) -> Placement {
        let after = self.keyframes.partition_point(|key| key.time_s <= time_s).clamp(1, keys.len().max(2) - 1);
        if keys.len() == 1 {
            return keys[0].turned(self.keyframes[0].yaw_deg.to_radians() as f32);
        }
        let (a, b) = (after - 1, after);
        let t = ((time_s - self.keyframes[a].time_s) / (self.keyframes[b].time_s - self.keyframes[a].time_s))
            .clamp(0.0, 1.0);
        let value = |i: usize| {
            let [x, y, z] = keys[i].position_m.to_array().map(f64::from);
            [x, y, z, self.keyframes[i].yaw_deg]
        };
        let mixed: [f64; 4] = std::array::from_fn(|channel| {
            let (p, q) = (value(a)[channel], value(b)[channel]);
            match self.interpolation {
                Interpolation::Linear => p + (q - p) * t,
                Interpolation::CatmullRom => {
                    let span = self.keyframes[b].time_s - self.keyframes[a].time_s;
                    let tangent = |i: usize| {
                        let (before, next) = (i.saturating_sub(1), (i + 1).min(keys.len() - 1));
                        let seconds = self.keyframes[next].time_s - self.keyframes[before].time_s;
                        (value(next)[channel] - value(before)[channel]) / seconds * span
                    };
                    hermite(p, tangent(a), q, tangent(b), t)
                }
            }
        });
        let near = if t < 0.5 { keys[a] } else { keys[b] };
        let up = keys[a].up.lerp(keys[b].up, t as f32).normalize_or(near.up);
        let position_m = Vec3::new(mixed[0] as f32, mixed[1] as f32, mixed[2] as f32);
        Placement { position_m, yaw_rad: mixed[3].to_radians() as f32, up, ..near }
    }
}

/// Returns the times of `frames` frames at equal steps from the first time to the last.
pub(crate) fn frame_times_s([first, last]: [f64; 2], frames: usize) -> Vec<f64> {
    let step = (last - first) / (frames.max(2) - 1) as f64;
    (0..frames).map(|frame| first + step * frame as f64).collect()
}

/// Evaluates the cubic with values `p`, `q` and slopes `dp`, `dq` at 0 and 1.
fn hermite(p: f64, dp: f64, q: f64, dq: f64, t: f64) -> f64 {
    let (t2, t3) = (t * t, t * t * t);
    p * (2.0 * t3 - 3.0 * t2 + 1.0) + dp * (t3 - 2.0 * t2 + t) + q * (3.0 * t2 - 2.0 * t3) + dq * (t3 - t2)
}
