//! Runs `super::PROGRAM` as a user does.

use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;

/// Prepares the program in a folder.
pub fn program(folder: &Path) -> Command {
    let mut command = Command::cargo_bin(super::PROGRAM).unwrap();
    command.current_dir(folder).arg("--quiet");
    command
}

/// Runs the program, expects success and returns stdout.
pub fn done(folder: &Path, args: &[&str]) -> String {
    let output = program(folder).args(args).output().unwrap();
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Runs the program, expects an exit code and returns stderr.
pub fn refused(folder: &Path, code: i32, args: &[&str]) -> String {
    let output = program(folder).args(args).output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {message}");
    assert!(!message.contains("panicked"), "{message}");
    message
}

/// Parses the output of a command.
pub fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}
