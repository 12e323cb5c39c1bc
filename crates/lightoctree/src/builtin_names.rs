/// Names of the models embedded in this library, for [`builtin_model`](crate::builtin_model).
pub const BUILTIN_MODELS: [&str; 6] = ["sphere", "suzanne", "tea-set", "glass-sphere", "wine-glass", "bottle"];

/// Prefix of a built-in model's name where a mesh file is expected, as in `builtin:sphere`.
pub const BUILTIN_PREFIX: &str = "builtin:";
