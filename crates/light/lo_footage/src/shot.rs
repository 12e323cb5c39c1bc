use std::sync::Arc;

use lo_geometry::{Camera, Quat, RigidTransform, Vec3};
use lo_imaging::{DepthMap, Photo};
use lo_insert::Plate;
use lo_scene::{DistortedPhoto, Frame, LitScene, ObservedPhoto, overlap};

use crate::scale::{self, ScaleFit, View};
use crate::{SceneSurfaces, ShotError};

/// Longer side of a plate's depth.
const DEPTH_SIDE: usize = 640;

/// Largest turn of a camera that sees much the same as another: 25°.
const SIMILAR_RAD: f32 = 0.44;

/// Plates of a moving camera in the room of a scene.
pub struct Shot<'a> {
    scene: &'a LitScene,
    surfaces: SceneSurfaces,
    /// The scene's photo, which exposures refer to.
    reference: ObservedPhoto,
    /// Pose of each plate's camera in the room, for a unit of one metre.
    poses: Vec<RigidTransform>,
    scale: f32,
    /// Stops by which the last measured plate is brighter than the scene's photo.
    brighter_ev: f32,
}

impl<'a> Shot<'a> {
    /// Places a track of cameras in a scene. `track` is the transform from each plate's camera to one common world;
    /// the scene's photo is plate `reference`.
    ///
    /// # Errors
    /// If `reference` is not among the poses, or the octree cannot be traced.
    pub fn new(scene: &'a LitScene, track: &[RigidTransform], reference: usize) -> Result<Self, ShotError> {
        let own = track.get(reference).ok_or(ShotError::NoPose { index: reference, poses: track.len() })?.inverse();
        let poses = (track.iter().enumerate())
            .map(|(i, pose)| if i == reference { RigidTransform::IDENTITY } else { own.after(pose) })
            .collect();
        Ok(Self {
            scene,
            surfaces: SceneSurfaces::new(scene)?,
            reference: ObservedPhoto::new(&scene.frame.working(), RigidTransform::IDENTITY),
            poses,
            scale: 1.0,
            brighter_ev: 0.0,
        })
    }

    /// Sets the metres of the scene per unit of the track; 1 by default.
    pub fn set_scale(&mut self, scale: f32) {
        self.scale = scale;
    }

    /// Returns up to `count` plates that are likely to determine the scale: those that look at much the same as the
    /// scene's photo, from different places.
    pub fn scale_plates(&self, count: usize) -> Vec<usize> {
        let turn = |index: &usize| self.poses[*index].rotation.angle_between(Quat::IDENTITY);
        let mut near: Vec<usize> =
            (0..self.poses.len()).filter(|&index| self.poses[index] != RigidTransform::IDENTITY).collect();
        near.sort_by(|a, b| turn(a).total_cmp(&turn(b)));
        let alike = near.partition_point(|index| turn(index) < SIMILAR_RAD);
        near.truncate(alike.max(count));
        near.sort_by(|&a, &b| {
            let way = |index: usize| self.poses[index].translation_m.length();
            way(a).total_cmp(&way(b))
        });
        let mut chosen: Vec<usize> = (0..count)
            .filter_map(|i| near.get(i * near.len().saturating_sub(1) / (count - 1).max(1)).copied())
            .collect();
        chosen.dedup();
        chosen
    }

    /// Measures the scale by some plates, each with its index and camera, and sets it. It fits best at the positions
    /// `near`, those of objects.
    ///
    /// # Errors
    /// If a plate has no pose.
    pub fn fit_scale(&mut self, plates: &[(usize, Photo, Camera)], near: &[Vec3]) -> Result<ScaleFit, ShotError> {
        let view = |(index, photo, camera): &(usize, Photo, Camera)| {
            let room_from_camera = *self.pose_of_unit(*index)?;
            Ok(View { light: lo_scene::working_photo(photo).into_radiance(), camera: *camera, room_from_camera })
        };
        let views: Vec<View> = plates.iter().map(view).collect::<Result<_, ShotError>>()?;
        let clean = &self.reference.clean;
        let points = |x: usize, y: usize, camera: &Camera| {
            let (u, v) = (x as f64 + 0.5, y as f64 + 0.5);
            let along =
                |at: f64, of: u32, pixels: usize| ((at / f64::from(of) * pixels as f64) as usize).min(pixels - 1);
            let depth = &clean.depth_m;
            let depth_m = depth[(along(u, camera.width, depth.width()), along(v, camera.height, depth.height()))];
            (depth_m > 0.0).then(|| camera.unproject(u, v, f64::from(depth_m)))
        };
        let fit = scale::fit(&self.reference.radiance, &points, &clean.camera, &views, near);
        self.scale = fit.scale;
        Ok(fit)
    }

    /// Returns the metres of the scene per unit of the track.
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// Returns the pose of a plate's camera in the room.
    ///
    /// # Errors
    /// If it has none.
    pub fn pose(&self, index: usize) -> Result<RigidTransform, ShotError> {
        let pose = self.pose_of_unit(index)?;
        Ok(RigidTransform { translation_m: pose.translation_m * self.scale, ..*pose })
    }

    fn pose_of_unit(&self, index: usize) -> Result<&RigidTransform, ShotError> {
        self.poses.get(index).ok_or(ShotError::NoPose { index, poses: self.poses.len() })
    }

    /// Prepares plate `index`: its surfaces, and its exposure. If the plate shows too little of what the scene's photo
    /// shows, it has the exposure of the plate before. `distorted` is the plate as its lens took it, and `depth_m` its
    /// own depth, if there is one.
    ///
    /// # Errors
    /// If it has no pose, or photo, camera and depth do not fit.
    pub fn plate(
        &mut self,
        index: usize,
        photo: Photo,
        camera: Camera,
        distorted: Option<Arc<DistortedPhoto>>,
        depth_m: Option<DepthMap>,
    ) -> Result<Plate, ShotError> {
        let room_from_camera = self.pose(index)?;
        let predicted_depth = depth_m.is_none() && self.scene.origin.predicted_depth;
        let depth_m = depth_m.unwrap_or_else(|| {
            let longer = camera.width.max(camera.height);
            let scale = (DEPTH_SIDE as f64 / f64::from(longer)).min(1.0);
            let scaled = |length: u32| ((f64::from(length) * scale).round() as u32).max(1);
            let small = camera.resized(scaled(camera.width), scaled(camera.height));
            self.surfaces.depth_m(&small, &room_from_camera)
        });
        let exposure = self.scene.frame.exposure;
        let mut frame = Frame::new(photo, depth_m, camera, exposure)?;
        let observed = ObservedPhoto::new(&frame.working(), room_from_camera);
        if let Some(ratio) = overlap(&observed, &self.reference).and_then(|overlap| overlap.exposure) {
            self.brighter_ev = ratio.log2;
        }
        frame.exposure = exposure * (-self.brighter_ev).exp2();
        let last = self.poses.len() - 1;
        let neighbours = [self.pose(index.saturating_sub(1))?, self.pose((index + 1).min(last))?];
        Ok(Plate { frame, distorted, room_from_camera, neighbours, predicted_depth })
    }
}
