//! The object's surface as some hundred points that take part in the exchange of diffuse light.

use lo_geometry::Vec3;

use crate::gather::{Gatherer, Receiver};
use crate::object::Object;
use crate::radiosity::{Radiosity, diffuse_look};

/// A point of the object's surface with what it reflects.
pub(crate) struct Patch {
    receiver: Receiver,
    albedo: Vec3,
    emissive: Vec3,
}

/// `count` points spread evenly over the object's surface by area; the same ones of a model each time.
pub(crate) fn patches(object: &Object, count: usize) -> Vec<Patch> {
    object
        .spread_points(count)
        .into_iter()
        .map(|point| {
            let receiver = Receiver {
                position: point.position,
                normal: point.shading_normal,
                geometric_normal: point.geometric_normal,
                diffuse: true,
                gloss: None,
            };
            let (albedo, emissive) = diffuse_look(&point);
            Patch { receiver, albedo, emissive }
        })
        .collect()
}

/// Lights the patches. With a gatherer that knows an earlier radiosity, light goes one bounce further.
pub(crate) fn lit(gatherer: &Gatherer, patches: &[Patch]) -> Radiosity {
    let receivers: Vec<Receiver> = patches.iter().map(|patch| patch.receiver).collect();
    let gathered = gatherer.gather_parallel(&receivers);
    let mut radiosity = Radiosity::dark(gatherer.object);
    for (patch, light) in patches.iter().zip(gathered) {
        let exitance = patch.albedo * light.irradiance / std::f32::consts::PI + patch.emissive;
        let Receiver { position, normal, .. } = patch.receiver;
        radiosity.add(gatherer.object, position, normal, light.irradiance, exitance);
    }
    radiosity
}
