//! A program, run as a user runs it; `super::PROGRAM` is its name.

use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;

/// The program in a folder.
pub fn program(folder: &Path) -> Command {
    let mut command = Command::cargo_bin(super::PROGRAM).unwrap();
    command.current_dir(folder).arg("--quiet");
    command
}

/// Runs, expects success, returns stdout.
pub fn done(folder: &Path, args: &[&str]) -> String {
    let output = program(folder).args(args).output().unwrap();
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Runs, expects the exit code, returns stderr.
pub fn refused(folder: &Path, code: i32, args: &[&str]) -> String {
    let output = program(folder).args(args).output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {message}");
    assert!(!message.contains("panicked"), "{message}");
    message
}

/// Parses what a command printed.
pub fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}
