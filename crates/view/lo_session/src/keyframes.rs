//! Keyframes of objects: position and rotation at given times.

use lo_insert::{Interpolation, Keyframe, Path};

use crate::key_times::{is_same, position_of, quantized_time_s};
use crate::{Object, ObjectPosition, SessionError};

/// Maximum number of keyframes of an object.
const MAX_KEYFRAMES: usize = 500;

impl Object {
    /// Sets position and rotation. An animated object gets them in the keyframe at the time, added if there is none.
    ///
    /// # Errors
    /// Those of [`Object::set_key`].
    pub(crate) fn set_pose(&mut self, position: ObjectPosition, yaw_deg: f64, time_s: f64) -> Result<(), SessionError> {
        (self.position, self.yaw_deg) = (position, yaw_deg);
        if self.path.is_some() { self.set_key(time_s) } else { Ok(()) }
    }

    /// Adds a keyframe of the current pose, replacing one at the same time.
    ///
    /// # Errors
    /// If the time is out of range, the rotation is not finite, or there are too many keyframes.
    pub(crate) fn set_key(&mut self, time_s: f64) -> Result<(), SessionError> {
        if !self.yaw_deg.is_finite() {
            return Err(SessionError::InvalidNumber {
                name: "the rotation",
                needed: "a finite angle",
                found: self.yaw_deg,
            });
        }
        let (pixel, position_m) = match self.position.rounded() {
            ObjectPosition::Pixel(pixel) => (Some(pixel), None),
            ObjectPosition::Position(position_m) => (None, Some(position_m)),
        };
        let yaw_deg = (self.yaw_deg * 1e3).round() / 1e3;
        self.insert_key(Keyframe { time_s: quantized_time_s(time_s)?, position_m, pixel, yaw_deg })
    }

    /// Moves a keyframe to another time, replacing one there.
    ///
    /// # Errors
    /// If there is no keyframe at `from_s`, or `to_s` is out of range.
    pub(crate) fn move_key(&mut self, from_s: f64, to_s: f64) -> Result<(), SessionError> {
        let time_s = quantized_time_s(to_s)?;
        let key = self.remove_key(from_s)?;
        self.insert_key(Keyframe { time_s, ..key })
    }

    /// Deletes a keyframe. After the last one is deleted, the object stays at its pose.
    ///
    /// # Errors
    /// If there is no keyframe at the time.
    pub(crate) fn delete_key(&mut self, time_s: f64) -> Result<(), SessionError> {
        let key = self.remove_key(time_s)?;
        if self.path.as_ref().is_some_and(|path| path.keyframes.is_empty()) {
            self.path = None;
            (self.position, self.yaw_deg) = (position_of(&key), key.yaw_deg);
        }
        Ok(())
    }

    /// Sets the interpolation between keyframes.
    ///
    /// # Errors
    /// If there are no keyframes.
    pub(crate) fn interpolate(&mut self, interpolation: Interpolation) -> Result<(), SessionError> {
        let path = self.path.as_mut().ok_or(SessionError::NoKeyframe)?;
        path.interpolation = interpolation;
        Ok(())
    }

    fn insert_key(&mut self, key: Keyframe) -> Result<(), SessionError> {
        let path =
            self.path.get_or_insert_with(|| Path { interpolation: Interpolation::default(), keyframes: Vec::new() });
        path.keyframes.retain(|other| !is_same(other.time_s, key.time_s));
        if path.keyframes.len() >= MAX_KEYFRAMES {
            return Err(SessionError::TooMany { what: "keyframes", limit: MAX_KEYFRAMES });
        }
        let index = path.keyframes.partition_point(|other| other.time_s < key.time_s);
        path.keyframes.insert(index, key);
        Ok(())
    }

    fn remove_key(&mut self, time_s: f64) -> Result<Keyframe, SessionError> {
        let path = self.path.as_mut().ok_or(SessionError::NoKeyframe)?;
        let index = path.keyframes.iter().position(|key| is_same(key.time_s, time_s));
        index.map(|index| path.keyframes.remove(index)).ok_or(SessionError::NoKeyframe)
    }
}
