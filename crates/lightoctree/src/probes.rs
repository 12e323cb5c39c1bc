use lo_cone::Rendering;
use lo_events::{Cancelled, OnEvent, Stage, progress, stage_of_steps};
use lo_geometry::Vec3;
use lo_lookup::SceneRenderer;
use lo_scene::LitScene;

/// Rendering the panoramas of the probes.
const PROBES: Stage = Stage::new("probes");

/// Renders the panorama at each point and passes it to `keep`, with the point's index.
///
/// `points` are in metres in the world frame. A panorama is equirectangular with `2 × height` × `height` pixels; its
/// centre faces −Z, and +Y is up. `on_event` receives the progress.
///
/// # Errors
/// - The first error of `keep`.
/// - [`Cancelled`] if `on_event` breaks off. `keep` has received all panoramas up to then.
///
/// # Panics
/// If `height` is 0.
pub fn render_probes<E: From<Cancelled>>(
    scene: &LitScene,
    points: &[Vec3],
    height: usize,
    mut keep: impl FnMut(usize, Rendering) -> Result<(), E>,
    on_event: OnEvent<'_>,
) -> Result<(), E> {
    let renderer = SceneRenderer::new(scene);
    stage_of_steps(on_event, PROBES, |on_event| {
        for (index, &point) in points.iter().enumerate() {
            keep(index, renderer.panorama(point, 2 * height, height))?;
            progress(on_event, PROBES, index as u64 + 1, points.len() as u64)?;
        }
        Ok(())
    })
}
