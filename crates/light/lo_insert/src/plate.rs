use std::sync::Arc;

use lo_geometry::RigidTransform;
use lo_scene::{DistortedPhoto, Frame};

use crate::{Instance, Placement};

/// One image of a moving camera in a scene's room, into which objects are inserted.
#[derive(Clone, Debug)]
pub struct Plate {
    /// The image with depth and camera, in its own camera's axes. Its exposure brings it to the scene's radiance.
    pub frame: Frame,
    /// The image as its lens took it, if the frame has its undistorted version.
    pub distorted: Option<Arc<DistortedPhoto>>,
    /// Pose of the camera.
    pub room_from_camera: RigidTransform,
    /// Poses of the camera in the previous and in the next image, for motion vectors.
    pub neighbours: [RigidTransform; 2],
    /// Whether depth is predicted, or read from surfaces of which it is.
    pub predicted_depth: bool,
}

/// Where the camera of a plate is.
#[derive(Clone, Copy)]
pub(crate) struct PlatePose {
    pub room_from_camera: RigidTransform,
    camera_from_room: RigidTransform,
    neighbours: [RigidTransform; 2],
}

impl PlatePose {
    pub fn new(plate: &Plate) -> Self {
        Self {
            room_from_camera: plate.room_from_camera,
            camera_from_room: plate.room_from_camera.inverse(),
            neighbours: plate.neighbours.map(|room_from_camera| room_from_camera.inverse()),
        }
    }

    /// Returns an object in the camera's axes, in other images in those of their cameras.
    pub fn seen<'a>(&self, instance: &Instance<'a>) -> Instance<'a> {
        let Self { camera_from_room, neighbours: [previous, next], .. } = self;
        let [before, after]: [Placement; 2] = instance.moves.unwrap_or([instance.placement; 2]);
        Instance {
            placement: instance.placement.seen_from(camera_from_room),
            moves: Some([before.seen_from(previous), after.seen_from(next)]),
            ..*instance
        }
    }
}
