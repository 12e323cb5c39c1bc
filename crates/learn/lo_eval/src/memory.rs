//! Resident memory of this process, on Linux; `None` on other systems.

/// Returns the current resident set, MiB.
pub fn current_mib() -> Option<f64> {
    status_mib("VmRSS:")
}

/// Returns the peak resident set since [`reset_peak`], MiB.
pub fn peak_mib() -> Option<f64> {
    status_mib("VmHWM:")
}

/// Resets the peak of the resident set.
pub fn reset_peak() {
    // "5" resets the peak, see proc(5). If the kernel refuses, the peak includes earlier work.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

fn status_mib(field: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with(field))?;
    line.split_whitespace().nth(1)?.parse::<f64>().ok().map(|kib| kib / 1024.0)
}
