//! Shells of synthetic rooms with known ground truth, of damaged frames, and of the real photos.

use lo_completion::{Shell, ShellOptions, shell};
use lo_cone::{ConeTracer, Settings};
use lo_geometry::{Camera, Mat3, Vec3, cosine_hemisphere, orthonormal_basis, pixel_direction, pixel_solid_angle_sr};
use lo_imaging::{Image, Photo, RadianceImage};
use lo_octree::{LightOctree, Provenance};
use lo_scene::{Frame, Side};
use lo_testdata::{asset, shared_data};

/// A closed box room with diffuse coloured faces and a lamp in the ceiling; the camera is at the origin.
struct TrueRoom {
    /// Columns: the room's axes in the camera's frame; the second one is up.
    axes: Mat3,
    low: Vec3,
    high: Vec3,
}

const COLOURS: [[f32; 3]; 6] = [
    [0.50, 0.42, 0.36], // −x
    [0.46, 0.46, 0.42], // +x
    [0.22, 0.20, 0.19], // floor
    [0.55, 0.54, 0.52], // ceiling
    [0.45, 0.50, 0.52], // −z, in front of the camera
    [0.52, 0.46, 0.40], // +z
];
const LAMP: f32 = 9.0;

/// A ray that hits the corner of a single leaf for one step of half an edge transmits 10⁻²; slightly more for rounding.
const CLOSED: f32 = 0.985;

impl TrueRoom {
    fn tilted(yaw: f32, pitch: f32) -> Self {
        let axes = Mat3::from_rotation_x(pitch) * Mat3::from_rotation_y(yaw);
        Self { axes, low: Vec3::new(-2.1, -1.45, -3.6), high: Vec3::new(1.7, 1.15, 1.9) }
    }

    /// Returns the distance along a unit direction from a world point, and the radiance there.
    fn look(&self, origin: Vec3, direction: Vec3) -> (f32, [f32; 3]) {
        let (o, d) = (self.axes.transpose() * origin, self.axes.transpose() * direction);
        let mut best = (f32::INFINITY, 0);
        for axis in 0..3 {
            let (bound, face) =
                if d[axis] > 0.0 { (self.high[axis], 2 * axis + 1) } else { (self.low[axis], 2 * axis) };
            let t = (bound - o[axis]) / d[axis];
            if t < best.0 {
                best = (t, face);
            }
        }
        let p = o + d * best.0;
        let centre = 0.5 * (self.low + self.high);
        let lamp = best.1 == 3 && (p.x - centre.x).abs() < 0.9 && (p.z - centre.z).abs() < 1.0;
        // Walls darken towards the floor, as under a ceiling lamp.
        let shade = if best.1 / 2 == 1 { 1.0 } else { 0.85 + 0.3 * (p.y - self.low.y) / (self.high.y - self.low.y) };
        (best.0, if lamp { [LAMP; 3] } else { COLOURS[best.1].map(|c| c * shade) })
    }

    fn frame(&self, hfov_deg: f64) -> Frame {
        let (width, height) = (480, 320);
        let camera = Camera::from_hfov_deg(hfov_deg, width, height).unwrap();
        let pixel = |x: usize, y: usize| {
            let direction = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
            let (distance, radiance) = self.look(Vec3::ZERO, direction);
            (-distance * direction.z, radiance)
        };
        let depth_m = Image::from_fn(width as usize, height as usize, |x, y| pixel(x, y).0);
        let encode = |c: f32| {
            let c = c.min(1.0);
            let s = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
            (255.0 * s + 0.5) as u8
        };
        let photo = Photo::Srgb8(Image::from_fn(width as usize, height as usize, |x, y| pixel(x, y).1.map(encode)));
        Frame::new(photo, depth_m, camera, 1.0).unwrap()
    }

    fn panorama(&self, at: Vec3) -> RadianceImage {
        RadianceImage::from_fn(128, 64, |x, y| self.look(at, pixel_direction(x, y, 128, 64)).1)
    }
}

fn tracer(shell: &Shell, depth: u32) -> ConeTracer {
    let (light, report) = LightOctree::from_points(&shell.points(), shell.cube, depth, 4).unwrap();
    assert!(report.outside * 1000 <= shell.surfels.len(), "{} points outside", report.outside);
    ConeTracer::new(&light, Settings::default()).unwrap()
}

/// PSNR in dB of radiance under L / (1 + L), range 1, weighted by solid angle.
fn psnr(a: &RadianceImage, b: &RadianceImage) -> f64 {
    let (mut sum, mut total) = (0.0, 0.0);
    for (i, (p, q)) in a.pixels().iter().zip(b.pixels()).enumerate() {
        let weight = f64::from(pixel_solid_angle_sr(i / a.width(), a.width(), a.height()));
        for c in 0..3 {
            let tone = |v: f32| f64::from(v / (1.0 + v));
            sum += weight * (tone(p[c]) - tone(q[c])).powi(2);
            total += weight;
        }
    }
    -10.0 * (sum / total).log10()
}

#[test]
fn planes_of_a_closed_room_are_found() {
    for (yaw, pitch, hfov) in [(0.0, 0.0, 75.0), (0.35, 0.15, 75.0), (-0.6, 0.45, 70.0), (0.75, -0.2, 80.0)] {
        let truth = TrueRoom::tilted(yaw, pitch);
        let shell = shell(&truth.frame(hfov), &ShellOptions::default());
        let tilt_deg = shell.room.up.dot(truth.axes.col(1)).min(1.0).acos().to_degrees();
        assert!(tilt_deg < 1.0, "up is off by {tilt_deg}°");
        let mut measured = 0;
        for side in shell.room.planes.iter().filter(|p| p.measured) {
            let n = truth.axes.transpose() * side.plane.normal;
            let axis = (0..3).max_by(|&a, &b| n[a].abs().total_cmp(&n[b].abs())).unwrap();
            let angle_deg = n[axis].abs().min(1.0).acos().to_degrees();
            let offset_m = if n[axis] > 0.0 { truth.low[axis] } else { -truth.high[axis] };
            assert!(angle_deg < 1.0, "{side:?} turned by {angle_deg}°");
            assert!((side.plane.offset_m - offset_m).abs() < 0.02, "{side:?} instead of {offset_m}");
            measured += 1;
        }
        assert!(measured >= 3, "only {measured} planes for yaw {yaw}, pitch {pitch}");
        assert_eq!(shell.room.planes.iter().filter(|p| p.side == Side::Wall).count(), 4);
    }
}

#[test]
fn the_shell_is_closed_keeps_the_photo_and_beats_simpler_guesses() {
    let truth = TrueRoom::tilted(0.3, 0.2);
    let frame = truth.frame(70.0);
    for depth in [6, 7] {
        let closed = shell(&frame, &ShellOptions { octree_depth: depth, ..ShellOptions::default() });
        let tracer = tracer(&closed, depth);
        let seen: Vec<_> = closed.points().into_iter().filter(|p| p.provenance == Provenance::Observed).collect();
        let open = LightOctree::from_points(&seen, closed.cube, depth, 4).unwrap().0;
        let open = ConeTracer::new(&open, Settings::default()).unwrap();
        let mean = {
            let sum = seen.iter().fold([0.0f64; 3], |s, p| std::array::from_fn(|c| s[c] + f64::from(p.radiance[c])));
            sum.map(|s| (s / seen.len() as f64) as f32)
        };
        let mut gain_db = 0.0;
        for at in [Vec3::ZERO, truth.axes * Vec3::new(-0.8, -0.5, -1.2), truth.axes * Vec3::new(0.9, 0.3, -2.4)] {
            let wanted = truth.panorama(at);
            let ours = tracer.panorama(at, 128, 64);
            let escaped = ours.opacity.pixels().iter().filter(|&&o| o < CLOSED).count();
            assert!(escaped <= 2, "depth {depth}: {escaped} of 8192 rays from {at} escape");
            let flat = Image::new(128, 64, vec![mean; 128 * 64]);
            let (shell_db, none_db, flat_db) = (
                psnr(&ours.radiance, &wanted),
                psnr(&open.panorama(at, 128, 64).radiance, &wanted),
                psnr(&flat, &wanted),
            );
            println!(
                "depth {depth} at {at}: shell {shell_db:.1} dB, none {none_db:.1} dB, mean colour {flat_db:.1} dB"
            );
            assert!(shell_db > none_db + 3.0 && shell_db > flat_db);
            gain_db += (shell_db - flat_db) / 3.0;
        }
        assert!(gain_db > 1.5, "only {gain_db:.1} dB better than the mean colour");
        // From the camera, nothing occludes the photo's surfaces.
        let view = tracer.perspective(&frame.camera.resized(120, 80));
        let leaf_m = closed.cube.node_edge_m(depth);
        for (x, y) in (4..76).step_by(8).flat_map(|y| (4..116).step_by(8).map(move |x| (x, y))) {
            let direction = frame.camera.resized(120, 80).direction(x as f64 + 0.5, y as f64 + 0.5);
            let (distance, _) = truth.look(Vec3::ZERO, direction);
            let seen_m = view.distance_m[(x, y)];
            assert!((seen_m - distance).abs() < 2.5 * leaf_m, "({x}, {y}): {seen_m} m instead of {distance} m");
        }
    }
}

/// Returns the irradiance on an observed surface from the completed octree, in units of radiance × sr.
fn irradiance(tracer: &ConeTracer, position: Vec3, normal: Vec3, clear_m: f32) -> f32 {
    let basis = orthonormal_basis(normal);
    let directions = cosine_hemisphere(128);
    let sum: f32 = directions
        .iter()
        .map(|d| {
            let direction = basis * *d;
            let origin = position + normal * clear_m;
            let sample = tracer.trace(&lo_cone::Cone { origin, direction, tan_half_angle: 0.09 });
            sample.radiance.iter().sum::<f32>() / 3.0
        })
        .sum();
    sum * std::f32::consts::PI / 128.0
}

#[test]
fn a_white_object_is_lit_as_the_room_is() {
    let truth = TrueRoom::tilted(0.3, 0.25);
    let closed = shell(&truth.frame(70.0), &ShellOptions::default());
    let tracer = tracer(&closed, 7);
    let up = truth.axes.col(1);
    let mut ratios = Vec::new();
    for (x, z) in [(-0.5, -1.5), (0.5, -1.8), (0.0, -2.5)] {
        let position = truth.axes * Vec3::new(x, -1.0, z);
        let (mut wanted, directions) = (0.0, cosine_hemisphere(512));
        for d in &directions {
            let radiance = truth.look(position, orthonormal_basis(up) * *d).1;
            wanted += radiance.iter().sum::<f32>() / 3.0 * std::f32::consts::PI / 512.0;
        }
        ratios.push(irradiance(&tracer, position, up, 0.0) / wanted);
    }
    println!("irradiance in mid-air against the truth: {ratios:.2?}");
    // The albedo, and with it the lamp, is uncertain by a factor of two.
    assert!(ratios.iter().all(|r| (0.5..2.0).contains(r)), "{ratios:?}");
}

#[test]
fn frames_with_holes_still_close() {
    let truth = TrueRoom::tilted(0.3, 0.2);
    let mut frame = truth.frame(70.0);
    for (i, z) in frame.depth_m.pixels_mut().iter_mut().enumerate() {
        let (x, y) = (i % 480, i / 480);
        let block = (x / 60 + y / 60) % 5 == 0;
        let speck = (i as u32).wrapping_mul(2_654_435_761) >> 16 & 0xff < 32;
        if block || speck {
            *z = 0.0;
        }
    }
    let holes = frame.depth_m.pixels().iter().filter(|z| **z == 0.0).count() as f32 / (480.0 * 320.0);
    assert!((0.27..0.36).contains(&holes), "{holes}");
    let closed = shell(&frame, &ShellOptions::default());
    for side in closed.room.planes.iter().filter(|p| p.measured) {
        let n = truth.axes.transpose() * side.plane.normal;
        let axis = (0..3).max_by(|&a, &b| n[a].abs().total_cmp(&n[b].abs())).unwrap();
        let offset_m = if n[axis] > 0.0 { truth.low[axis] } else { -truth.high[axis] };
        assert!((side.plane.offset_m - offset_m).abs() < 0.02, "{side:?} instead of {offset_m}");
    }
    let tracer = tracer(&closed, 7);
    let at = truth.axes * Vec3::new(-0.5, -0.3, -1.0);
    let view = tracer.panorama(at, 128, 64);
    let open = view.opacity.pixels().iter().filter(|&&o| o < CLOSED).count();
    assert!(open <= 4, "{open} of 8192 rays escape");
    let db = psnr(&view.radiance, &truth.panorama(at));
    let whole = shell(&truth.frame(70.0), &ShellOptions::default());
    let whole_db = psnr(&self::tracer(&whole, 7).panorama(at, 128, 64).radiance, &truth.panorama(at));
    println!("with {:.0} % holes {db:.1} dB, without {whole_db:.1} dB", 100.0 * holes);
    assert!(db > whole_db - 1.0);
}

#[test]
fn odd_frames_give_rooms() {
    let make = |width: usize, height: usize, depth: &dyn Fn(usize, usize) -> f32| Frame {
        camera: Camera::from_hfov_deg(60.0, width as u32, height as u32).unwrap(),
        photo: Photo::Srgb8(Image::from_fn(width, height, |x, y| [(x * 37) as u8, (y * 91) as u8, 255])),
        depth_m: Image::from_fn(width, height, depth),
        exposure: 1.0,
    };
    let noise = |x: usize, y: usize| {
        let hash = ((x * 7919 + y * 104_729 + 13) as u32).wrapping_mul(2_654_435_761) >> 8;
        if hash.is_multiple_of(3) { 0.0 } else { 0.01 + (hash % 10_000) as f32 * 0.02 }
    };
    let frames = [
        make(1, 1, &|_, _| 1.0),
        make(1, 1, &|_, _| 0.0),
        make(1, 90, &|_, _| 3.0),
        make(96, 64, &|_, _| 2.0),
        make(96, 64, &|_, _| 0.0),
        make(96, 64, &noise),
        make(96, 64, &|_, _| 199.0),
        make(96, 64, &|_, _| 1e-3),
        make(96, 64, &|x, _| if x == 40 { 1.0 } else { 0.0 }),
    ];
    for (i, frame) in frames.iter().enumerate() {
        for up in [
            None,
            Some(Vec3::new(0.1, 0.9, 0.3)),
            Some(Vec3::NEG_Y),
            Some(Vec3::ZERO),
            Some(Vec3::NAN),
            Some(Vec3::NEG_Z),
        ] {
            let closed = shell(frame, &ShellOptions { up, octree_depth: 5, ..ShellOptions::default() });
            assert!(
                closed.surfels.iter().all(|s| s.position_m.is_finite() && s.radiance.iter().all(|c| c.is_finite()))
            );
            assert!(closed.cube.edge_m.is_finite() && closed.cube.contains(Vec3::ZERO), "frame {i}, up {up:?}");
            let view = tracer(&closed, 5).panorama(Vec3::ZERO, 32, 16);
            let open = view.opacity.pixels().iter().filter(|&&o| o < CLOSED).count();
            assert!(open <= 2, "frame {i}, up {up:?}: {open} of 512 rays escape");
        }
    }
}

#[test]
fn real_photos_close_and_balance() {
    let library = [asset("library_color.jpg"), asset("library_lidar_depth.png")];
    let desk = shared_data("rgbd", "closing of a Kinect's photo")
        .map(|folder| ["color", "depth"].map(|kind| folder.join(format!("tum_desk_{kind}.png"))));
    let photos =
        [(Some(library), 1000.0, [1330.0, 1330.0, 960.0, 720.0]), (desk, 5000.0, [525.0, 525.0, 319.5, 239.5])];
    for (files, scale, [fx, fy, cx, cy]) in photos {
        let Some([photo, depth]) = files else { continue };
        let pixels = lo_imaging::read_photo(&photo).unwrap().photo;
        let depth_m = lo_imaging::read_depth(depth, Some(scale)).unwrap();
        let photo = photo.display();
        let camera = Camera::new(fx, fy, cx, cy, pixels.width() as u32, pixels.height() as u32).unwrap();
        let frame = Frame::new(pixels, depth_m, camera, 1.0).unwrap();
        let closed = shell(&frame.working(), &ShellOptions::default());
        let floor = closed.room.planes.iter().find(|p| p.side == Side::Floor).unwrap();
        assert!(floor.measured && (1.0..2.2).contains(&-floor.plane.offset_m), "{photo}: {floor:?}");
        let tracer = tracer(&closed, 7);
        for at in [Vec3::ZERO, Vec3::new(0.0, -0.4, -1.2), Vec3::new(0.0, 0.0, 0.7)] {
            let view = tracer.panorama(at, 256, 128);
            let open = view.opacity.pixels().iter().filter(|&&o| o < CLOSED).count();
            println!("{photo} at {at}: {open} of 32768 rays escape");
            assert!(open <= 4, "{photo} at {at}: {open} rays escape");
        }
        // The octree's irradiance on observed surfaces, compared with the irradiance that their brightness implies.
        let clear_m = 4.0 * closed.cube.node_edge_m(7);
        let seen: Vec<_> =
            closed.surfels.iter().filter(|s| s.provenance == Provenance::Observed).step_by(997).collect();
        let mean =
            seen.iter().map(|s| irradiance(&tracer, s.position_m, s.normal, clear_m)).sum::<f32>() / seen.len() as f32;
        let ratio = mean / closed.report.lamps.implied_irradiance;
        println!("{photo}: irradiance on seen surfaces / wanted {ratio:.2}, {:?}", closed.report.lamps);
        assert!((0.5..2.0).contains(&ratio), "{photo}: {ratio}");
    }
}
