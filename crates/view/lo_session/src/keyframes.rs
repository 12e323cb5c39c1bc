//! Keyframes of objects: where one stands at which time.

use lightoctree::insert::{Interpolation, Keyframe, Path};
use lightoctree::scene::MAX_TIME_S;

use crate::{Object, Place, SessionError};

/// Most keyframes of an object.
const MAX_KEYFRAMES: usize = 500;

/// Times are told to a ten-thousandth of a second; what is nearer is the same time.
const STEPS_PER_S: f64 = 1e4;

/// A time as it is kept.
///
/// # Errors
/// Outside of 0 to [`MAX_TIME_S`].
pub(crate) fn kept_time_s(time_s: f64) -> Result<f64, SessionError> {
    if (0.0..=MAX_TIME_S).contains(&time_s) {
        Ok((time_s * STEPS_PER_S).round() / STEPS_PER_S)
    } else {
        Err(SessionError::Number { name: "the time", needed: "from 0 to 3600 seconds", found: time_s })
    }
}

/// The keyframe that an object stands at: that of the time, and before the first and after the last that one.
pub(crate) fn shown_key(path: &Path, time_s: f64) -> Option<&Keyframe> {
    let (first, last) = (path.keyframes.first()?, path.keyframes.last()?);
    if time_s <= first.time_s {
        Some(first)
    } else if time_s >= last.time_s {
        Some(last)
    } else {
        path.keyframes.iter().find(|key| is_same(key.time_s, time_s))
    }
}

/// Where a keyframe is.
pub(crate) fn place_of(key: &Keyframe) -> Place {
    match (key.pixel, key.position_m) {
        (Some(pixel), _) => Place::Pixel(pixel),
        (None, position_m) => Place::Position(position_m.unwrap_or_default()),
    }
}

fn is_same(a_s: f64, b_s: f64) -> bool {
    (a_s - b_s).abs() < 0.5 / STEPS_PER_S
}

impl Object {
    /// Stands it elsewhere, or turns it: where it has keyframes, in the one of that time, which is added where there is none.
    ///
    /// # Errors
    /// As [`Object::set_key`].
    pub(crate) fn stand(&mut self, place: Place, yaw_deg: f64, time_s: f64) -> Result<(), SessionError> {
        (self.place, self.yaw_deg) = (place, yaw_deg);
        if self.path.is_some() { self.set_key(time_s) } else { Ok(()) }
    }

    /// Adds a keyframe where it stands now, or puts it in the place of the one of that time.
    ///
    /// # Errors
    /// A time out of range, a turn that is no number; too many keyframes.
    pub(crate) fn set_key(&mut self, time_s: f64) -> Result<(), SessionError> {
        if !self.yaw_deg.is_finite() {
            return Err(SessionError::Number { name: "the turn", needed: "a finite angle", found: self.yaw_deg });
        }
        let (pixel, position_m) = match self.place.rounded() {
            Place::Pixel(pixel) => (Some(pixel), None),
            Place::Position(position_m) => (None, Some(position_m)),
        };
        let yaw_deg = (self.yaw_deg * 1e3).round() / 1e3;
        self.put_key(Keyframe { time_s: kept_time_s(time_s)?, position_m, pixel, yaw_deg })
    }

    /// Moves a keyframe to another time, where it takes the place of what is there.
    ///
    /// # Errors
    /// Where there is none; a time out of range.
    pub(crate) fn move_key(&mut self, from_s: f64, to_s: f64) -> Result<(), SessionError> {
        let time_s = kept_time_s(to_s)?;
        let key = self.take_key(from_s)?;
        self.put_key(Keyframe { time_s, ..key })
    }

    /// Takes a keyframe away; without the last one the object stands where that was.
    ///
    /// # Errors
    /// Where there is none.
    pub(crate) fn delete_key(&mut self, time_s: f64) -> Result<(), SessionError> {
        let key = self.take_key(time_s)?;
        if self.path.as_ref().is_some_and(|path| path.keyframes.is_empty()) {
            self.path = None;
            (self.place, self.yaw_deg) = (place_of(&key), key.yaw_deg);
        }
        Ok(())
    }

    /// How it goes from keyframe to keyframe.
    ///
    /// # Errors
    /// Without keyframes.
    pub(crate) fn interpolate(&mut self, interpolation: Interpolation) -> Result<(), SessionError> {
        let path = self.path.as_mut().ok_or(SessionError::NoKeyframe)?;
        path.interpolation = interpolation;
        Ok(())
    }

    fn put_key(&mut self, key: Keyframe) -> Result<(), SessionError> {
        let path =
            self.path.get_or_insert_with(|| Path { interpolation: Interpolation::default(), keyframes: Vec::new() });
        path.keyframes.retain(|other| !is_same(other.time_s, key.time_s));
        if path.keyframes.len() >= MAX_KEYFRAMES {
            return Err(SessionError::Full { what: "keyframes", limit: MAX_KEYFRAMES });
        }
        let index = path.keyframes.partition_point(|other| other.time_s < key.time_s);
        path.keyframes.insert(index, key);
        Ok(())
    }

    fn take_key(&mut self, time_s: f64) -> Result<Keyframe, SessionError> {
        let path = self.path.as_mut().ok_or(SessionError::NoKeyframe)?;
        let index = path.keyframes.iter().position(|key| is_same(key.time_s, time_s));
        index.map(|index| path.keyframes.remove(index)).ok_or(SessionError::NoKeyframe)
    }
}
