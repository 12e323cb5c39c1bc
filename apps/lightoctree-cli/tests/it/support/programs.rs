//! Programs of the system that tests use.

use std::io::Write;
use std::path::PathBuf;

/// Makes a missing program an error; `.ci/run` sets it.
const REQUIRED: &str = "LIGHTOCTREE_REQUIRE_PROGRAMS";

/// Finds the first of some alternative programs in the path and in the system folders. If none is installed, prints
/// that `untested` is skipped and returns `None`.
///
/// # Panics
/// If none is installed and `LIGHTOCTREE_REQUIRE_PROGRAMS` is set.
pub fn program(names: &[&str], untested: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = std::env::split_paths(&path).chain(["/usr/sbin".into(), "/usr/local/sbin".into()]);
    let found = folders.flat_map(|folder| names.iter().map(move |name| folder.join(name))).find(|file| file.is_file());
    if found.is_none() {
        let names = names.join(", ");
        assert!(std::env::var_os(REQUIRED).is_none(), "{untested}: {REQUIRED} is set, but {names} is not installed");
        let _ = writeln!(std::io::stderr().lock(), "\nSKIPPED: {untested}: {names} is not installed");
    }
    found
}
