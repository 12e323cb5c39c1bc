use std::collections::HashMap;

use lo_geometry::Vec3;
use lo_scene::{AddedLight, EmitterEdit, LightChange, LightEdits, LightShape, LitScene};
use serde::Serialize;

use crate::cap::luminance;
use crate::colour::color_temperature_k;
use crate::edit::edited_emitter;
use crate::emitters::{Emitter, emitters};
use crate::kind::{LightKind, LightOrigin};
use crate::shape::ClusterShape;

/// An entry of the list of lights, with its light before edits.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS), ts(optional_fields))]
pub struct ListedLight {
    /// Name of the light.
    pub id: String,
    /// Kind of light.
    pub kind: LightKind,
    /// Source of the light.
    pub origin: LightOrigin,
    /// Centre, in metres in the photo's frame; absent for a sun.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "typescript", ts(as = "Option<[f32; 3]>"))]
    pub position_m: Option<Vec3>,
    /// Unit direction of emission; for a sun, the direction towards it. Absent for lights that shine in all directions.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "typescript", ts(as = "Option<[f32; 3]>"))]
    pub direction: Option<Vec3>,
    /// Width and height of a rectangle, in metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_m: Option<[f32; 2]>,
    /// Radius of a sphere, in metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius_m: Option<f32>,
    /// Angular radius of a sun, in degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub angular_radius_deg: Option<f32>,
    /// Emitting area in m²; absent for a sun.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub area_m2: Option<f32>,
    /// Mean linear RGB radiance.
    pub radiance: [f32; 3],
    /// Luminance of the irradiance on a surface facing a sun; absent for other lights.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub irradiance: Option<f32>,
    /// Correlated colour temperature, where the colour is near that of a black body.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub color_temperature_k: Option<f32>,
    /// Share of the total light emitted by surfaces; absent for added lights.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flux_share: Option<f32>,
    /// Confidence, from 0 to 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub certainty: Option<f32>,
    /// The user's edit of the light.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub change: Option<LightChange>,
}

/// Lists the lights of a scene whose edits are not applied, including added lights.
pub fn list(scene: &LitScene, edits: &LightEdits) -> Vec<ListedLight> {
    let found = emitters(scene);
    let edited = |edit: &EmitterEdit| Some((edited_emitter(edit, &found).ok()?.id.as_str(), edit.change));
    let changes: HashMap<&str, LightChange> = edits.emitters.iter().filter_map(edited).collect();
    let found = found.iter().map(|emitter| of_emitter(emitter, changes.get(emitter.id.as_str()).copied()));
    found.chain(edits.added.iter().map(ListedLight::of_added)).collect()
}

/// Lists emitters without edits.
pub fn list_emitters(found: &[Emitter]) -> Vec<ListedLight> {
    found.iter().map(|emitter| of_emitter(emitter, None)).collect()
}

fn of_emitter(emitter: &Emitter, change: Option<LightChange>) -> ListedLight {
    let Emitter { id, origin, kind, surface, radiance, flux_share, certainty, .. } = emitter;
    let (direction, size_m, radius_m) = match surface.shape {
        ClusterShape::Panel { direction, size_m, .. } => (Some(direction), Some(size_m), None),
        ClusterShape::Ball { radius_m } => (None, None, Some(radius_m)),
        ClusterShape::Concave => (None, None, None),
    };
    ListedLight {
        id: id.clone(),
        kind: *kind,
        origin: *origin,
        position_m: Some(surface.centre_m),
        direction,
        size_m,
        radius_m,
        angular_radius_deg: None,
        area_m2: Some(surface.area_m2),
        radiance: radiance.to_array(),
        irradiance: None,
        color_temperature_k: color_temperature_k(radiance.to_array()),
        flux_share: Some(*flux_share),
        certainty: *certainty,
        change,
    }
}

impl ListedLight {
    /// Lists a light that the user added.
    pub fn of_added(AddedLight { id, light, change }: &AddedLight) -> Self {
        let radiance = light.radiance;
        let mut listed = Self {
            id: id.clone(),
            kind: LightKind::Area,
            origin: LightOrigin::Added,
            position_m: light.centre_m(),
            direction: None,
            size_m: None,
            radius_m: None,
            angular_radius_deg: None,
            area_m2: Some(light.extent()),
            radiance,
            irradiance: None,
            color_temperature_k: color_temperature_k(radiance),
            flux_share: None,
            certainty: None,
            change: (*change != LightChange::NONE).then_some(*change),
        };
        match light.shape {
            LightShape::Rectangle { direction, size_m, .. } => {
                (listed.direction, listed.size_m) = (Some(direction), Some(size_m));
            }
            LightShape::Sphere { radius_m, .. } => listed.radius_m = Some(radius_m),
            LightShape::Sun { direction, angular_radius_deg, .. } => {
                listed.kind = LightKind::Sun;
                (listed.direction, listed.angular_radius_deg) = (Some(direction), Some(angular_radius_deg));
                listed.irradiance = Some(luminance(Vec3::from(radiance)) * light.extent());
                listed.area_m2 = None;
            }
        }
        listed
    }
}
