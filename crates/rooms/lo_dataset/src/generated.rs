use std::borrow::Cow;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use crate::{Dataset, DatasetError, Generator, Record, Sample};

/// Number of cached rooms, so that the photos of one room do not generate it again.
const CACHED_ROOMS: usize = 4;

/// Generated rooms as a dataset: made on demand, nothing on disk. The photos of a room are a [block](Dataset::block).
#[derive(Debug)]
pub struct GeneratedDataset {
    generator: Generator,
    scenes: u32,
    /// The last rooms, newest first.
    cached: Mutex<VecDeque<(u64, Arc<Record>)>>,
}

impl GeneratedDataset {
    /// Creates a dataset of a generator's first `scenes` rooms. `u32::MAX` is practically endless.
    pub fn new(generator: Generator, scenes: u32) -> Self {
        Self { generator, scenes, cached: Mutex::default() }
    }

    fn room(&self, index: u64) -> Result<Arc<Record>, DatasetError> {
        let cached = |rooms: &VecDeque<(u64, Arc<Record>)>| {
            rooms.iter().find(|(number, _)| *number == index).map(|(_, record)| Arc::clone(record))
        };
        if let Some(record) = cached(&self.cached.lock().unwrap_or_else(PoisonError::into_inner)) {
            return Ok(record);
        }
        // Generated without the lock, so that other threads generate other rooms meanwhile.
        let record = Arc::new(self.generator.record(index)?);
        let mut rooms = self.cached.lock().unwrap_or_else(PoisonError::into_inner);
        rooms.push_front((index, Arc::clone(&record)));
        rooms.truncate(CACHED_ROOMS);
        Ok(record)
    }
}

impl Dataset for GeneratedDataset {
    fn len(&self) -> usize {
        self.scenes as usize * self.block()
    }

    fn scene_id(&self, index: usize) -> Cow<'_, str> {
        self.generator.scene_id((index / self.block()) as u64).into()
    }

    fn get(&self, index: usize) -> Result<Sample, DatasetError> {
        if index >= self.len() {
            return Err(DatasetError::Index { index, len: self.len() });
        }
        Ok(self.room((index / self.block()) as u64)?.sample(index % self.block()))
    }

    fn block(&self) -> usize {
        self.generator.config().shots as usize
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lo_synth::SynthConfig;

    use crate::{GeneratorConfig, Shards, Shot, write_shard};

    fn small() -> Generator {
        let room = SynthConfig { crop_size: [96, 64], ..SynthConfig::default() };
        let config = GeneratorConfig {
            room,
            shots: 2,
            panoramas: 3,
            panorama_height: 16,
            octree_depth: 6,
            ..Default::default()
        };
        Generator::new(11, config).unwrap()
    }

    #[test]
    fn rooms_hold_what_was_asked_for_in_consistent_units_and_frames() {
        let record = small().record(3).unwrap();
        assert_eq!((record.key.as_str(), record.shots.len()), ("synth-11-000003", 2));
        assert!((1..=3).contains(&record.views.len()));
        let sample = record.sample(0);
        let (radiance, depth) = (sample.radiance.as_ref().unwrap(), sample.depth_m.as_ref().unwrap());
        assert!(radiance.pixels().iter().flatten().all(|v| v.is_finite() && *v >= 0.0));
        // Surface points observed by the photo have the radiance of its pixels: median over the points.
        let mut ratios = Vec::new();
        for point in &sample.points {
            let Some((u, v, z)) = sample.camera.project(point.position_m) else { continue };
            if u < 0.0 || v < 0.0 || u >= 96.0 || v >= 64.0 {
                continue;
            }
            let at = (u as usize, v as usize);
            if (f64::from(depth[at]) - z).abs() < 0.03 && point.radiance[1] > 0.0 && radiance[at][1] > 0.0 {
                ratios.push(point.radiance[1] / radiance[at][1]);
            }
        }
        ratios.sort_unstable_by(f32::total_cmp);
        let median = ratios[ratios.len() / 2];
        assert!(ratios.len() > 500 && (0.8..1.25).contains(&median), "{} points, median {median}", ratios.len());
        // Every panorama of a photo is in its frustum.
        for view in &sample.views {
            let (u, v, z) = sample.camera.project(view.position_m).unwrap();
            assert!((0.0..96.0).contains(&u) && (0.0..64.0).contains(&v) && z < 12.0);
        }
        assert!(sample.metadata.contains_key("room") && sample.metadata.contains_key("depth_sensor"));
    }

    #[test]
    fn upright_and_level_photos_lie_in_one_shard() {
        let mut config = small().config().clone();
        config.shots = 6;
        config.room.upright_share = 0.5;
        config.room.close_up_share = 0.5;
        config.photo.phone.share = 1.0;
        let record = Generator::new(11, config).unwrap().record(1).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tar");
        write_shard(&path, [Ok::<_, DatasetError>(record.clone())].into_iter(), "tests").unwrap();
        let shards = Shards::open(&path).unwrap();
        let mut sizes = Vec::new();
        for (k, shot) in record.shots.iter().enumerate() {
            let sample = shards.get(k).unwrap();
            let size = (sample.photo.width(), sample.photo.height());
            assert_eq!((sample.camera, &sample.photo), (shot.camera, &shot.photo));
            let depth = sample.depth_m.as_ref().unwrap();
            assert_eq!((depth.width(), depth.height()), size);
            assert!(sample.metadata["photo"]["phone"]["denoising"].is_number());
            sizes.push(size);
        }
        sizes.sort_unstable();
        sizes.dedup();
        assert_eq!(sizes, [(64, 96), (96, 64)]);
    }

    #[test]
    fn a_flash_lights_the_photo_and_nothing_else() {
        let record = |flash_share: f32| {
            let mut config = small().config().clone();
            config.room.dim_share = 1.0;
            config.photo.flash_share = flash_share;
            Generator::new(11, config).unwrap().record(2).unwrap()
        };
        let (dark, lit) = (record(0.0), record(1.0));
        assert_eq!((&dark.views, &dark.points), (&lit.views, &lit.points));
        for (dark, lit) in dark.shots.iter().zip(&lit.shots) {
            let intensity_cd = lit.metadata["photo"]["flash_cd"].as_f64().unwrap() as f32;
            assert!(dark.metadata["photo"].get("flash_cd").is_none() && dark.depth_m == lit.depth_m);
            // In units of the room: the flash adds E ρ / π where the photo sees a matte surface perpendicularly.
            let added = |x: usize, y: usize| {
                let light = |shot: &Shot| shot.radiance.as_ref().unwrap()[(x, y)][1] / shot.gains[1];
                light(lit) - light(dark)
            };
            let (depth, albedo) = (lit.depth_m.as_ref().unwrap(), lit.albedo.as_ref().unwrap());
            let mut right = 0;
            for (x, y) in (8..88).flat_map(|x| (8..56).map(move |y| (x, y))) {
                let direction = lit.camera.direction(x as f64 + 0.5, y as f64 + 0.5);
                let normal = lo_geometry::Vec3::from_array(lit.normal.as_ref().unwrap()[(x, y)]);
                let squared = (depth[(x, y)] / direction.z).powi(2);
                let lux = intensity_cd * direction.z.powi(2) * -direction.dot(normal) / squared;
                let expected = lux * albedo[(x, y)][1] / std::f32::consts::PI / lo_synth::UNIT_CD_M2;
                right += usize::from((added(x, y) / expected - 1.0).abs() < 0.02);
            }
            // All except mirrors, panes, and dark rims where differences of floats are coarse.
            assert!(right > 80 * 48 / 2, "{right}");
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, threads: usize| {
            let path = folder.path().join(name);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| write_shard(&path, [small().record(1)].into_iter(), "tests")).unwrap();
            std::fs::read(path).unwrap()
        };
        let one = write("a.tar", 1);
        assert!(one == write("b.tar", 3), "bytes differ");
        let shards = Shards::open(&folder.path().join("a.tar")).unwrap();
        assert_eq!(shards.len(), 2);
        assert_eq!(shards.get(1).unwrap().id, "synth-11-000001-1");
    }

    #[test]
    fn a_dataset_makes_each_room_once_for_all_its_photos() {
        let dataset = GeneratedDataset::new(small(), 5);
        assert_eq!((dataset.len(), dataset.block()), (10, 2));
        assert_eq!(dataset.scene_id(9), "synth-11-000004");
        let (a, b) = (dataset.get(2).unwrap(), dataset.get(3).unwrap());
        assert_eq!(dataset.cached.lock().unwrap().len(), 1);
        assert!(a.id != b.id && a.scene_id == b.scene_id);
        assert!(matches!(dataset.get(10), Err(DatasetError::Index { index: 10, len: 10 })));
    }
}
