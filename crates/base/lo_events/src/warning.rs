use std::any::Any;
use std::fmt::{Debug, Display};

/// A problem or an assumption that the user should know about.
///
/// Each crate defines its own warnings: an enum with the values, whose [`Display`] is the message, without a full stop
/// at its end. `downcast_ref` returns the enum.
pub trait Warning: Any + Debug + Display + Send + Sync {}

impl dyn Warning {
    /// Returns the warning as its own type; `None` if it is of another type.
    pub fn downcast_ref<T: Warning>(&self) -> Option<&T> {
        (self as &dyn Any).downcast_ref()
    }
}
