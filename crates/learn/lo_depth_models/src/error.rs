use lo_events::Cancelled;

/// Errors of reading and running depth networks.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A file cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The file.
        path: String,
        /// The error of the file system.
        source: std::io::Error,
    },
    /// The bytes are not a valid ONNX file.
    #[error("the model's file is damaged: {0}")]
    Malformed(String),
    /// The file exceeds a limit on size, memory or work.
    #[error("the model is too large: {0}")]
    TooLarge(String),
    /// The file uses features that the runtime does not support.
    #[error("cannot run the model: {0}")]
    Unsupported(String),
    /// A file with external weights is missing or invalid.
    #[error("cannot read the model's external weights \"{file}\": {why}")]
    External {
        /// The external file, by the name in the model.
        file: String,
        /// Reason.
        why: String,
    },
    /// A node of the graph is invalid or not supported.
    #[error("cannot run the model's node {node}: {why}")]
    Node {
        /// Operator and name.
        node: String,
        /// Reason.
        why: String,
    },
    /// The inputs and outputs match no known family.
    #[error(
        "unknown depth model; its inputs and outputs are:\n{signature}\nDescribe them in a config file like this one:\n\n{config}"
    )]
    Unknown {
        /// The inputs and outputs, one a line.
        signature: String,
        /// A config to fill in.
        config: String,
    },
    /// The config is invalid or does not match the model.
    #[error("config of the depth model: {0}")]
    Config(String),
    /// An output does not match the model's kind.
    #[error("invalid model output \"{output}\": {why}")]
    Output {
        /// Name of the output.
        output: String,
        /// Reason.
        why: String,
    },
    /// The model cannot process the photo.
    #[error("unsuitable photo: {0}")]
    Photo(String),
    /// The runtime failed for another reason.
    #[error("running the model failed: {0}")]
    Run(String),
    /// The event handler cancelled the job.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl ModelError {
    /// Wraps an error of reading the model's own file. The caller that has the path adds it.
    pub(crate) fn read(source: std::io::Error) -> Self {
        if source.kind() == std::io::ErrorKind::UnexpectedEof {
            return Self::Malformed("it is truncated".to_owned());
        }
        Self::Read { path: String::new(), source }
    }
}

/// A name from a file, made safe to print: no control characters, at most 100 characters.
pub(crate) fn short(name: &str) -> String {
    name.chars().filter(|c| !c.is_control()).take(100).collect()
}
