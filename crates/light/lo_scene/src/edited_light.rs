use lo_octree::LightOctree;

use crate::AnalyticLight;

/// Effect of [`LightEdits`](crate::LightEdits) on a scene's light. Kept in memory only; never stored in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct EditedLight {
    /// The octree before edits and the change; `None` if it is unchanged.
    pub octree: Option<OctreeChange>,
    /// Lights that are not in the octree.
    pub lights: Vec<AnalyticLight>,
    /// Occluders of the suns among [`EditedLight::lights`]: the observed surfaces without windows and lamps. `None`
    /// if no sun was added.
    pub sun_occluders: Option<LightOctree>,
}

/// Feature rows of an octree before an edit and after, with the same layout and opacities as [`LightOctree::rgba`].
#[derive(Clone, Debug, PartialEq)]
pub struct OctreeChange {
    /// Rows before the edit.
    pub before: Vec<Vec<[f32; 4]>>,
    /// Rows without the light of the edited emitters.
    pub base: Vec<Vec<[f32; 4]>>,
    /// Gain per channel of the light above `base`; 1 away from edited emitters.
    pub gain: Vec<Vec<[f32; 4]>>,
}
