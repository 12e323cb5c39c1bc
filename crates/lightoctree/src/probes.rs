use lo_cone::Rendering;
use lo_events::{Cancelled, OnEvent, Stage, progress, stage_of_steps};
use lo_geometry::Vec3;
use lo_lookup::SceneRenderer;
use lo_scene::LitScene;

/// Renders the panorama at each point, `2 × height` pixels wide and in our own orientation, and hands it to `keep` with the point's index.
///
/// # Errors
/// Those of `keep`, and [`Cancelled`] where `on_event` breaks off between two panoramas; those before are kept.
///
/// # Panics
/// Where `height` is 0.
pub fn render_probes<E: From<Cancelled>>(
    scene: &LitScene,
    points: &[Vec3],
    height: usize,
    mut keep: impl FnMut(usize, Rendering) -> Result<(), E>,
    on_event: OnEvent<'_>,
) -> Result<(), E> {
    let viewers = SceneRenderer::new(scene);
    stage_of_steps(on_event, Stage::Probes, |on_event| {
        for (index, &point) in points.iter().enumerate() {
            keep(index, viewers.panorama(point, 2 * height, height))?;
            progress(on_event, Stage::Probes, index as u64 + 1, points.len() as u64)?;
        }
        Ok(())
    })
}
