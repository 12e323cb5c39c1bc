use lo_geometry::{Quat, Vec3};
use lo_imaging::DepthMap;
use lo_random::Stream;
use lo_sensor::{DepthModel, DepthSettings, DepthView, PhotoModel, PhotoSettings};
use lo_synth::{CameraPose, Interior, SynthConfig, SynthError};
use lo_transport::{BakeSettings, BakedWorld, Pose, View};
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::sample::Metadata;
use crate::{DatasetError, NovelView, Record, Shot};

/// Configuration of generated rooms. Every field has a default, so a file only needs the fields that differ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GeneratorConfig {
    /// Rooms, cameras and outdoors.
    pub room: SynthConfig,
    /// Photo cameras.
    pub photo: PhotoModel,
    /// Depth sensors.
    pub depth: DepthModel,
    /// Sampling settings of the light transport.
    pub light: BakeSettings,
    /// Photos per room, at least 1.
    pub shots: u32,
    /// Panoramas per room. They are distributed over the photos; each is inside the frustum of its photo.
    pub panoramas: u32,
    /// Height of a panorama, which is twice as wide.
    pub panorama_height: u32,
    /// Depth of the octree that the surface points are made for: eight points per leaf face of the cube around the
    /// room.
    pub octree_depth: u32,
}

impl Default for GeneratorConfig {
    fn default() -> Self {
        Self {
            room: SynthConfig::default(),
            photo: PhotoModel::default(),
            depth: DepthModel::default(),
            light: BakeSettings::default(),
            shots: 6,
            panoramas: 6,
            panorama_height: 128,
            octree_depth: 7,
        }
    }
}

/// A setting is out of range.
#[derive(Debug, thiserror::Error)]
pub enum GeneratorError {
    /// A setting of rooms and cameras.
    #[error("room: {0}")]
    Room(#[from] SynthError),
    /// Distance of cache points.
    #[error("light.spacing_m is {0}; it must be between 0.02 and 1")]
    Spacing(f32),
    /// An integer.
    #[error("{field} is {value}; it must be between {min} and {max}")]
    Range {
        /// Name of the field.
        field: &'static str,
        /// Its value.
        value: u32,
        /// Smallest allowed value.
        min: u32,
        /// Largest allowed value.
        max: u32,
    },
}

impl GeneratorConfig {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is out of range; the error names it and its range.
    pub fn validate(&self) -> Result<(), GeneratorError> {
        self.room.validate()?;
        if !(0.02..=1.0).contains(&self.light.spacing_m) {
            return Err(GeneratorError::Spacing(self.light.spacing_m));
        }
        let ranges = [
            ("shots", self.shots, 1, 64),
            ("panoramas", self.panoramas, 0, 256),
            ("panorama_height", self.panorama_height, 4, 2048),
            ("octree_depth", self.octree_depth, 1, lo_octree::MAX_DEPTH),
            ("light.gather_rays", self.light.gather_rays, 1, 4096),
            ("light.light_rays", self.light.light_rays, 1, 4096),
            ("light.pixel_rays", self.light.pixel_rays, 1, 256),
        ];
        match ranges.into_iter().find(|(_, value, min, max)| !(min..=max).contains(&value)) {
            Some((field, value, min, max)) => Err(GeneratorError::Range { field, value, min, max }),
            None => Ok(()),
        }
    }
}

/// Generates rooms with global illumination, photos and panoramas. Endless, and identical for the same seed on any
/// machine.
#[derive(Clone, Debug)]
pub struct Generator {
    seed: u64,
    config: GeneratorConfig,
}

impl Generator {
    /// Creates a generator.
    ///
    /// # Errors
    /// If a field is out of range; the error names it.
    pub fn new(seed: u64, config: GeneratorConfig) -> Result<Self, GeneratorError> {
        config.validate()?;
        Ok(Self { seed, config })
    }

    /// Returns the configuration.
    pub fn config(&self) -> &GeneratorConfig {
        &self.config
    }

    /// Returns the name of room `index`. [`Split::of`](crate::Split::of) it is the room's split.
    pub fn scene_id(&self, index: u64) -> String {
        format!("synth-{}-{index:06}", self.seed)
    }

    /// Generates room `index` without light transport, for export.
    ///
    /// # Errors
    /// If a folder of outdoor panoramas cannot be read.
    pub fn interior(&self, index: u64) -> Result<Interior, DatasetError> {
        Interior::generate(self.seed, index, &self.config.room).map_err(|error| self.failed(index, error))
    }

    /// Generates room `index` with light, photos and panoramas.
    ///
    /// # Errors
    /// If a folder of outdoor panoramas cannot be read, or light transport rejects the room.
    pub fn record(&self, index: u64) -> Result<Record, DatasetError> {
        let interior = self.interior(index)?;
        let cameras = interior.camera_poses(self.config.shots as usize);
        let probes = self.probes(&interior, &cameras);
        self.make_record(index, interior, &cameras, &probes, DeviceAssignment::PerPhoto)
    }

    /// Generates room `index` with photos that one device takes from the given cameras. Exposure and white balance vary
    /// between photos; response curve and sensors are shared. All panoramas are in the frustum of the first photo.
    ///
    /// # Errors
    /// See [`record`](Self::record).
    pub fn record_by_one_device(
        &self,
        index: u64,
        cameras: impl FnOnce(&Interior) -> Vec<CameraPose>,
    ) -> Result<Record, DatasetError> {
        let interior = self.interior(index)?;
        let cameras = cameras(&interior);
        let probes = self.probes(&interior, &cameras[..cameras.len().min(1)]);
        self.make_record(index, interior, &cameras, &probes, DeviceAssignment::Shared)
    }

    /// Makes a record with photos by these cameras and panoramas at these probe positions.
    fn make_record(
        &self,
        index: u64,
        interior: Interior,
        cameras: &[CameraPose],
        probes: &[(usize, Vec3)],
        devices: DeviceAssignment,
    ) -> Result<Record, DatasetError> {
        let description = json!(interior.description);
        let leaf_m = leaf_edge_m(&interior, self.config.octree_depth);
        let settings = BakeSettings { seed: self.seed ^ lo_random::hash(interior.id.as_bytes()), ..self.config.light };
        let baked = BakedWorld::bake(interior.world, &settings).map_err(|error| self.failed(index, error))?;
        let views = probes.iter().map(|&(_, position_m)| self.view(&baked, position_m)).collect();
        let mut shots = Vec::with_capacity(cameras.len());
        for (i, camera) in cameras.iter().enumerate() {
            // Each photo has its own random streams, so that the number of photos changes none of them.
            let number = index * 64 + i as u64;
            let stream = |name| lo_random::stream(self.seed, name, number);
            let (mut photo, mut depth) = (stream("photo"), stream("depth sensor"));
            let mut settings = self.config.photo.draw(&mut photo);
            let mut sensor = self.config.depth.draw(&mut depth);
            if devices == DeviceAssignment::Shared {
                let first = |name| lo_random::stream(self.seed, name, index * 64);
                let own = settings;
                settings = self.config.photo.draw(&mut first("photo"));
                settings.exposure_error_ev = own.exposure_error_ev;
                settings.white_balance_error = own.white_balance_error;
                sensor = self.config.depth.draw(&mut first("depth sensor"));
            }
            let mut shot = self.shot(&baked, camera, (&settings, photo), (&sensor, depth));
            shot.views = own_first(probes, i, |position_m| shot.observes(position_m));
            shots.push(shot);
        }
        let surface = baked.radiance_points(leaf_m);
        let mut record = Record {
            key: interior.id.clone(),
            scene_id: interior.id,
            up: Some(Vec3::Y),
            points: surface.points,
            point_area_m2: Some(surface.area_m2),
            views,
            shots,
            metadata: Metadata::from_iter([("room".to_owned(), description)]),
        };
        check_light(&mut record).map_err(|reason| self.failed(index, reason))?;
        Ok(record)
    }

    /// Makes a record of room `index`, which is `interior`, with one photo and with panoramas at the given positions in
    /// the room's frame.
    ///
    /// # Errors
    /// If light transport rejects the room.
    pub fn record_with_panoramas(
        &self,
        index: u64,
        interior: Interior,
        camera: &CameraPose,
        positions: impl IntoIterator<Item = Vec3>,
    ) -> Result<Record, DatasetError> {
        let probes: Vec<(usize, Vec3)> = positions.into_iter().map(|position| (0, position)).collect();
        self.make_record(index, interior, std::slice::from_ref(camera), &probes, DeviceAssignment::PerPhoto)
    }

    /// Returns the positions of the panoramas, each with the photo in whose frustum it is.
    fn probes(&self, interior: &Interior, cameras: &[CameraPose]) -> Vec<(usize, Vec3)> {
        let (total, shots) = (self.config.panoramas as usize, cameras.len().max(1));
        let positions = cameras.iter().enumerate().flat_map(|(i, camera)| {
            let share = total / shots + usize::from(i < total % shots);
            interior.probe_positions(camera, share).into_iter().map(move |position| (i, position))
        });
        positions.collect()
    }

    fn view(&self, baked: &BakedWorld, position_m: Vec3) -> NovelView {
        let pose = Pose { position: position_m, rotation: Quat::IDENTITY };
        let rendering = baked.render(&View::Panorama { pose, height: self.config.panorama_height as usize });
        NovelView {
            position_m,
            rotation: Quat::IDENTITY,
            radiance: rendering.radiance,
            depth_m: Some(rendering.depth_m),
        }
    }

    fn shot(
        &self,
        baked: &BakedWorld,
        view: &CameraPose,
        (settings, mut photo): (&PhotoSettings, Stream),
        (sensor, mut depth): (&DepthSettings, Stream),
    ) -> Shot {
        let CameraPose { pose, camera } = *view;
        let mut seen = baked.render(&View::Pinhole { pose, camera });
        let before_sensor = DepthView {
            camera: &camera,
            depth_m: &seen.depth_m,
            normal: &seen.normal,
            albedo: &seen.albedo,
            specular: &seen.specular,
        };
        let sensor_depth_m = sensor.measure(&before_sensor, &mut depth);
        seen.radiance = settings.with_flash(seen.radiance, &before_sensor);
        let taken = settings.photograph(&seen.radiance, &camera, &mut photo);
        let [r, g, b] = taken.gains;
        Shot {
            position_m: pose.position,
            rotation: pose.rotation,
            gains: taken.gains,
            camera,
            photo: taken.photo,
            jpeg: Some(taken.jpeg),
            radiance: Some(seen.radiance.map(|rgb| [rgb[0] * r, rgb[1] * g, rgb[2] * b])),
            depth_m: Some(seen.depth_m),
            sensor_depth_m: Some(sensor_depth_m),
            normal: Some(seen.normal),
            albedo: Some(seen.albedo),
            views: Vec::new(),
            metadata: Metadata::from_iter([
                ("gains".to_owned(), json!(taken.gains)),
                ("photo".to_owned(), json!(settings)),
                ("depth_sensor".to_owned(), json!(sensor)),
            ]),
        }
    }

    fn failed(&self, index: u64, reason: impl ToString) -> DatasetError {
        DatasetError::Generate { scene_id: self.scene_id(index), reason: reason.to_string() }
    }
}

/// Assigns devices to photos.
#[derive(Clone, Copy, PartialEq, Eq)]
enum DeviceAssignment {
    /// Each photo has its own device.
    PerPhoto,
    /// One device takes all photos.
    Shared,
}

/// Rejects NaN and infinite radiance, which must never reach a network. Negative radiance, a filter's undershoot, is
/// clamped to 0, as in the octree.
fn check_light(record: &mut Record) -> Result<(), String> {
    fn check<'a>(what: &str, light: impl Iterator<Item = &'a mut [f32; 3]>) -> Result<(), String> {
        for (place, rgb) in light.enumerate() {
            if rgb.iter().any(|v| !v.is_finite()) {
                return Err(format!("{what}: the radiance at {place} is {rgb:?}"));
            }
            *rgb = rgb.map(|v| v.max(0.0));
        }
        Ok(())
    }
    check("surface points", record.points.iter_mut().map(|point| &mut point.radiance))?;
    for (i, view) in record.views.iter_mut().enumerate() {
        check(&format!("panorama {i}"), view.radiance.pixels_mut().iter_mut())?;
    }
    for (i, shot) in record.shots.iter_mut().enumerate() {
        check(&format!("photo {i}"), shot.radiance.iter_mut().flat_map(|radiance| radiance.pixels_mut()))?;
    }
    Ok(())
}

/// Returns the leaf edge of the cube around a room's triangles.
fn leaf_edge_m(interior: &Interior, depth: u32) -> f32 {
    let positions = &interior.world.model.positions;
    let low = positions.iter().copied().reduce(Vec3::min).unwrap_or_default();
    let high = positions.iter().copied().reduce(Vec3::max).unwrap_or_default();
    (high - low).max_element().max(1.0) / (1u32 << depth) as f32
}

/// Returns the panoramas made for photo `shot`, then the others that it observes.
fn own_first(probes: &[(usize, Vec3)], shot: usize, observes: impl Fn(Vec3) -> bool) -> Vec<usize> {
    let own = (0..probes.len()).filter(|&i| probes[i].0 == shot);
    let others = (0..probes.len()).filter(|&i| probes[i].0 != shot && observes(probes[i].1));
    own.chain(others).collect()
}

impl Shot {
    /// Whether a position in the record's frame projects into the photo and is in front of the surface or sky there.
    fn observes(&self, position_m: Vec3) -> bool {
        let inside = |depth: &DepthMap| {
            let local = self.rotation.inverse() * (position_m - self.position_m);
            self.camera.project(local).is_some_and(|(u, v, z)| {
                let (u, v) = (u.floor(), v.floor());
                let in_picture = u >= 0.0 && v >= 0.0 && u < depth.width() as f64 && v < depth.height() as f64;
                in_picture && {
                    let surface = f64::from(depth[(u as usize, v as usize)]);
                    surface == 0.0 || z < surface
                }
            })
        };
        self.depth_m.as_ref().is_some_and(inside)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn nan_radiance_is_an_error_and_negative_radiance_becomes_zero() {
        let mut record = crate::fixture::record("a");
        record.points[2].radiance = [-0.1, 0.5, 1.0];
        assert_eq!(check_light(&mut record), Ok(()));
        assert_eq!(record.points[2].radiance, [0.0, 0.5, 1.0]);
        record.views[1].radiance[(3, 2)][0] = f32::NAN;
        let message = check_light(&mut record).unwrap_err();
        assert_eq!(message, "panorama 1: the radiance at 35 is [NaN, 16.2, 300000.0]");
    }

    #[test]
    fn light_settings_keep_their_keys_and_have_no_seed() {
        let text = serde_json::to_string(&GeneratorConfig::default().light).unwrap();
        assert_eq!(text, r#"{"spacing_m":0.16,"gather_rays":64,"light_rays":16,"pixel_rays":2,"sun_at_edges":false}"#);
        assert!(serde_json::from_str::<GeneratorConfig>(r#"{"light": {"seed": 1}}"#).is_err());
    }

    #[test]
    fn settings_out_of_range_are_named() {
        let message = |config| Generator::new(0, config).unwrap_err().to_string();
        assert_eq!(
            message(GeneratorConfig { shots: 0, ..Default::default() }),
            "shots is 0; it must be between 1 and 64"
        );
        assert!(
            serde_json::from_str::<GeneratorConfig>(r#"{"shot": 3}"#)
                .unwrap_err()
                .to_string()
                .contains("unknown field")
        );
        assert_eq!(serde_json::from_str::<GeneratorConfig>("{}").unwrap(), GeneratorConfig::default());
    }
}
