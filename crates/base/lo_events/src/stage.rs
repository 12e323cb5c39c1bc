use std::borrow::Cow;
use std::fmt;

/// A stage of a long job, identified by its name.
///
/// Each crate defines the stages of its jobs as constants. Stages that depend on a configuration are made from a
/// [`String`].
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Stage(Cow<'static, str>);

impl Stage {
    /// Creates a stage from its name as users read it: lower case, without punctuation at its end.
    pub const fn new(name: &'static str) -> Self {
        Self(Cow::Borrowed(name))
    }

    /// Returns the name.
    pub fn name(&self) -> &str {
        &self.0
    }
}

impl From<String> for Stage {
    fn from(name: String) -> Self {
        Self(Cow::Owned(name))
    }
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.pad(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_are_equal_by_name() {
        const LIGHT: Stage = Stage::new("light 2/3");
        assert_eq!(LIGHT, Stage::from(format!("light {}/3", 2)));
        assert_eq!(format!("{LIGHT:<10}|"), "light 2/3 |");
    }
}
