//! Options whose values are named choices of a type defined in a library.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

/// Name, value and help of one choice.
pub type Choice<T> = (&'static str, T, &'static str);

/// Parses the name of one of `choices`.
pub fn choice<T: Copy + Send + Sync + 'static>(choices: &'static [Choice<T>]) -> impl TypedValueParser<Value = T> {
    let names = choices.iter().map(|&(name, _, help)| PossibleValue::new(name).help(help));
    PossibleValuesParser::new(names).map(move |given| {
        let chosen = choices.iter().find(|(name, ..)| *name == given);
        chosen.expect("clap passes possible values only").1
    })
}

/// Returns the name of a value of `choices`; empty if it is not among them.
pub fn name_of<T: PartialEq>(choices: &[Choice<T>], value: T) -> &'static str {
    choices.iter().find(|(_, other, _)| *other == value).map_or("", |(name, ..)| name)
}
