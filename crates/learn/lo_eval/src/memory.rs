//! Resident memory of this process, as Linux tells it; other systems give none.

/// Resident set now, in MiB.
pub fn current_mib() -> Option<f64> {
    status_mib("VmRSS:")
}

/// Highest resident set since [`reset_peak`], in MiB.
pub fn peak_mib() -> Option<f64> {
    status_mib("VmHWM:")
}

/// Starts the high-water mark anew.
pub fn reset_peak() {
    // "5" is what proc(5) says; where the kernel refuses, the peak includes the preparation.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

fn status_mib(field: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with(field))?;
    line.split_whitespace().nth(1)?.parse::<f64>().ok().map(|kib| kib / 1024.0)
}
