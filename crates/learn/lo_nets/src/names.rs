/// Where in a module a visitor is: the names of the fields that lead there. Variants of enums have no part in it: a network's names do not
/// depend on what else might stand in its place.
#[derive(Clone, Debug, Default)]
pub(crate) struct Path(Vec<String>);

impl Path {
    /// The path to what is below this name.
    pub fn of(name: &str) -> Self {
        Self(vec![name.to_owned()])
    }

    /// With what burn's visitors are told.
    pub fn enter(&mut self, name: &str, container: &str) {
        if !is_enum(container) {
            self.0.push(name.to_owned());
        }
    }

    /// With what burn's visitors are told.
    pub fn leave(&mut self, container: &str) {
        if !is_enum(container) {
            self.0.pop();
        }
    }

    /// The fields' names with dots between them.
    pub fn name(&self) -> String {
        self.0.join(".")
    }
}

fn is_enum(container: &str) -> bool {
    container.starts_with("Enum:")
}
