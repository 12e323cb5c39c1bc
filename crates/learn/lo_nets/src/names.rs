/// Where in a module a visitor is: the names of the fields that lead there.
#[derive(Clone, Debug, Default)]
pub(crate) struct Path(Vec<String>);

impl Path {
    pub fn enter(&mut self, name: &str) {
        self.0.push(name.to_owned());
    }

    pub fn leave(&mut self) {
        self.0.pop();
    }

    /// The fields' names with dots between them.
    pub fn name(&self) -> String {
        self.0.join(".")
    }
}
