//! Scenes by the networks: photo → depth and global light → what is seen, as an octree → the octree of the whole room.

use completion::{Enclosure, ShellOptions, filled_note};
use geometry::{Camera, Cube, Vec3};
use imaging::{Image, Photo, srgb8_from_linear};
use nets::light::VisiblePoint;
use nets::{CompletedLight, Networks};
use scene::{Frame, Room, Surfel, place_cube, working_photo};

use crate::estimate::{Completed, EstimateError, EstimateOptions, View};
use crate::message::{Message, stage};

/// A photo whose depth is the depth network's.
pub(crate) fn predicted_view(
    photo: Photo,
    camera: Camera,
    networks: &Networks,
    messages: &mut dyn FnMut(Message),
) -> Result<View, EstimateError> {
    let small = stage(messages, "working resolution", || working_photo(&photo));
    let (depth_m, global) =
        stage(messages, "depth and global light", || networks.depth_and_light(&srgb8(&small), &camera));
    if !depth_m.pixels().iter().all(|z| z.is_finite()) {
        return Err(EstimateError::PredictedDepth);
    }
    let frame = Frame::new(photo, depth_m, camera, 1.0)?;
    let depth_m = imaging::resize_depth(&frame.depth_m, small.width(), small.height());
    let camera = frame.camera.resized(small.width() as u32, small.height() as u32);
    let working = Frame { camera, photo: small, depth_m, exposure: 1.0 };
    messages(Message::Note(
        "depth is predicted from the photo alone: distances, and with them all sizes, may be off, and which way is up by some degrees".into(),
    ));
    Ok(View { frame, working, global: Some(global) })
}

/// What the light network is told of a frame, in estimation and in training alike.
#[derive(Clone, Debug, PartialEq)]
pub struct SeenFrame {
    /// The camera, in pixels of the working resolution.
    pub camera: Camera,
    /// What is seen where it is seen, one for each depth reading that is none of a flying pixel.
    pub surfels: Vec<Surfel>,
    /// Gravity and the planes around the surfels.
    pub room: Room,
    /// Part of the world that the octree covers.
    pub cube: Cube,
    /// The surfels, and what the photo shows where depth has no reading (windows, lamps, what is shiny, black or too far), with whether the photo
    /// is clipped there. What has no reading lies on the room's planes or continues what is around it. All that is beyond the cube is drawn in to its
    /// side. Normals are zero where no surface could be fitted.
    pub points: Vec<VisiblePoint>,
}

impl SeenFrame {
    /// Of a frame at the [working resolution](Frame::working), with the unit vector against gravity where it is known; `None` where no depth
    /// reading is left.
    pub fn new(working: &Frame, up: Option<Vec3>) -> Option<Self> {
        let clean = working.without_flying_pixels();
        let (normals, radiance, clipped) = (clean.normals(), clean.radiance(), clean.clipped());
        let surfels = clean.surfels_with_normals(&normals, &radiance);
        if surfels.is_empty() {
            return None;
        }
        let positions: Vec<Vec3> = surfels.iter().map(|surfel| surfel.position_m).collect();
        let cube = place_cube(&positions);
        let enclosure = Enclosure::around(&surfels, &ShellOptions { up, ..ShellOptions::default() });
        let complete = working.depth_m.pixels().iter().all(|&z| z > 0.0);
        let filled_m = if complete { clean.depth_m.clone() } else { enclosure.filled_depth_m(&clean) };
        let camera = clean.depth_camera();
        let pixels = (0..filled_m.height()).flat_map(|y| (0..filled_m.width()).map(move |x| (x, y)));
        let points = pixels.filter_map(|at| {
            let read = clean.depth_m[at] > 0.0;
            if !read && working.depth_m[at] > 0.0 {
                return None; // a flying pixel shows two surfaces
            }
            let position_m = camera.unproject(at.0 as f64 + 0.5, at.1 as f64 + 0.5, f64::from(filled_m[at]));
            let normal = if read { normals[at] } else { enclosure.normal_at(position_m) };
            Some(VisiblePoint {
                position_m: cube.pulled_inside(position_m),
                radiance: radiance[at],
                normal: normal.unwrap_or(Vec3::ZERO),
                certain: !clipped[at],
            })
        });
        Some(Self { points: points.collect(), camera: clean.camera, room: enclosure.room(), cube, surfels })
    }
}

/// The room by the light network.
pub(crate) fn complete(
    view: &View,
    networks: &Networks,
    octree_depth: u32,
    options: &EstimateOptions,
    messages: &mut dyn FnMut(Message),
) -> Result<Completed, EstimateError> {
    let global = match &view.global {
        Some(global) => global.clone(),
        None => stage(messages, "global light", || networks.global_light(&srgb8(&view.working.photo))),
    };
    let seen = SeenFrame::new(&view.working, options.up).ok_or(EstimateError::NothingSeen)?;
    let filled = seen.points.len() - seen.surfels.len();
    filled_note(seen.surfels.len(), filled).into_iter().for_each(|note| messages(Message::Note(note)));
    let completed = stage(messages, "light network", || {
        networks.complete(&seen.points, &seen.camera, seen.cube, global, octree_depth, options.seed)
    })?;
    let CompletedLight { light, confidence, messages: notes } = completed;
    notes.into_iter().for_each(|note| messages(Message::Note(note)));
    let confidence = confidence.into_iter().map(|level| level.into_iter().map(|c| (255.0 * c).round() as u8).collect());
    Ok(Completed { light, room: Some(seen.room), confidence: Some(confidence.collect()) })
}

fn srgb8(photo: &Photo) -> Image<[u8; 3]> {
    match photo {
        Photo::Srgb8(image) => image.clone(),
        Photo::Linear(image) => image.map(|rgb| rgb.map(srgb8_from_linear)),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use cone::ConeTracer;
    use imaging::DepthMap;
    use nets::Device;
    use nets::checkpoint::Checkpoint;
    use nets::light::LightNetConfig;
    use scene::{Completion, Scene};

    use super::*;
    use crate::{Input, add_lamp, estimate};

    const SIZE: (usize, usize) = (96, 64);

    fn config() -> LightNetConfig {
        let small = LightNetConfig { depth: 6, full_depth: 3, channels: 8, max_channels: 16, ..Default::default() };
        LightNetConfig { blocks: 1, bottleneck: 2, head_channels: 8, global_features: 6, global_channels: 2, ..small }
    }

    /// Untrained networks, in which some values are others.
    fn networks(config: &LightNetConfig, others: &[(&str, &[usize], f32)]) -> Networks {
        let mut checkpoint = Checkpoint::default();
        Networks::new(config, 5, &Device::flex()).unwrap().add_to(&mut checkpoint);
        for (name, shape, value) in others {
            checkpoint.insert(name, shape, vec![*value; shape.iter().product()]);
        }
        Networks::from_checkpoint(checkpoint, &Device::flex()).unwrap()
    }

    /// A wall two metres away: dark on the left, bright on the right, with a clipped square in the middle.
    fn photo() -> Photo {
        let clipped = |x: usize, y: usize| (40..56).contains(&x) && (24..40).contains(&y);
        Photo::Srgb8(Image::from_fn(SIZE.0, SIZE.1, |x, y| match x {
            _ if clipped(x, y) => [255; 3],
            0..48 => [60, 50, 40],
            _ => [128, 140, 150],
        }))
    }

    fn camera() -> Camera {
        Camera::from_hfov_deg(65.0, SIZE.0 as u32, SIZE.1 as u32).unwrap()
    }

    fn wall() -> Frame {
        Frame::new(photo(), DepthMap::new(SIZE.0, SIZE.1, vec![2.0; SIZE.0 * SIZE.1]), camera(), 1.0).unwrap()
    }

    fn alone() -> Input {
        Input::Photo { photo: photo(), camera: camera() }
    }

    fn options() -> EstimateOptions {
        EstimateOptions { completion: Completion::Network, ..EstimateOptions::default() }
    }

    fn estimated(frame: Frame, networks: &Networks) -> (Scene, Vec<Message>) {
        let mut messages = Vec::new();
        let hear = &mut |message| messages.push(message);
        (estimate(frame, Some(networks), &options(), hear).unwrap(), messages)
    }

    /// From the camera, the wall is where it is and as the photo shows it at these pixels.
    fn assert_seen(scene: &Scene, pixels: &[(usize, usize)]) {
        let view = ConeTracer::new(&scene.light, cone::Settings::default()).unwrap().perspective(&camera());
        let (wall, radiance) = (wall(), scene.frame.radiance());
        for &(x, y) in pixels {
            let (got, expected) = (view.radiance[(x, y)], radiance[(x, y)]);
            assert!(
                got.iter().zip(expected).all(|(a, b)| (a / b - 1.0).abs() < 2e-3),
                "{x}, {y}: {got:?} {expected:?}"
            );
            assert!((view.distance_m[(x, y)] / wall.point(x, y).unwrap().length() - 1.0).abs() < 0.1);
        }
    }

    #[test]
    fn what_the_photo_saw_is_in_the_scene() {
        // Weights that want to change everything.
        let (scene, messages) =
            estimated(wall(), &networks(&config(), &[("light_net.regression.3.output.weights", &[8, 8], 0.5)]));
        let frame = &scene.frame;
        assert_eq!((&frame.photo, scene.completion, scene.light.octree.depth()), (&photo(), Completion::Network, 7));
        // A leaf is 6 cm: four pixels.
        assert_seen(&scene, &[(10, 10), (20, 50), (30, 20), (70, 12), (85, 55)]);
        let (seen, confidence) = (scene.light.seen.last().unwrap(), scene.confidence.as_ref().unwrap());
        assert!(seen.contains(&255) && seen.contains(&0), "seen, and clipped");
        assert!(!scene.predicted_depth && confidence.iter().map(Vec::len).eq(scene.light.rgba.iter().map(Vec::len)));
        let stages = messages.iter().filter(|message| matches!(message, Message::Stage { .. })).count();
        assert_eq!(stages, 3);
        assert!((scene.room.as_ref().unwrap().up.y - 1.0).abs() < 0.1);
        assert_eq!(Scene::from_bytes(&scene.to_bytes().unwrap()).unwrap(), scene);
    }

    #[test]
    fn a_window_without_depth_readings_lies_in_the_wall() {
        let window = |x: usize, y: usize| (60..88).contains(&x) && (10..54).contains(&y);
        let depth_m = DepthMap::from_fn(SIZE.0, SIZE.1, |x, y| if window(x, y) { 0.0 } else { 2.0 });
        let frame = Frame::new(photo(), depth_m, camera(), 1.0).unwrap();
        let (scene, messages) = estimated(frame, &networks(&config(), &[]));
        assert_seen(&scene, &[(10, 10), (64, 14), (74, 32), (84, 50)]);
        assert!(messages.iter().any(|message| matches!(message, Message::Note(note) if note.contains("20 %"))));
    }

    #[test]
    fn objects_get_a_lamp_where_what_is_seen_asks_for_one() {
        // Weights that make what is not seen dark, in both guesses.
        let others: [(&str, &[usize], f32); 2] =
            [("light_net.regression.3.output.bias", &[1, 8], -4.0), ("depth_net.panorama.output.bias", &[3], -9.0)];
        let dark = networks(&config(), &others);
        let (mut scene, _) = estimated(wall(), &dark);
        let before = scene.clone();
        let report = add_lamp(&mut scene);
        assert!(report.lamp_radiance > 0.0 && scene.light != before.light, "{report:?}");
        let darker = |(a, b): (&[f32; 4], &[f32; 4])| (0..3).any(|c| a[c] < b[c]) || a[3] != b[3];
        assert!(!scene.light.rgba.iter().flatten().zip(before.light.rgba.iter().flatten()).any(darker));
        let mut shell = estimate(wall(), None, &EstimateOptions::default(), &mut |_| ()).unwrap();
        let before = shell.clone();
        assert_eq!((add_lamp(&mut shell).lamp_radiance, shell), (0.0, before));
    }

    #[test]
    fn the_same_photo_gives_the_same_bytes_on_any_number_of_threads() {
        // Untrained heads give the same whatever they are given.
        let networks = networks(&config(), &[("light_net.regression.3.output.weights", &[8, 8], 0.1)]);
        let run = |threads, seed| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let options = EstimateOptions { seed, ..options() };
            let bytes = |input| estimate(input, Some(&networks), &options, &mut |_| ()).unwrap().to_bytes().unwrap();
            pool.install(|| [bytes(wall().into()), bytes(alone())])
        };
        let first = run(2, 1);
        assert!(first == run(2, 1) && first == run(1, 1) && first == run(3, 1));
        assert!(first[0] != run(2, 2)[0]);
    }

    #[test]
    fn a_photo_alone_gets_its_depth() {
        let mut messages = Vec::new();
        let networks = networks(&config(), &[]);
        let hear = &mut |message| messages.push(message);
        let scene = estimate(alone(), Some(&networks), &options(), hear).unwrap();
        let depth_m = &scene.frame.depth_m;
        assert_eq!((depth_m.width(), depth_m.height()), SIZE);
        assert!(scene.predicted_depth && scene.confidence.is_some());
        // Completion does not ask where depth comes from.
        let shell = estimate(alone(), Some(&networks), &EstimateOptions::default(), &mut |_| ()).unwrap();
        assert_eq!((&shell.frame, shell.completion, shell.predicted_depth), (&scene.frame, Completion::Shell, true));
        assert_eq!((shell.light.octree.depth(), shell.confidence), (7, None));
        assert!(messages.iter().any(|message| matches!(message, Message::Note(note) if note.contains("predicted"))));
        // Of the ways to hold a camera.
        let up = scene.room.as_ref().unwrap().up;
        assert!(up.y > 0.7 && up.x.abs() < 0.12, "{up}");
    }

    #[test]
    fn trees_stay_within_the_budget_and_say_so() {
        let config = LightNetConfig { max_nodes: Some(2000), ..config() };
        let split = |stage| format!("light_net.prediction.{stage}.output.bias");
        let names: Vec<String> = (0..4).map(split).collect();
        let all: Vec<(&str, &[usize], f32)> = names.iter().map(|name| (&name[..], &[1, 1][..], 5.0)).collect();
        let (scene, messages) = estimated(wall(), &networks(&config, &all));
        assert!(scene.light.octree.levels()[6].len() < 2000 * 8);
        assert!(messages.iter().any(|message| matches!(message, Message::Note(note) if note.contains("node budget"))));
    }

    #[test]
    fn networks_that_do_not_fit_are_errors() {
        let error = |input: Input, networks: &Networks, options: &EstimateOptions| {
            estimate(input, Some(networks), options, &mut |_| ()).unwrap_err()
        };
        let light = networks(&config(), &[("light_net.global.weights", &[6, 2], f32::NAN)]);
        let light = error(wall().into(), &light, &options());
        assert!(matches!(light, EstimateError::Light(_)) && light.to_string().contains("not finite"), "{light}");
        let depth = networks(&config(), &[("depth_net.decoder.output.bias", &[1], f32::NAN)]);
        let depth = error(alone(), &depth, &options());
        assert!(matches!(depth, EstimateError::PredictedDepth), "{depth}");
        let shallow = EstimateOptions { octree_depth: Some(5), ..options() };
        let shallow = error(wall().into(), &networks(&config(), &[]), &shallow);
        assert!(matches!(shallow, EstimateError::OctreeDepth { asked: 5, own: 6 }), "{shallow}");
        let deep = EstimateOptions { octree_depth: Some(40), ..options() };
        let deep = error(wall().into(), &networks(&config(), &[]), &deep);
        assert!(matches!(deep, EstimateError::Octree(_)), "{deep}");
    }
}
