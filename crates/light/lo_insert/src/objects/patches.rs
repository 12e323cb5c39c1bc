//! The objects' surfaces as some hundred points each, for the exchange of diffuse light.

use lo_geometry::Vec3;

use crate::light::gather::{Gatherer, Receiver};
use crate::light::radiosity::{Radiosity, diffuse_albedo_and_emission};
use crate::objects::object::Object;
use crate::objects::tracing::Objects;

/// A point of an object's surface with its reflectance.
pub(crate) struct Patch {
    receiver: Receiver,
    albedo: Vec3,
    emissive: Vec3,
}

/// Returns `count` points spread evenly over each object's surface by area. They are deterministic per model.
pub(crate) fn patches(objects: &Objects, count: usize) -> Vec<Patch> {
    let of_object = |(object, placed): (usize, &Object)| {
        placed.spread_points(count).into_iter().map(move |point| {
            let receiver = Receiver {
                object,
                position: point.position,
                normal: point.shading_normal,
                geometric_normal: point.geometric_normal,
                diffuse: true,
                gloss: None,
            };
            let (albedo, emissive) = diffuse_albedo_and_emission(&point);
            Patch { receiver, albedo, emissive }
        })
    };
    objects.iter().enumerate().flat_map(of_object).collect()
}

/// Lights the patches and returns the radiosity of each object. A gatherer with an earlier radiosity adds one bounce.
pub(crate) fn radiosity(gatherer: &Gatherer, patches: &[Patch]) -> Vec<Radiosity> {
    let receivers: Vec<Receiver> = patches.iter().map(|patch| patch.receiver).collect();
    let gathered = gatherer.gather_parallel(&receivers);
    let mut radiosity: Vec<Radiosity> = gatherer.objects.iter().map(Radiosity::dark).collect();
    for (patch, light) in patches.iter().zip(gathered) {
        let exitance = patch.albedo * light.irradiance / std::f32::consts::PI + patch.emissive;
        let Receiver { object, position, normal, .. } = patch.receiver;
        radiosity[object].add(&gatherer.objects[object], position, normal, light.irradiance, exitance);
    }
    radiosity
}
