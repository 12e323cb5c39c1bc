/// Path of field names from a module's root to the parameter being visited.
///
/// Enum variants are left out: stored names must not depend on which variants an enum has.
#[derive(Clone, Debug, Default)]
pub(crate) struct ParameterPath(Vec<String>);

impl ParameterPath {
    /// Creates a path that starts at `name`.
    pub fn root(name: &str) -> Self {
        Self(vec![name.to_owned()])
    }

    /// Enters a field, as reported by burn's visitors.
    pub fn enter(&mut self, name: &str, container: &str) {
        if !is_enum(container) {
            self.0.push(name.to_owned());
        }
    }

    /// Leaves a field, as reported by burn's visitors.
    pub fn leave(&mut self, container: &str) {
        if !is_enum(container) {
            self.0.pop();
        }
    }

    /// Joins the field names by dots.
    pub fn name(&self) -> String {
        self.0.join(".")
    }
}

fn is_enum(container: &str) -> bool {
    container.starts_with("Enum:")
}
