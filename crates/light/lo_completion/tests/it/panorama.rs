//! A panorama of a room whose radiance is known in closed form.

use lo_completion::{
    ApplyPanoramaError, MIN_CONFIDENCE, PanoramaError, PanoramaMatch, PanoramaPrior, PanoramaWarning, apply_panorama,
    match_panorama,
};
use lo_cone::{ConeTracer, Settings};
use lo_geometry::{
    Camera, Cube, Mat3, Orientation, Ray, RigidTransform, Vec2, Vec3, direction_from_uv, pixel_solid_angle_sr,
};
use lo_imaging::{DepthMap, Image, Photo, RadianceImage, luminance, view_rotation};
use lo_octree::{LightOctree, Provenance, RadiancePoint};
use lo_scene::{Frame, ObservedPhoto};

/// The room: 4 m × 2.6 m × 5 m around the camera.
const LOW: Vec3 = Vec3::new(-1.7, -1.3, -3.1);
const HIGH: Vec3 = Vec3::new(2.3, 1.3, 1.9);

/// A lamp on the ceiling: 40 × 60 cm, behind the camera's view.
const LAMP: [Vec2; 2] = [Vec2::new(0.4, 0.5), Vec2::new(0.8, 1.1)];

/// Position at which the panorama is taken.
const PLACE: Vec3 = Vec3::new(0.3, 0.1, -0.6);

fn observed(frame: &Frame) -> ObservedPhoto {
    ObservedPhoto::new(frame, RigidTransform::IDENTITY)
}

/// Returns the point at which a ray from inside hits the walls.
fn hit(origin: Vec3, direction: Vec3) -> Vec3 {
    let (_, far) = Cube { origin_m: Vec3::ZERO, edge_m: 1.0 }
        .intersect(&Ray { origin: (origin - LOW) / (HIGH - LOW), direction: direction / (HIGH - LOW) })
        .unwrap();
    origin + far * direction
}

/// Returns the radiance of the walls of a room with this lamp: patterns, stripes and colours that differ by room.
fn wall(point: Vec3, room: f32, lamp: f32) -> [f32; 3] {
    let on = Vec2::new(point.x, point.z);
    if point.y > HIGH.y - 1e-3 && on.cmpge(LAMP[0]).all() && on.cmple(LAMP[1]).all() {
        return [lamp; 3];
    }
    let s = |k: Vec3, phase: f32| (k.dot(point) + phase + room * 1.7).sin();
    let brightness = 0.12
        * (0.9 * s(Vec3::new(1.1, 2.3, 0.7), 0.3 + room)
            + 0.7 * s(Vec3::new(-2.1 + 0.3 * room, 1.4, 3.0), 2.0)
            + 0.8 * s(Vec3::new(4.7, 0.6 * room, -2.2), 1.0))
        .exp();
    let warm = 0.25 * s(Vec3::new(1.9, 0.4, 1.3 + 0.2 * room), 5.0);
    [brightness * (1.0 + warm), brightness, brightness * (1.0 - warm)]
}

/// Renders the panorama, with directions rotated to the room's by `world_from_panorama`: mean over 3 × 3 samples per
/// pixel.
fn panorama(
    place: Vec3,
    world_from_panorama: Mat3,
    width: usize,
    radiance: impl Fn(Vec3) -> [f32; 3],
) -> RadianceImage {
    let height = width / 2;
    RadianceImage::from_fn(width, height, |x, y| {
        let mut sum = [0.0; 3];
        for (i, j) in (0..9).map(|n| ((n % 3) as f32, (n / 3) as f32)) {
            let uv =
                Vec2::new((x as f32 + (i + 0.5) / 3.0) / width as f32, (y as f32 + (j + 0.5) / 3.0) / height as f32);
            let value = radiance(hit(place, world_from_panorama * direction_from_uv(uv)));
            (0..3).for_each(|c| sum[c] += value[c] / 9.0);
        }
        sum
    })
}

/// Renders the camera's view of the room as an HDR photo with depth.
fn frame(room: f32) -> Frame {
    let camera = Camera::from_hfov_deg(75.0, 240, 180).unwrap();
    let at = |x: usize, y: usize| hit(Vec3::ZERO, camera.direction(x as f64 + 0.5, y as f64 + 0.5));
    let photo = Image::from_fn(240, 180, |x, y| wall(at(x, y), room, 0.0));
    let depth_m = DepthMap::from_fn(240, 180, |x, y| -at(x, y).z);
    Frame::new(Photo::Linear(photo), depth_m, camera, 1.0).unwrap()
}

/// Creates the room with observed surfaces as in the frame and everything else grey; its walls are three leaves thick.
fn inferred(frame: &Frame, depth: u32) -> LightOctree {
    let seen = frame.surfels(&frame.radiance());
    let mut points: Vec<RadiancePoint> = seen.into_iter().map(RadiancePoint::from).collect();
    let cube = Cube::centred(0.5 * (LOW + HIGH), 5.5);
    let leaf = cube.node_edge_m(depth);
    for layer in 0..3 {
        let out = Vec3::splat(leaf * layer as f32);
        let (low, high) = (LOW - out, HIGH + out);
        for face in 0..6 {
            let steps = (5.5 / (0.45 * leaf)) as usize;
            for (i, j) in (0..steps * steps).map(|n| (n % steps, n / steps)) {
                let mut unit = [(i as f32 + 0.5) / steps as f32, (j as f32 + 0.5) / steps as f32, (face % 2) as f32];
                unit.rotate_right(face / 2);
                let position_m = low + (high - low) * Vec3::from(unit);
                let hidden =
                    frame.camera.project(position_m).is_some_and(|(u, v, z)| z > 0.0 && frame.camera.contains(u, v));
                if !hidden || layer > 0 {
                    points.push(RadiancePoint { position_m, radiance: [0.05; 3], provenance: Provenance::Inferred });
                }
            }
        }
    }
    LightOctree::from_points(&points, cube, depth, 3).unwrap().0
}

fn prior(image: RadianceImage) -> PanoramaPrior {
    PanoramaPrior::new(image, Orientation::Lightoctree, "room.hdr").unwrap().at(PLACE)
}

fn with_hints(mut prior: PanoramaPrior, yaw_rad: Option<f32>, exposure: Option<f32>) -> PanoramaPrior {
    (prior.yaw_rad, prior.exposure) = (yaw_rad, exposure);
    prior
}

/// Returns the true alignment.
fn upright(exposure: f32) -> PanoramaMatch {
    PanoramaMatch {
        world_from_panorama: Mat3::IDENTITY,
        yaw_rad: 0.0,
        pitch_rad: 0.0,
        roll_rad: 0.0,
        exposure,
        confidence: 0.9,
        compared: true,
    }
}

fn flux(map: &RadianceImage, wanted: impl Fn(usize) -> bool) -> f64 {
    let (width, height) = (map.width(), map.height());
    let pixels = map.pixels().iter().enumerate().filter(|(index, _)| wanted(*index));
    pixels.map(|(index, &rgb)| f64::from(luminance(rgb) * pixel_solid_angle_sr(index / width, width, height))).sum()
}

fn seen_from(light: &LightOctree, place: Vec3, width: usize) -> RadianceImage {
    ConeTracer::new(light, Settings::default()).unwrap().panorama(place, width, width / 2).radiance
}

#[test]
fn the_room_sends_what_the_panorama_shows_and_lamps_keep_their_peaks() {
    let frame = frame(1.0);
    let before = inferred(&frame, 7);
    // In its own units, four times as bright as the photo.
    let image = panorama(PLACE, Mat3::IDENTITY, 1024, |p| wall(p, 1.0, 10_000.0).map(|c| 4.0 * c));
    let mut light = before.clone();
    let begun = std::time::Instant::now();
    let report = apply_panorama(&mut light, None, &prior(image), &upright(0.25), &observed(&frame)).unwrap();
    eprintln!(
        "applied in {:?}: {} leaves, {} split, {} at the side, lamps × {}, of {}",
        begun.elapsed(),
        report.leaves,
        report.split,
        report.added,
        report.lamp_factor,
        before.leaves().count()
    );
    assert_eq!(report.added, 0);
    // The lamp's peak: leaves of 2 cm are entirely on it. It includes the factor that keeps its flux exact.
    let peak = light.rgba.iter().flatten().map(|rgba| rgba[0]).fold(0.0, f32::max);
    assert!((peak / 10_000.0 - 1.0).abs() < 0.05, "{peak}");
    // Total flux at the panorama's position within 1 %, for the lamp and for the rest; the lamp against Lambert's
    // formula for a rectangle.
    let truth = panorama(PLACE, Mat3::IDENTITY, 512, |p| wall(p, 1.0, 10_000.0));
    let got = seen_from(&light, PLACE, 512);
    let all = flux(&got, |_| true) / flux(&truth, |_| true);
    let dark = panorama(PLACE, Mat3::IDENTITY, 512, |p| wall(p, 1.0, 0.0));
    let near_lamp: Vec<bool> = (0..512 * 256)
        .map(|i| {
            let p = hit(PLACE, lo_geometry::pixel_direction(i % 512, i / 512, 512, 256));
            p.y > HIGH.y - 1e-3 && (p.x - 0.6).abs() < 0.6 && (p.z - 0.8).abs() < 0.7
        })
        .collect();
    let solid_angle = solid_angle_of_lamp();
    let of_lamp = (flux(&got, |i| near_lamp[i]) - flux(&dark, |i| near_lamp[i])) / (1e4 * solid_angle);
    let rest = flux(&got, |i| !near_lamp[i]) / flux(&dark, |i| !near_lamp[i]);
    eprintln!("all {all:.4}, lamp {of_lamp:.4}, rest {rest:.4}");
    assert!((all - 1.0).abs() < 0.01 && (of_lamp - 1.0).abs() < 0.01 && (rest - 1.0).abs() < 0.01);
    // Radiance observed by the photo is bit-identical.
    same_where_seen(&before, &light);
    // From elsewhere, too, the light is at the right position, which the panorama itself does not show.
    let place = Vec3::new(-0.7, -0.4, 0.7);
    let (got, truth) = (seen_from(&light, place, 256), panorama(place, Mat3::IDENTITY, 256, |p| wall(p, 1.0, 1.0)));
    let there = panorama(PLACE, Mat3::IDENTITY, 256, |p| wall(p, 1.0, 1.0));
    let error = |map: &RadianceImage| {
        let pairs = map.pixels().iter().zip(truth.pixels());
        let sum = pairs.map(|(a, b)| (luminance(*a).min(1.0) - luminance(*b).min(1.0)).powi(2)).sum::<f32>();
        10.0 * (truth.pixels().len() as f32 / sum).log10()
    };
    eprintln!("elsewhere {:.1} dB, the panorama itself {:.1} dB", error(&got), error(&there));
    assert!(error(&got) > 26.0 && error(&got) > error(&there) + 8.0);
    // The shares: none on observed surfaces, all on surfaces that the panorama's position sees.
    assert_eq!(
        report.share.iter().map(Vec::len).collect::<Vec<_>>(),
        light.rgba.iter().map(Vec::len).collect::<Vec<_>>()
    );
    for (depth, row) in light.leaves() {
        assert!(light.seen[depth][row] == 0 || report.share[depth][row] == 0);
    }
    assert!(light.leaves().count() < 4 * before.leaves().count());
}

/// Returns the solid angle in sr of the lamp's rectangle from the panorama's position (van Oosterom and Strackee, as
/// two triangles).
fn solid_angle_of_lamp() -> f64 {
    let corner = |x: f32, z: f32| (Vec3::new(x, HIGH.y, z) - PLACE).as_dvec3();
    let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| corner(LAMP[i].x, LAMP[j].y));
    let triangle = |a: lo_geometry::DVec3, b: lo_geometry::DVec3, c: lo_geometry::DVec3| {
        let (x, y, z) = (a.length(), b.length(), c.length());
        let lower = x * y * z + a.dot(b) * z + a.dot(c) * y + b.dot(c) * x;
        2.0 * (a.dot(b.cross(c)).abs() / lower).atan()
    };
    triangle(a, b, c) + triangle(a, c, d)
}

fn same_where_seen(before: &LightOctree, after: &LightOctree) {
    let mut seen = 0;
    for (depth, level) in before.octree.levels().iter().enumerate() {
        for node in (0..level.len()).filter(|&node| level.rows[node] >= 0 && level.children[node] < 0) {
            let row = level.rows[node] as usize;
            if before.seen[depth][row] > 0 {
                let now = after.row(depth as u32, level.keys[node]).unwrap();
                let bits = |rgba: [f32; 4]| rgba.map(f32::to_bits);
                assert_eq!(bits(before.rgba[depth][row]), bits(after.rgba[depth][now]));
                assert_eq!(before.seen[depth][row], after.seen[depth][now]);
                seen += 1;
            }
        }
    }
    assert!(seen > 1000, "{seen}");
}

#[test]
fn a_lamp_smaller_than_a_leaf_keeps_its_flux() {
    let frame = frame(1.0);
    let mut light = inferred(&frame, 6);
    // One pixel of 0.35°, about 1 cm on the ceiling, with leaves of 4 cm.
    let mut image = panorama(PLACE, Mat3::IDENTITY, 1024, |_| [0.1; 3]);
    let up = (1024 * 3 / 4 + 300) % 1024;
    image[(up, 60)] = [10_000.0; 3];
    let expected = flux(&image, |_| true);
    apply_panorama(&mut light, None, &prior(image), &upright(1.0), &observed(&frame)).unwrap();
    let got = seen_from(&light, PLACE, 512);
    // Without observed surfaces, which have their own light.
    let lamp = flux(&got, |i| luminance(got.pixels()[i]) > 1.0);
    let own = f64::from(1e4 * pixel_solid_angle_sr(60, 1024, 512));
    eprintln!("{lamp} of {own}, all {expected}");
    assert!((lamp / own - 1.0).abs() < 0.35, "{lamp} {own}");
}

#[test]
fn open_rays_end_at_the_cubes_side_and_hidden_leaves_are_scaled() {
    let frame = frame(1.0);
    let seen = frame.surfels(&frame.radiance());
    let points: Vec<RadiancePoint> = seen.into_iter().map(RadiancePoint::from).collect();
    // A box hides its far side from the panorama, and nothing else closes the room.
    let mut all = points.clone();
    for (i, j) in (0..40 * 40).map(|n| (n % 40, n / 40)) {
        for x in [0.0, 0.02, 0.04, 0.06, 0.25] {
            let position_m = Vec3::new(1.0 + x, -0.5 + 0.02 * i as f32, 0.6 + 0.02 * j as f32);
            all.push(RadiancePoint { position_m, radiance: [0.2, 0.1, 0.05], provenance: Provenance::Inferred });
        }
    }
    let cube = Cube::centred(0.5 * (LOW + HIGH), 5.5);
    let before = LightOctree::from_points(&all, cube, 7, 3).unwrap().0;
    let mut light = before.clone();
    let image = panorama(PLACE, Mat3::IDENTITY, 256, |_| [0.4, 0.4, 0.4]);
    let mut confidence: Vec<Vec<u8>> = before.rgba.iter().map(|rows| vec![100; rows.len()]).collect();
    let report =
        apply_panorama(&mut light, Some(&mut confidence), &prior(image), &upright(1.0), &observed(&frame)).unwrap();
    assert!(report.added > 1000, "{}", report.added);
    same_where_seen(&before, &light);
    // 0.4 over the completed radiance, per channel; the blue channel at its bound.
    let expected = [2.0, 4.0, 5.0];
    assert!((0..3).all(|c| (report.unobserved_factor[c] - expected[c]).abs() < 1e-3), "{:?}", report.unobserved_factor);
    let rgba = |x: f32| {
        let (depth, node) = light.locate(Vec3::new(x, 0.0, 1.25), 10).unwrap();
        (
            light.node_rgba(depth, node).unwrap(),
            confidence[depth as usize][light.octree.levels()[depth as usize].rows[node] as usize],
        )
    };
    let close = |a: [f32; 4], b: [f32; 3]| (0..3).all(|c| (a[c] - b[c]).abs() < 1e-4);
    assert!(close(rgba(1.0).0, [0.4; 3]) && rgba(1.0).1 == 230, "{:?}", rgba(1.0));
    assert!(close(rgba(1.25).0, [0.4, 0.4, 0.25]) && rgba(1.25).1 == 100, "{:?}", rgba(1.25));
    // All directions except the photo's have the panorama's light.
    let got = seen_from(&light, PLACE, 128);
    let behind = |i: usize| lo_geometry::pixel_direction(i % 128, i / 128, 128, 64).z > 0.3;
    let full = RadianceImage::new(128, 64, vec![[0.4; 3]; 128 * 64]);
    let share = flux(&got, behind) / flux(&full, behind);
    assert!((share - 1.0).abs() < 0.01, "{share}");
}

#[test]
fn yaw_tilt_and_exposure_are_found_at_the_camera_and_elsewhere() {
    for (room, place) in [(1.0, Vec3::ZERO), (2.0, PLACE), (3.0, Vec3::new(-0.9, 0.5, -1.2))] {
        let frame = frame(room);
        let up = Vec3::Y;
        for (yaw, pitch, roll) in [(0.0f32, 0.0f32, 0.0f32), (100.0, 4.0, -3.0), (-150.0, -5.0, 6.0)] {
            let turn = view_rotation(yaw.to_radians(), pitch.to_radians(), roll.to_radians());
            let image = panorama(place, turn, 512, |p| wall(p, room, 10_000.0).map(|c| 3.0 * c));
            let own = prior(image).at(place);
            let found = match_panorama(&own, &observed(&frame), up);
            let error = found.world_from_panorama * turn.transpose();
            let angle = (0.5 * (error.x_axis.x + error.y_axis.y + error.z_axis.z - 1.0)).clamp(-1.0, 1.0).acos();
            // A texel of the finest image has 1.4°.
            assert!(angle.to_degrees() < 0.7, "{place} {yaw}: {angle} {found:?}");
            assert!((found.exposure * 3.0 - 1.0).abs() < 0.02, "{}", found.exposure);
            assert!(found.confidence > MIN_CONFIDENCE, "{}", found.confidence);
            // A given yaw is used unchanged, and a wrong one is detected.
            let hinted = with_hints(own, Some(1.0 + yaw.to_radians()), Some(0.5));
            let wrong = match_panorama(&hinted, &observed(&frame), up);
            assert_eq!((wrong.pitch_rad, wrong.exposure), (0.0, 0.5));
            assert!(wrong.confidence < MIN_CONFIDENCE, "{}", wrong.confidence);
            // So is another room.
            let other = panorama(place, turn, 512, |p| wall(p, room + 4.3, 10_000.0));
            let other = match_panorama(&prior(other).at(place), &observed(&frame), up);
            assert!(other.confidence < MIN_CONFIDENCE, "{}", other.confidence);
        }
    }
}

#[test]
fn a_tilted_cameras_panorama_is_level_in_the_room() {
    // The room rotated by −20° about the camera's x axis: it looks 20° down, and up leans towards it.
    let tilt = Mat3::from_rotation_x(20f32.to_radians());
    let camera = Camera::from_hfov_deg(75.0, 240, 180).unwrap();
    let world = tilt.transpose();
    let at = |x: usize, y: usize| hit(Vec3::ZERO, world * camera.direction(x as f64 + 0.5, y as f64 + 0.5));
    let photo = Image::from_fn(240, 180, |x, y| wall(at(x, y), 1.0, 0.0));
    let depth_m = DepthMap::from_fn(240, 180, |x, y| -(tilt * at(x, y)).z);
    let frame = Frame::new(Photo::Linear(photo), depth_m, camera, 1.0).unwrap();
    let yaw = view_rotation(0.7, 0.0, 0.0);
    let image = panorama(Vec3::ZERO, yaw, 512, |p| wall(p, 1.0, 5.0));
    let found = match_panorama(&prior(image.clone()).at(Vec3::ZERO), &observed(&frame), tilt * Vec3::Y);
    assert!(
        (found.yaw_rad - 0.7).abs() < 0.01 && found.pitch_rad.abs() < 0.01 && found.roll_rad.abs() < 0.01,
        "{found:?}"
    );
    // With this orientation given, nothing is searched, and the result is the same.
    let hinted = with_hints(prior(image).at(Vec3::ZERO), Some(0.7), None);
    let hinted = match_panorama(&hinted, &observed(&frame), tilt * Vec3::Y);
    assert!((hinted.world_from_panorama * Vec3::NEG_Z - tilt * yaw * Vec3::NEG_Z).length() < 1e-5);
    assert!(hinted.confidence > MIN_CONFIDENCE);
}

#[test]
fn invalid_panoramas_are_rejected_and_bad_values_cleaned() {
    let new = |image: RadianceImage| PanoramaPrior::new(image, Orientation::Lightoctree, "a.hdr");
    let error = new(RadianceImage::new(300, 100, vec![[1.0; 3]; 30_000])).unwrap_err();
    assert_eq!(error.to_string(), "it is 300 × 100 pixels; an equirectangular panorama is twice as wide as high");
    assert!(matches!(new(RadianceImage::new(8, 4, vec![[1.0; 3]; 32])), Err(PanoramaError::Small { .. })));
    assert!(matches!(new(RadianceImage::new(64, 32, vec![[f32::NAN; 3]; 2048])), Err(PanoramaError::Black)));
    let bright = new(RadianceImage::new(64, 32, vec![[1e38, 1.0, 0.0]; 2048])).unwrap_err();
    assert_eq!(bright.to_string(), "its largest value is 1e38; at most 1e12 is accepted");
    let usual = || new(RadianceImage::new(64, 32, vec![[1.0; 3]; 2048])).unwrap();
    assert!(usual().check().is_ok());
    for (wrong, what) in [
        (usual().at(Vec3::new(0.0, 1e30, 0.0)), "its position must be within ± 10000 m"),
        (with_hints(usual(), None, Some(1e30)), "its exposure must be within ± 40 stops"),
        (with_hints(usual(), None, Some(0.0)), "its exposure must be within ± 40 stops"),
        (with_hints(usual(), Some(f32::NAN), None), "its yaw must be within"),
    ] {
        let error = wrong.check().unwrap_err().to_string();
        assert!(error.starts_with(what), "{error}");
    }
    let mut image = RadianceImage::new(64, 32, vec![[1.0; 3]; 2048]);
    image[(3, 4)] = [f32::INFINITY, -1.0, 2.0];
    let mended = new(image).unwrap();
    assert_eq!(mended.radiance()[(3, 4)], [0.0, 0.0, 2.0]);
    assert_eq!(mended.warnings(), [PanoramaWarning::Values { cleaned: 1, pixels: 2048 }]);
    for (bad, name) in [
        (mended.clone().at(Vec3::NAN), "position"),
        (with_hints(mended.clone(), None, Some(0.0)), "exposure"),
        (with_hints(mended.clone(), Some(f32::INFINITY), None), "yaw"),
    ] {
        assert!(bad.check().unwrap_err().to_string().contains(name));
    }
    let frame = frame(1.0);
    let far = mended.at(Vec3::new(0.0, 9.0, 0.0));
    let error = apply_panorama(&mut inferred(&frame, 5), None, &far, &upright(1.0), &observed(&frame)).unwrap_err();
    assert!(matches!(error, ApplyPanoramaError::Outside { y: 9.0, .. }));
    assert!(error.to_string().contains("(0.00, 9.00, 0.00)"), "{error}");
}

#[test]
fn files_carry_clipping_and_orientation() {
    let folder = std::env::temp_dir().join(format!("lo_completion-panorama-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    // Red in the middle column's right neighbour, a clipped patch above it.
    let pixels = Image::from_fn(64, 32, |x, y| match (x, y) {
        (33, _) => [200, 0, 0],
        (10..14, 5) => [255, 252, 250],
        _ => [60, 60, 60],
    });
    let png = folder.join("a.png");
    lo_imaging::write_photo(&png, &Photo::Srgb8(pixels.clone()), "tests").unwrap();
    let read = PanoramaPrior::read(&png, Orientation::Lightoctree).unwrap();
    assert_eq!((read.file.as_str(), read.radiance()[(33, 0)][1]), ("a.png", 0.0));
    assert!(read.clipped().unwrap()[(11, 5)] && !read.clipped().unwrap()[(20, 5)]);
    assert_eq!(read.warnings(), [PanoramaWarning::Clipped { clipped_share: 4.0 / 2048.0 }]);
    // OpenEXR's centre is this program's back.
    let turned = PanoramaPrior::read(&png, Orientation::Openexr).unwrap();
    assert_eq!(turned.radiance()[(1, 0)][1], 0.0);
    assert!(turned.clipped().unwrap()[(43, 5)]);
    let hdr = folder.join("a.hdr");
    lo_imaging::write_radiance(&hdr, &Photo::Srgb8(pixels).into_radiance(), &lo_imaging::ExrOptions::default())
        .unwrap();
    let read = PanoramaPrior::read(&hdr, Orientation::Lightoctree).unwrap();
    assert!(read.clipped().is_none() && read.warnings().is_empty());
    assert!(PanoramaPrior::read(folder.join("none.exr"), Orientation::Lightoctree).is_err());
    std::fs::remove_dir_all(&folder).unwrap();
}
