//! Commands that change lights.

use std::ops::RangeInclusive;

use lightoctree::{InferredLight, LightMode};
use lo_geometry::Vec3;
use lo_scene::{AddedLight, CONTRASTS, LightChange, LightEdits, LightEffect, LightShape, MAX_LIGHT_EDITS, WARMTHS_EV};

use crate::light::sun_direction_of;
use crate::sun_shadow::direction_of_shadow;
use crate::{Command, Session, SessionError, State};

/// Refusals of a choice of light.
const NO_CHOICE: &str = "a network did not infer the light of this scene: all choices are the same";
const NO_EXPECTATION: &str = "this scene has no expected light: contrast, warmth and white have no effect; \
     estimate it again, without a panorama";

/// Distance of a light without a radius from the surface that it is dragged to, metres.
const LIGHT_LIFT_M: f32 = 0.02;

impl Session {
    /// Returns the changed choice of light; `None` if it equals the default.
    pub(crate) fn changed_inferred_light(
        &self,
        state: &State,
        command: &Command,
    ) -> Result<Option<InferredLight>, SessionError> {
        let estimate = self.scene.estimate();
        let within = |name, needed, range: RangeInclusive<f32>, value: f32| {
            let found = f64::from(value);
            if range.contains(&value) { Ok(value) } else { Err(SessionError::InvalidNumber { name, needed, found }) }
        };
        let mut inferred = state.lights.inferred.unwrap_or_default();
        let no_effect = match (LightEffect::of(estimate), command) {
            (LightEffect::None, _) => Some(NO_CHOICE),
            (_, Command::InferredLight { .. }) => None,
            (LightEffect::Fitted, _) => Some(NO_EXPECTATION),
            (_, Command::Contrast { .. }) => {
                (inferred.light != LightMode::Plausible).then_some("contrast has an effect only on plausible light")
            }
            _ => (inferred.light == LightMode::Even)
                .then_some("warmth and white have an effect on expected and plausible light, not even light"),
        };
        if let Some(why) = no_effect {
            return Err(SessionError::NoEffect(why));
        }
        let tuning = &mut inferred.tuning;
        match *command {
            Command::InferredLight { light } => inferred.light = light,
            Command::Contrast { factor } => {
                tuning.contrast = within("the contrast", "from 0 to 3", CONTRASTS, factor)?;
            }
            Command::Warmth { ev } => tuning.warmth_ev = within("the warmth", "from -4 to 4 stops", WARMTHS_EV, ev)?,
            Command::White { pixel } => {
                pixel.map_or(Ok(()), |pixel| lo_estimate::check_white(estimate, pixel))?;
                tuning.white = pixel;
            }
            _ => {}
        }
        // If the scene file has a choice, the state keeps one, so that the command line states it.
        let is_needed = inferred != InferredLight::default() || self.scene.document.light_edits.inferred.is_some();
        Ok(is_needed.then_some(inferred))
    }

    /// Changes the lights of a state.
    pub(crate) fn change_lights(&self, state: &mut State, command: &Command) -> Result<(), SessionError> {
        let full = SessionError::TooMany { what: "changed lights", limit: MAX_LIGHT_EDITS };
        let (scene, estimate) = (&self.scene, self.scene.estimate());
        let missing = |light: &String| SessionError::NoLight(light.clone());
        match command {
            Command::SetLight { light, change } => {
                change.invalid_field().map_or(Ok(()), |what| Err(SessionError::OutOfRange(what)))?;
                if self.set_light(&mut state.lights, light, *change)? { Ok(()) } else { Err(full) }
            }
            Command::DragLight { light, to: [u, v] } => {
                let Some((surface_m, normal)) = scene.surfaces.at_pixel(*u, *v) else { return Ok(()) };
                let radius_m = self.radius_m(&state.lights, light);
                let at_m = surface_m + normal * radius_m.unwrap_or(LIGHT_LIFT_M);
                let change = LightChange { at_m: Some(at_m), ..state.lights.change_of(light) };
                if self.set_light(&mut state.lights, light, change)? { Ok(()) } else { Err(full) }
            }
            Command::AddLight { new } => state.lights.add(new.analytic(estimate)?).map(|_| ()).ok_or(full),
            Command::ReplaceLight { light, new } => {
                let new = new.analytic(estimate)?;
                added_light(&mut state.lights, light).ok_or_else(|| missing(light))?.light = new;
                Ok(())
            }
            Command::AimSun { light, object, to } => {
                // Where the sun would be below the horizon, the shadow stays.
                let Some(towards) = direction_of_shadow(scene, state.object(*object)?, *to) else { return Ok(()) };
                turn_sun(&mut state.lights, light, towards)
            }
            Command::TurnSun { light, azimuth_deg, elevation_deg } => {
                let towards = sun_direction_of(estimate, *azimuth_deg, *elevation_deg)?;
                turn_sun(&mut state.lights, light, towards)
            }
            Command::RemoveLight { light } => {
                if state.lights.remove(light) {
                    Ok(())
                } else {
                    Err(missing(light))
                }
            }
            _ => {
                state.lights = LightEdits::default();
                Ok(())
            }
        }
    }

    /// Replaces the change of a light; `false` if too many are changed.
    fn set_light(&self, lights: &mut LightEdits, id: &str, change: LightChange) -> Result<bool, SessionError> {
        let listed = self.scene.lights().iter().find(|listed| listed.id == *id);
        if listed.is_none() && added_light(lights, id).is_none() {
            return Err(SessionError::NoLight(id.to_owned()));
        }
        let found_at_m = listed.and_then(|listed| listed.position_m).unwrap_or_default();
        Ok(lights.change(id, found_at_m, change))
    }

    /// Returns the radius of a spherical light, metres.
    fn radius_m(&self, lights: &LightEdits, id: &str) -> Option<f32> {
        match lights.added.iter().find(|added| added.id == id).map(|added| added.light.shape) {
            Some(LightShape::Sphere { radius_m, .. }) => Some(radius_m),
            Some(_) => None,
            None => self.scene.lights().iter().find(|listed| listed.id == id)?.radius_m,
        }
    }
}

fn added_light<'a>(lights: &'a mut LightEdits, id: &str) -> Option<&'a mut AddedLight> {
    lights.added.iter_mut().find(|added| added.id == id)
}

/// Turns an added sun. In another direction it is not the photo's own sun any more.
fn turn_sun(lights: &mut LightEdits, id: &str, towards: Vec3) -> Result<(), SessionError> {
    let added = added_light(lights, id).ok_or_else(|| SessionError::NoLight(id.to_owned()))?;
    let LightShape::Sun { direction, of_photo, .. } = &mut added.light.shape else {
        return Err(SessionError::NoSun(id.to_owned()));
    };
    (*direction, *of_photo) = (towards, false);
    Ok(())
}
