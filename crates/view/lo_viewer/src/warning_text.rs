use lightoctree::Warning;

/// Returns a warning as a sentence, given the names of the objects.
pub type WarningText = fn(&dyn Warning, &[String]) -> String;
