use std::borrow::Cow;
use std::sync::Arc;

use lo_cone::{Cone, ConeSample};
use lo_geometry::{Plane, RigidTransform, Vec3};
use lo_scene::LitScene;

use crate::light::room_light::{LightPart, LightRay, RoomLight};
use crate::light::samples::Lights;
use crate::quality::Counts;
use crate::surface::observed_surfaces::Surface;
use crate::{InsertError, Lighting};

/// Light on the objects, in the axes of the camera that sees them: the light of the room, and where the camera is.
#[derive(Clone)]
pub(crate) struct Environment {
    room: Arc<RoomLight>,
    /// The main lights, in the camera's axes.
    lights: Arc<Lights>,
    /// Pose of the camera; `None` for the scene's own, whose axes are the room's.
    pose: Option<Pose>,
    /// Whether reflections have the photo's detail where nothing is observed.
    with_detail: bool,
    /// Height in metres above a real surface from which light is gathered.
    pub lift_m: f32,
}

/// Pose of a camera in the room.
#[derive(Clone, Copy)]
struct Pose {
    room_from_camera: RigidTransform,
    camera_from_room: RigidTransform,
}

impl Environment {
    pub fn new(scene: &LitScene, lighting: Lighting, counts: &Counts) -> Result<Self, InsertError> {
        let room = RoomLight::new(scene, lighting, counts)?;
        let (lights, lift_m) = (Arc::new(room.lights.clone()), room.lift_m);
        Ok(Self { room: Arc::new(room), lights, pose: None, with_detail: true, lift_m })
    }

    /// Returns the light in the axes of another camera.
    pub fn seen_from(&self, room_from_camera: RigidTransform) -> Self {
        let camera_from_room = room_from_camera.inverse();
        Self {
            room: Arc::clone(&self.room),
            lights: Arc::new(self.room.lights.moved(&camera_from_room)),
            pose: Some(Pose { room_from_camera, camera_from_room }),
            ..*self
        }
    }

    /// Removes the detail of unobserved regions from reflections.
    pub fn remove_detail(&mut self) {
        self.with_detail = false;
    }

    pub fn lights(&self) -> &Lights {
        &self.lights
    }

    /// Rotates directions that are fixed in the room to the camera's axes.
    pub fn fixed_in_room(&self, directions: Vec<Vec3>) -> Vec<Vec3> {
        match &self.pose {
            None => directions,
            Some(pose) => directions.into_iter().map(|d| pose.camera_from_room.direction(d)).collect(),
        }
    }

    /// [`RoomLight::gather`] in the camera's axes.
    pub fn gather(&self, part: LightPart, cones: &[Cone], samples: &mut Vec<ConeSample>) {
        self.room.gather(part, &self.in_room(cones), samples);
    }

    /// [`RoomLight::exitant_radiance`] in the camera's axes.
    pub fn exitant_radiance(&self, surfaces: &[Surface]) -> Vec<Vec3> {
        let Some(Pose { room_from_camera, .. }) = &self.pose else { return self.room.exitant_radiance(surfaces) };
        let moved = |surface: &Surface| Surface {
            position_m: room_from_camera.point(surface.position_m),
            normal: room_from_camera.direction(surface.normal),
        };
        self.room.exitant_radiance(&surfaces.iter().map(moved).collect::<Vec<_>>())
    }

    /// [`RoomLight::gather_reflected`] in the camera's axes.
    pub fn gather_reflected(&self, apexes: &[Vec3], cones: &mut [Cone], samples: &mut Vec<ConeSample>) {
        self.gather_from(apexes, cones, samples, RoomLight::gather_reflected);
    }

    /// Prepares [`Environment::gather_behind`].
    pub fn prepare_behind(&self) {
        self.room.prepare_behind();
    }

    /// [`RoomLight::gather_behind`] in the camera's axes.
    pub fn gather_behind(&self, apexes: &[Vec3], cones: &mut [Cone], samples: &mut Vec<ConeSample>) {
        self.gather_from(apexes, cones, samples, RoomLight::gather_behind);
    }

    fn gather_from(
        &self,
        apexes: &[Vec3],
        cones: &mut [Cone],
        samples: &mut Vec<ConeSample>,
        gather: fn(&RoomLight, bool, &[Vec3], &mut [Cone], &mut Vec<ConeSample>),
    ) {
        let Some(Pose { room_from_camera, camera_from_room }) = &self.pose else {
            gather(&self.room, self.with_detail, apexes, cones, samples);
            return;
        };
        let apexes: Vec<Vec3> = apexes.iter().map(|&apex| room_from_camera.point(apex)).collect();
        let mut moved: Vec<Cone> = cones.iter().map(|cone| in_axes(room_from_camera, cone)).collect();
        gather(&self.room, self.with_detail, &apexes, &mut moved, samples);
        // The lookup moves cones.
        for (cone, moved) in cones.iter_mut().zip(&moved) {
            *cone = in_axes(camera_from_room, moved);
        }
    }

    /// [`RoomLight::unoccluded_share`] in the camera's axes.
    pub fn unoccluded_share(&self, rays: &[LightRay], shares: &mut Vec<f32>) {
        let Some(Pose { room_from_camera, .. }) = &self.pose else {
            self.room.unoccluded_share(rays, shares);
            return;
        };
        let moved = |ray: &LightRay| LightRay {
            place: room_from_camera.point(ray.place),
            apex: room_from_camera.point(ray.apex),
            direction: room_from_camera.direction(ray.direction),
            distance_m: ray.distance_m,
        };
        self.room.unoccluded_share(&rays.iter().map(moved).collect::<Vec<_>>(), shares);
    }

    /// Returns the point from which to gather light for a point of an object on `support`: high enough above that
    /// surface's leaves.
    pub fn lifted(&self, point: Vec3, support: Option<Plane>) -> Vec3 {
        let Some(plane) = support else { return point };
        let height_m = plane.signed_distance_m(point);
        point + plane.normal * (self.lift_m - height_m).clamp(0.0, 2.0 * self.lift_m)
    }

    fn in_room<'a>(&self, cones: &'a [Cone]) -> Cow<'a, [Cone]> {
        match &self.pose {
            None => Cow::Borrowed(cones),
            Some(pose) => cones.iter().map(|cone| in_axes(&pose.room_from_camera, cone)).collect(),
        }
    }
}

fn in_axes(to_from: &RigidTransform, cone: &Cone) -> Cone {
    Cone { origin: to_from.point(cone.origin), direction: to_from.direction(cone.direction), ..*cone }
}
