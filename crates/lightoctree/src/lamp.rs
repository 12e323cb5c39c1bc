use lo_completion::{LampFit, LampReport, fit_lamps, light_from_above};
use lo_scene::{Completion, Scene};

/// Adds the lamp to a scene completed by a network that what the photo shows asks for: for objects, which have to be as bright as what they
/// stand beside.
///
/// A scene's own light is the likeliest one, which has no lamps that are not seen: nobody knows where they are. Panoramas are nearer to the truth without
/// (`docs/design/013-lamp-for-objects.md`), objects look right with it. Scenes that no network completed stay as they are: the shell has a lamp of its own. So do those onto which
/// an HDR panorama was laid: it knows the lamps. A clipped one does not know how bright they are.
pub fn add_lamp(scene: &mut Scene) -> LampReport {
    let (Completion::Network, Some(room)) = (scene.completion, &scene.room) else { return LampReport::default() };
    if scene.panorama.as_ref().is_some_and(|laid| !laid.source.clipped) {
        return LampReport::default();
    }
    let seen = scene.frame.working().without_flying_pixels();
    light_from_above(&mut scene.light, &seen.surfels(&seen.radiance()), room.up)
}

/// Adds the lamps that explain how what the photo shows is shaded.
pub fn add_fitted_lamps(scene: &mut Scene) -> LampFit {
    let (Completion::Network, Some(room)) = (scene.completion, &scene.room) else { return LampFit::default() };
    if scene.panorama.as_ref().is_some_and(|laid| !laid.source.clipped) {
        return LampFit::default();
    }
    let seen = scene.frame.working().without_flying_pixels();
    fit_lamps(&mut scene.light, &seen, room)
}
