use std::borrow::Cow;
use std::fmt;

use lo_events::Warning;

use crate::Unit;

/// Warnings about inserted objects. Objects are identified by their index among the inserted ones, from 0.
///
/// The message numbers several objects from 1; [`with_names`](Self::with_names) names them.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum InsertWarning {
    /// An object is completely hidden by real surfaces or other objects.
    ObjectHidden {
        /// Index of the object.
        object: usize,
    },
    /// An object is outside the photo.
    ObjectOutsidePicture {
        /// Index of the object.
        object: usize,
    },
    /// An object is invisible because its materials are fully transparent.
    ObjectTransparent {
        /// Index of the object.
        object: usize,
    },
    /// An object is higher than the room.
    ObjectTooHigh {
        /// Index of the object.
        object: usize,
        /// Its height in metres.
        height_m: f32,
        /// Height of the room in metres.
        room_m: f32,
        /// Unit of its file that makes it fit.
        likely: Option<Unit>,
    },
    /// An object is wider than the room.
    ObjectTooWide {
        /// Index of the object.
        object: usize,
        /// Its longest edge in metres.
        width_m: f32,
        /// Width of the octree's cube in metres.
        room_m: f32,
        /// Unit of its file that makes it fit.
        likely: Option<Unit>,
    },
    /// An object is too small to be visible.
    ObjectTooSmall {
        /// Index of the object.
        object: usize,
        /// Its longest edge in metres.
        size_m: f32,
    },
    /// An object floats over the observed surface below it.
    ObjectFloats {
        /// Index of the object.
        object: usize,
        /// Height of its base over the surface, in metres.
        gap_m: f32,
    },
    /// An object is sunk into an observed surface.
    ObjectSunk {
        /// Index of the object.
        object: usize,
        /// Height of the surface over its base, in metres.
        depth_m: f32,
    },
    /// An object is outside the lighting octree: its light is unreliable.
    ObjectOutsideOctree {
        /// Index of the object.
        object: usize,
    },
    /// An object overhangs the surface it stands on: most of its base is unsupported.
    ObjectOverhangs {
        /// Index of the object.
        object: usize,
        /// Supported share, from 0 to 1, of the part of the base that can be judged.
        supported: f32,
    },
    /// Two objects intersect.
    ObjectsIntersect {
        /// Indices of the objects.
        objects: [usize; 2],
    },
}

impl InsertWarning {
    /// Returns the message with the names of all inserted objects. A single object needs no name.
    pub fn with_names<'a>(&'a self, names: &'a [String]) -> impl fmt::Display + 'a {
        Named { warning: self, names }
    }
}

impl Warning for InsertWarning {}

impl fmt::Display for InsertWarning {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        Named { warning: self, names: &[] }.fmt(f)
    }
}

struct Named<'a> {
    warning: &'a InsertWarning,
    names: &'a [String],
}

impl Named<'_> {
    /// Whether there is certainly more than one object.
    fn are_several(&self, object: usize) -> bool {
        self.names.len() > 1 || object > 0
    }

    fn name(&self, object: usize) -> Cow<'_, str> {
        match self.names.get(object) {
            Some(name) if self.names.len() > 1 => name.into(),
            _ if object == 0 => "the object".into(),
            _ => format!("object {}", object + 1).into(),
        }
    }
}

impl fmt::Display for Named<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let name = |object| self.name(object);
        match *self.warning {
            InsertWarning::ObjectHidden { object } => {
                let others = if self.are_several(object) { " or other objects" } else { "" };
                write!(f, "{} is not visible: it is behind real surfaces{others}", name(object))
            }
            InsertWarning::ObjectOutsidePicture { object } => {
                write!(f, "{} is not visible: it is outside the photo", name(object))
            }
            InsertWarning::ObjectTransparent { object } => {
                write!(f, "{} is not visible: its material is transparent", name(object))
            }
            InsertWarning::ObjectTooHigh { object, height_m, room_m, .. } => {
                write!(f, "{} is {} high, higher than the room ({})", name(object), Length(height_m), Length(room_m))
            }
            InsertWarning::ObjectTooWide { object, width_m, room_m, .. } => {
                write!(f, "{} is {} wide, wider than the room ({})", name(object), Length(width_m), Length(room_m))
            }
            InsertWarning::ObjectTooSmall { object, size_m } => {
                write!(f, "{} is only {} in size", name(object), Length(size_m))
            }
            InsertWarning::ObjectFloats { object, gap_m } => {
                write!(f, "{} floats {} over the surface below it", name(object), Length(gap_m))
            }
            InsertWarning::ObjectSunk { object, depth_m } => {
                write!(f, "{} is sunk {} into the surface under it", name(object), Length(depth_m))
            }
            InsertWarning::ObjectOutsideOctree { object } => {
                write!(f, "{} is outside the octree, so its lighting is unreliable", name(object))
            }
            InsertWarning::ObjectOverhangs { object, supported } => write!(
                f,
                "only {:.0} % of the base of {} is supported, the rest overhangs an edge: move it, or make it smaller",
                100.0 * supported,
                name(object)
            ),
            InsertWarning::ObjectsIntersect { objects: [a, b] } if self.names.is_empty() => {
                write!(f, "objects {} and {} intersect: move one of them", a + 1, b + 1)
            }
            InsertWarning::ObjectsIntersect { objects: [a, b] } => {
                write!(f, "{} and {} intersect: move one of them", name(a), name(b))
            }
        }
    }
}

/// Formats a length in metres with the unit that a person would use.
struct Length(f32);

impl fmt::Display for Length {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self(metres) = *self;
        if metres >= 9.95 {
            write!(f, "{metres:.0} m")
        } else if metres >= 0.995 {
            write!(f, "{metres:.1} m")
        } else if metres >= 0.0995 {
            write!(f, "{:.0} cm", 100.0 * metres)
        } else if metres >= 0.00995 {
            write!(f, "{:.1} cm", 100.0 * metres)
        } else {
            write!(f, "{:.2} mm", 1000.0 * metres)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn several_objects_are_named() {
        let names = ["table", "vase"].map(str::to_owned);
        let intersect = InsertWarning::ObjectsIntersect { objects: [0, 1] };
        assert_eq!(intersect.with_names(&names).to_string(), "table and vase intersect: move one of them");
        assert_eq!(intersect.to_string(), "objects 1 and 2 intersect: move one of them");
        let hidden = InsertWarning::ObjectHidden { object: 1 };
        let named = hidden.with_names(&names).to_string();
        assert_eq!(named, "vase is not visible: it is behind real surfaces or other objects");
        assert!(hidden.to_string().starts_with("object 2 is not visible"), "{hidden}");
    }

    #[test]
    fn lengths_have_readable_units() {
        let text = |metres| Length(metres).to_string();
        assert_eq!([30.0, 2.61, 0.25, 0.013, 0.0004].map(text), ["30 m", "2.6 m", "25 cm", "1.3 cm", "0.40 mm"]);
    }

    #[test]
    fn a_single_object_needs_no_name() {
        let hidden = InsertWarning::ObjectHidden { object: 0 };
        for message in [hidden.to_string(), hidden.with_names(&["vase".to_owned()]).to_string()] {
            assert_eq!(message, "the object is not visible: it is behind real surfaces");
        }
    }
}
