use lo_random::{RngExt, Stream};
use serde::{Deserialize, Serialize};

/// Closed interval from which a parameter is drawn; `[low, high]` in files.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "[f32; 2]", into = "[f32; 2]")]
pub struct Interval {
    low: f32,
    high: f32,
}

/// Bounds that do not form an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntervalError([f32; 2]);

impl std::fmt::Display for IntervalError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "[{}, {}] is not an interval: it needs two finite numbers, the lower one first", self.0[0], self.0[1])
    }
}

impl std::error::Error for IntervalError {}

impl Interval {
    /// Creates an interval from constants. Use `try_from` for external input.
    ///
    /// # Panics
    /// If a bound is not finite or `low` is above `high`.
    pub const fn new(low: f32, high: f32) -> Self {
        assert!(
            low.is_finite() && high.is_finite() && low <= high,
            "an interval needs finite bounds, the lower one first"
        );
        Self { low, high }
    }

    /// Lower bound.
    pub fn low(self) -> f32 {
        self.low
    }

    /// Upper bound.
    pub fn high(self) -> f32 {
        self.high
    }

    /// Draws a uniform value.
    pub fn draw(self, stream: &mut Stream) -> f32 {
        self.low + (self.high - self.low) * stream.random::<f32>()
    }

    /// Draws a value whose logarithm is uniform, for quantities in stops. Bounds at or below 0 count as the smallest
    /// positive number.
    pub fn draw_log(self, stream: &mut Stream) -> f32 {
        let [low, high] = [self.low, self.high].map(|bound| bound.max(f32::MIN_POSITIVE));
        (low * (high / low).powf(stream.random::<f32>())).clamp(low, high)
    }

    /// Clamps the interval to `[low, high]`.
    pub(crate) fn within(self, low: f32, high: f32) -> Self {
        Self { low: self.low.clamp(low, high), high: self.high.clamp(low, high) }
    }
}

impl TryFrom<[f32; 2]> for Interval {
    type Error = IntervalError;

    fn try_from([low, high]: [f32; 2]) -> Result<Self, IntervalError> {
        if low.is_finite() && high.is_finite() && low <= high {
            Ok(Self { low, high })
        } else {
            Err(IntervalError([low, high]))
        }
    }
}

impl From<Interval> for [f32; 2] {
    fn from(interval: Interval) -> Self {
        [interval.low, interval.high]
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn draws_fill_the_interval() {
        let mut stream = lo_random::stream(1, "test", 0);
        let draws: Vec<f32> = (0..10_000).map(|_| Interval::new(2.0, 4.0).draw(&mut stream)).collect();
        assert!(draws.iter().all(|d| (2.0..=4.0).contains(d)));
        // Standard error of the mean of a uniform width 2: 2/√12/100 = 0.006.
        assert!((draws.iter().sum::<f32>() / 10_000.0 - 3.0).abs() < 0.03);
        let logs: Vec<f32> = (0..10_000).map(|_| Interval::new(1.0, 100.0).draw_log(&mut stream)).collect();
        // Half of the draws lie below the geometric mean.
        assert!((logs.iter().filter(|&&d| d < 10.0).count() as f32 / 10_000.0 - 0.5).abs() < 0.02);
    }

    #[test]
    fn files_hold_two_numbers_in_order() {
        let interval: Interval = serde_json::from_str("[0.5, 2]").unwrap();
        assert_eq!(interval, Interval::new(0.5, 2.0));
        assert_eq!(serde_json::to_string(&interval).unwrap(), "[0.5,2.0]");
        let message = serde_json::from_str::<Interval>("[2, 0.5]").unwrap_err().to_string();
        assert!(message.contains("[2, 0.5] is not an interval"), "{message}");
    }
}
