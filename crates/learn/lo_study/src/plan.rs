//! Plan of a study: rooms, paths, pairs and sides.

use lo_dataset::Generator;
use lo_eval::{InsertionMethod, LevelSurfaces};
use lo_events::{OnEvent, Steps};
use lo_geometry::Vec3;
use lo_mesh::PreparedModel;
use lo_random::RngExt;
use lo_random::seq::SliceRandom;

use crate::config::{Methods, REFERENCE};
use crate::path::{Extent, ObjectPath};
use crate::{Key, Pair, Side, StudyConfig, StudyError, Video, stages};

/// Largest number of rooms to try per room of the study.
const MAX_TRIED_PER_ROOM: u64 = 16;

/// A planned study.
pub struct Study<'a> {
    pub(crate) config: StudyConfig,
    pub(crate) methods: Methods,
    pub(crate) generator: Generator,
    pub(crate) objects: [&'a PreparedModel; 2],
    pub(crate) rooms: Vec<PlannedRoom>,
    key: Key,
}

/// A room of a study.
#[derive(Debug)]
pub(crate) struct PlannedRoom {
    /// Number of the room in the generator.
    pub index: u64,
    pub id: String,
    pub path: ObjectPath,
}

impl<'a> Study<'a> {
    /// Plans a study: finds rooms with a path, and assigns methods to sides.
    ///
    /// `objects` are the configuration's mesh in both materials. `networks` identifies the weights, so that studies of
    /// other weights have another identifier. Equal arguments give equal studies.
    ///
    /// `None` if the handler cancels.
    ///
    /// # Errors
    /// Invalid configurations; rooms that cannot be generated; too few rooms with a path.
    pub fn plan(
        config: StudyConfig,
        seed: u64,
        objects: [&'a PreparedModel; 2],
        networks: &str,
        on_event: OnEvent<'_>,
    ) -> Result<Option<Self>, StudyError> {
        config.validate()?;
        let methods = config.methods()?;
        let generator = Generator::new(seed, config.generator.clone())?;
        let Some(rooms) = find_rooms(&config, seed, &generator, objects[0], on_event)? else { return Ok(None) };
        let room_ids: Vec<&str> = rooms.iter().map(|room| room.id.as_str()).collect();
        let key = key(&study_id(&config, seed, objects[0], networks, &rooms), &methods, &room_ids, seed);
        Ok(Some(Self { config, methods, generator, objects, rooms, key }))
    }

    /// Returns the key.
    pub fn key(&self) -> &Key {
        &self.key
    }
}

/// Finds the first rooms of a generator whose photo shows a path; `None` if the handler cancels.
fn find_rooms(
    config: &StudyConfig,
    seed: u64,
    generator: &Generator,
    object: &PreparedModel,
    on_event: OnEvent<'_>,
) -> Result<Option<Vec<PlannedRoom>>, StudyError> {
    let (wanted, extent) = (config.rooms as usize, Extent::new(object));
    let (mut rooms, mut index) = (Vec::new(), 0);
    let mut steps = Steps::begin(on_event, stages::FIND_PATHS, wanted);
    while rooms.len() < wanted && index < MAX_TRIED_PER_ROOM * wanted as u64 {
        if steps.cancelled() {
            return Ok(None);
        }
        let interior = generator.interior(index)?;
        let view = interior.camera_poses(1)[0];
        let model = PreparedModel::new(interior.world.model.clone());
        let surfaces = LevelSurfaces { interior: &interior, model: &model, view: &view };
        let mut random = lo_random::stream(seed, "study paths", index);
        if let Some(path) = ObjectPath::find(&surfaces, &extent, config.object_size, &mut random) {
            rooms.push(PlannedRoom { index, id: interior.id, path });
            steps.step();
        }
        index += 1;
    }
    steps.end();
    let found = rooms.len();
    if found < wanted { Err(StudyError::TooFewRooms { found, tried: index, wanted }) } else { Ok(Some(rooms)) }
}

/// Returns an identifier of everything that the videos depend on.
fn study_id(config: &StudyConfig, seed: u64, object: &PreparedModel, networks: &str, rooms: &[PlannedRoom]) -> String {
    // Of the mesh file, its contents count and not its name.
    let config = StudyConfig { mesh: String::new(), ..config.clone() };
    let coordinates = object.model().positions.iter().flat_map(Vec3::to_array).flat_map(f32::to_le_bytes);
    let mesh = lo_random::hash(&coordinates.collect::<Vec<u8>>());
    let version = env!("CARGO_PKG_VERSION");
    let config = serde_json::to_string(&config).expect("serialising numbers and strings cannot fail");
    hexadecimal(&format!("{version} {seed} {mesh} {networks} {config} {rooms:?}"))
}

fn hexadecimal(text: &str) -> String {
    format!("{:016x}", lo_random::hash(text.as_bytes()))
}

/// Assigns methods to sides and numbers to pairs, both at random.
fn key(study: &str, methods: &Methods, rooms: &[&str], seed: u64) -> Key {
    let video = |room: &str, method: InsertionMethod| hexadecimal(&format!("{study} {room} {}", method.name()));
    let mut pairs = Vec::new();
    for (number, &other) in methods.others.iter().enumerate() {
        for (&room, ours) in rooms.iter().zip(balanced_sides(rooms.len(), seed, number as u64)) {
            let [mut left, mut right] = [methods.ours, other].map(|method| video(room, method));
            if ours == Side::Right {
                std::mem::swap(&mut left, &mut right);
            }
            let (room, other) = (room.to_owned(), other.name().to_owned());
            pairs.push(Pair { id: String::new(), middle: video(&room, REFERENCE), room, other, ours, left, right });
        }
    }
    // Numbers reveal neither room nor method.
    pairs.shuffle(&mut lo_random::stream(seed, "study pairs", 0));
    let digits = pairs.len().to_string().len();
    pairs.iter_mut().zip(1..).for_each(|(pair, number)| pair.id = format!("{number:0digits$}"));
    let videos = rooms.iter().flat_map(|&room| {
        let of_method = move |method: InsertionMethod| Video {
            id: video(room, method),
            room: room.to_owned(),
            method: method.name().to_owned(),
        };
        methods.all().map(of_method).collect::<Vec<_>>()
    });
    Key {
        study: study.to_owned(),
        ours: methods.ours.name().to_owned(),
        others: methods.others.iter().map(|method| method.name().to_owned()).collect(),
        reference: REFERENCE.name().to_owned(),
        videos: videos.collect(),
        pairs,
    }
}

/// Returns the side of our method in each room: as often left as right, up to one, in random order.
fn balanced_sides(rooms: usize, seed: u64, other: u64) -> Vec<Side> {
    let mut random = lo_random::stream(seed, "study sides", other);
    let first = usize::from(random.random::<bool>());
    let mut sides: Vec<Side> =
        (0..rooms).map(|i| if (i + first).is_multiple_of(2) { Side::Left } else { Side::Right }).collect();
    sides.shuffle(&mut random);
    sides
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::collections::BTreeSet;

    use super::*;

    fn example(seed: u64) -> Key {
        let rooms: Vec<String> = (0..8).map(|i| format!("room-{i}")).collect();
        let methods = StudyConfig::default().methods().unwrap();
        key("study", &methods, &rooms.iter().map(String::as_str).collect::<Vec<_>>(), seed)
    }

    #[test]
    fn every_method_is_compared_in_every_room_on_balanced_sides() {
        let key = example(3);
        assert_eq!((key.pairs.len(), key.videos.len()), (3 * 8, 5 * 8));
        assert_eq!((key.pairs[0].id.as_str(), key.pairs[23].id.as_str()), ("01", "24"));
        for other in &key.others {
            let pairs: Vec<&Pair> = key.pairs.iter().filter(|pair| pair.other == *other).collect();
            let rooms: BTreeSet<&str> = pairs.iter().map(|pair| pair.room.as_str()).collect();
            assert_eq!((pairs.len(), rooms.len()), (8, 8));
            assert_eq!(pairs.iter().filter(|pair| pair.ours == Side::Left).count(), 4, "{other}");
        }
        let method = |id: &str| key.videos.iter().find(|video| video.id == id).unwrap();
        for pair in &key.pairs {
            let shown = [&pair.left, &pair.middle, &pair.right].map(|id| method(id));
            assert!(shown.iter().all(|video| video.room == pair.room));
            let [left, middle, right] = shown.map(|video| video.method.as_str());
            let expected = match pair.ours {
                Side::Left => ["fitted", "true-octree", &pair.other],
                Side::Right => [&pair.other, "true-octree", "fitted"],
            };
            assert_eq!([left, middle, right], expected);
        }
    }

    #[test]
    fn the_seed_decides_sides_and_numbers() {
        assert_eq!(example(3), example(3));
        let sides = |seed| example(seed).pairs.iter().map(|pair| pair.ours).collect::<Vec<_>>();
        assert!(sides(3) != sides(4));
        // An odd number of rooms has one more on a random side.
        let lefts = (0..64).map(|seed| balanced_sides(3, seed, 0).iter().filter(|side| **side == Side::Left).count());
        let counts: BTreeSet<usize> = lefts.collect();
        assert_eq!(counts, BTreeSet::from([1, 2]));
    }
}
