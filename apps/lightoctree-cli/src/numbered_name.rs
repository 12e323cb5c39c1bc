//! File names of sequences, with the frame's number as `%d` or `%04d`.

use std::path::{Path, PathBuf};

use crate::usage::Usage;

/// A file name with a place for the frame's number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NumberedName {
    before: String,
    /// Least number of digits.
    width: usize,
    after: String,
}

impl NumberedName {
    /// Parses a file name with one `%d` or `%0Nd`.
    ///
    /// # Errors
    /// [`Usage`] that names the option if there is none or more than one.
    pub fn parse(pattern: &Path, option: &str) -> anyhow::Result<Self> {
        let text = unicode(pattern, option)?;
        let wrong = || Usage(format!("{option} {text}: a sequence requires one %d or %04d in the file name"));
        let (before, rest) = text.split_once('%').ok_or_else(wrong)?;
        let (digits, after) = rest.split_once('d').ok_or_else(wrong)?;
        let is_width = digits.is_empty() || (digits.starts_with('0') && digits.len() == 2);
        if after.contains('%') || after.contains('/') || !is_width {
            return Err(wrong().into());
        }
        Ok(Self { before: before.to_owned(), width: digits.parse().unwrap_or(0), after: after.to_owned() })
    }

    /// Returns the name of a frame.
    pub fn name(&self, frame: usize) -> PathBuf {
        let Self { before, width, after } = self;
        PathBuf::from(format!("{before}{frame:0width$}{after}"))
    }

    /// Returns the numbers of all existing files, in order.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub fn existing(&self) -> std::io::Result<Vec<usize>> {
        let (folder, start) = match self.before.rfind('/') {
            Some(end) => (&self.before[..=end], &self.before[end + 1..]),
            None => ("./", &self.before[..]),
        };
        let mut numbers = Vec::new();
        for entry in std::fs::read_dir(folder)? {
            let name = entry?.file_name();
            let digits = name.to_str().and_then(|name| name.strip_prefix(start)?.strip_suffix(&*self.after));
            let number = digits.filter(|digits| digits.bytes().all(|byte| byte.is_ascii_digit()));
            // `%04d` does not stand for 00007 or 7.
            let is_own =
                |number: &usize| digits.is_some_and(|digits| format!("{number:0w$}", w = self.width) == digits);
            numbers.extend(number.and_then(|digits| digits.parse().ok()).filter(is_own));
        }
        numbers.sort_unstable();
        Ok(numbers)
    }
}

/// Returns a path as text.
///
/// # Errors
/// [`Usage`] that names the option if it is not Unicode.
pub fn unicode<'a>(path: &'a Path, option: &str) -> anyhow::Result<&'a str> {
    Ok(path.to_str().ok_or_else(|| Usage(format!("{option}: the file name is not valid Unicode")))?)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn existing_files_are_found_by_their_numbers() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a_0007.png", "a_0012.png", "a_12345.png", "a_7.png", "a_00008.png", "a_x.png", "b_0001.png"] {
            std::fs::write(folder.path().join(name), []).unwrap();
        }
        let numbers =
            |pattern: &str| NumberedName::parse(&folder.path().join(pattern), "--plate").unwrap().existing().unwrap();
        assert_eq!(numbers("a_%04d.png"), [7, 12, 12345]);
        assert_eq!(numbers("a_%d.png"), [7, 12345]);
        assert_eq!(numbers("c_%d.png"), [] as [usize; 0]);
        assert!(NumberedName::parse(Path::new("a_%04d/b.png"), "--plate").unwrap_err().is::<Usage>());
    }
}
