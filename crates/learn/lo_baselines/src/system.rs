use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// There is no system of this name.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("no baseline is called \"{name}\"; there are {known}")]
pub struct UnknownSystem {
    /// The name.
    pub name: String,
    /// All names.
    pub known: String,
}

/// A system of the literature. Its serialised name is used in configurations, weights files and tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum System {
    /// Gardner et al., "Learning to predict indoor illumination from a single image", 2017.
    Gardner2017,
    /// Sengupta et al., "Neural inverse rendering of an indoor scene from a single image", 2019.
    Nir2019,
    /// LeGendre et al., "DeepLight: learning illumination for unconstrained mobile mixed reality", 2019.
    DeepLight2019,
    /// Garon et al., "Fast spatially-varying indoor lighting estimation", 2019.
    Garon2019,
    /// Li et al., "Inverse rendering for complex indoor scenes: shape, spatially-varying lighting and SVBRDF from a
    /// single image", 2020.
    Li2020,
    /// Srinivasan et al., "Lighthouse: predicting lighting volumes for spatially-coherent illumination", 2020.
    Lighthouse2020,
}

impl System {
    /// All systems, by year.
    pub const ALL: [Self; 6] =
        [Self::Gardner2017, Self::Nir2019, Self::DeepLight2019, Self::Garon2019, Self::Li2020, Self::Lighthouse2020];

    /// Returns the name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gardner2017 => "gardner2017",
            Self::Nir2019 => "nir2019",
            Self::DeepLight2019 => "deeplight2019",
            Self::Garon2019 => "garon2019",
            Self::Li2020 => "li2020",
            Self::Lighthouse2020 => "lighthouse2020",
        }
    }

    /// Whether the light depends on the position in the room.
    pub fn is_local(self) -> bool {
        matches!(self, Self::Garon2019 | Self::Li2020 | Self::Lighthouse2020)
    }
}

impl fmt::Display for System {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for System {
    type Err = UnknownSystem;

    fn from_str(name: &str) -> Result<Self, UnknownSystem> {
        Self::ALL.into_iter().find(|system| system.name() == name).ok_or_else(|| {
            let known: Vec<&str> = Self::ALL.into_iter().map(Self::name).collect();
            UnknownSystem { name: name.to_owned(), known: known.join(", ") }
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn names_are_those_of_files() {
        for system in System::ALL {
            assert_eq!(serde_json::to_value(system).unwrap(), system.name());
            assert_eq!(system.name().parse::<System>().unwrap(), system);
        }
        let error = "gardner".parse::<System>().unwrap_err().to_string();
        assert!(error.contains("\"gardner\"") && error.contains("gardner2017, nir2019"), "{error}");
    }
}
