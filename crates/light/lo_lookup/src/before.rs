use lo_cone::{ConeTracer, OctreeRenderer};
use lo_geometry::Vec3;
use lo_octree::LightOctree;
use lo_scene::{LitScene, OctreeChange};

/// Returns a tracer of a scene's light before edits, as seen from `eye_m`.
pub(crate) fn light_before(scene: &LitScene, change: &OctreeChange, eye_m: Vec3) -> ConeTracer {
    let light = LightOctree { rgba: change.before.clone(), ..scene.light.clone() };
    OctreeRenderer::new(&light).at(eye_m).into_owned()
}
