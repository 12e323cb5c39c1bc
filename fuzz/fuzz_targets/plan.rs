//! Room plans of panoramas: a text gives an error or plausible distances.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use lo_dataset::RoomPlan;

fuzz_target!(|text: &str| {
    let Ok(plan) = RoomPlan::parse(text, Path::new("plan.json")) else { return };
    let (seen, closed) = (plan.distance_m(32, 16), plan.enclosure_m(32, 16));
    assert!(seen.pixels().iter().all(|&distance_m| distance_m.is_finite() && distance_m >= 0.0));
    assert!(closed.pixels().iter().all(|&distance_m| distance_m > 0.0 && distance_m <= 200.0));
});
