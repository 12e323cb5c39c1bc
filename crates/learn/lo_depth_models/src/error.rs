use lo_events::Cancelled;

/// Why a depth network tells nothing of a photo.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A file cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The file.
        path: String,
        /// Of the file system.
        source: std::io::Error,
    },
    /// The bytes are none of an ONNX file.
    #[error("the model's file is damaged: {0}")]
    Malformed(String),
    /// The file asks for more than is given.
    #[error("the model is too large: {0}")]
    TooLarge(String),
    /// The file holds what the run time does not know.
    #[error("the model cannot be run: {0}")]
    Unsupported(String),
    /// Weights that lie in another file are not there.
    #[error("the model keeps weights in \"{file}\": {why}")]
    External {
        /// The other file, as the model calls it.
        file: String,
        /// What is wrong with it.
        why: String,
    },
    /// A node of the graph cannot be run.
    #[error("the model cannot be run at its node {node}: {why}")]
    Node {
        /// Operator and name.
        node: String,
        /// What is wrong with it.
        why: String,
    },
    /// No family that is known takes and gives what this model does.
    #[error(
        "what the model's inputs and outputs mean is not known:\n{signature}\nSay it in a file, and give that as the model's config:\n\n{config}"
    )]
    Unknown {
        /// The inputs and outputs, one a line.
        signature: String,
        /// A config to fill in.
        config: String,
    },
    /// The config does not fit the model, or is none.
    #[error("the config of the depth model: {0}")]
    Config(String),
    /// The model gave something other than its kind promises.
    #[error("the model's output \"{output}\" {why}")]
    Output {
        /// The output.
        output: String,
        /// What is wrong with it.
        why: String,
    },
    /// The photo cannot be given to the model.
    #[error("the photo: {0}")]
    Photo(String),
    /// The run time failed where nothing of the above foretold it.
    #[error("the model's run failed: {0}")]
    Run(String),
    /// The handler of events asked for the end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl ModelError {
    /// Of the model's own file, whose path is added by whoever knows it.
    pub(crate) fn read(source: std::io::Error) -> Self {
        if source.kind() == std::io::ErrorKind::UnexpectedEof {
            return Self::Malformed("it ends too early".to_owned());
        }
        Self::Read { path: String::new(), source }
    }
}

/// A name from a file, fit to be printed.
pub(crate) fn short(name: &str) -> String {
    name.chars().filter(|c| !c.is_control()).take(100).collect()
}
