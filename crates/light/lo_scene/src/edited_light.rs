use lo_octree::LightOctree;

use crate::AnalyticLight;

/// What [`LightEdits`](crate::LightEdits) made of a scene's light. In memory alone: no file holds it.
#[derive(Clone, Debug, PartialEq)]
pub struct EditedLight {
    /// The octree as it was, and by what it differs now; `None` where it is the same.
    pub octree: Option<OctreeChange>,
    /// Lights that no octree holds.
    pub lights: Vec<AnalyticLight>,
    /// What hides suns among [`EditedLight::lights`]: what the photo saw, without windows and lamps. Where there are none, nothing.
    pub hides_suns: Option<LightOctree>,
}

/// Rows of features as in [`LightOctree::rgba`], of one octree, with its opacities: before edits, without the edited emitters, and how much there is
/// now of what these gave.
#[derive(Clone, Debug, PartialEq)]
pub struct OctreeChange {
    /// As it was.
    pub before: Vec<Vec<[f32; 4]>>,
    /// Without the light of the edited emitters.
    pub base: Vec<Vec<[f32; 4]>>,
    /// By channel, the factor of what lies above that; 1 where no edited emitter is near.
    pub gain: Vec<Vec<[f32; 4]>>,
}
