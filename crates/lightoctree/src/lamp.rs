use lo_completion::LampFit;
use lo_scene::{Completion, Scene};

/// Makes what a network guessed of lamps and windows as bright as the photo's shading asks for ([`lo_completion::fit_lamps`]): for objects, which have to
/// be lit as what they stand beside.
///
/// A scene's own light is the likeliest one, in which lamps and windows are darker than they are: nobody knows how bright. Scenes that no network
/// completed stay as they are: the shell has a lamp of its own. So do those onto which an HDR panorama was laid: it knows the lamps. A clipped one does
/// not know how bright they are.
pub fn fit_lamps(scene: &mut Scene) -> LampFit {
    let knows_lamps = scene.panorama.as_ref().is_some_and(|laid| !laid.source.clipped);
    if scene.completion != Completion::Network || knows_lamps {
        return LampFit::default();
    }
    let (seen, up) = (scene.frame.working().without_flying_pixels(), scene.up());
    lo_completion::fit_lamps(&mut scene.light, &seen, up)
}
