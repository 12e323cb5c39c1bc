use std::ffi::OsString;
use std::path::PathBuf;

/// Returns the folder of the viewer's recent rooms; `None` if the environment names no folder of the user.
pub fn recent_rooms() -> Option<PathBuf> {
    Some(state_folder(|name| std::env::var_os(name))?.join("lightoctree").join("recent"))
}

/// Returns the user's folder for application state: that of the XDG base directory specification, or the system's own
/// on Windows and macOS.
fn state_folder(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    // Relative paths are invalid by the specification.
    let folder = |name: &str| variable(name).map(PathBuf::from).filter(|path| path.is_absolute());
    if cfg!(windows) {
        return folder("LOCALAPPDATA");
    }
    let home = folder("HOME");
    let own = if cfg!(target_os = "macos") { "Library/Application Support" } else { ".local/state" };
    folder("XDG_STATE_HOME").or_else(|| Some(home?.join(own)))
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn the_environment_names_the_folder() {
        let of = |pairs: &[(&str, &str)]| {
            state_folder(|name| pairs.iter().find(|(other, _)| *other == name).map(|(_, value)| value.into()))
        };
        assert_eq!(of(&[("HOME", "/home/a")]), Some("/home/a/.local/state".into()));
        assert_eq!(of(&[("HOME", "/home/a"), ("XDG_STATE_HOME", "/state")]), Some("/state".into()));
        assert_eq!(of(&[("HOME", "/home/a"), ("XDG_STATE_HOME", "state")]), Some("/home/a/.local/state".into()));
        assert_eq!(of(&[]), None);
    }
}
