use lo_cone::{ConeTracer, Viewers};
use lo_geometry::Vec3;
use lo_octree::LightOctree;
use lo_scene::{LitScene, OctreeChange};

/// A scene's light as it was before edits, as it is seen from a place.
pub(crate) fn light_before(scene: &LitScene, change: &OctreeChange, eye_m: Vec3) -> ConeTracer {
    let light = LightOctree { rgba: change.before.clone(), ..scene.light.clone() };
    Viewers::new(&light).at(eye_m).into_owned()
}
