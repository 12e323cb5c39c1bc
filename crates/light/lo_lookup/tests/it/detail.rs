//! Detail on unobserved surfaces: a uniform room in the octree, and a textured photo of it.

use lo_cone::{Cone, ConeSample, ConeTracer, Settings};
use lo_geometry::{Camera, Cube, Quat, RigidTransform, Vec3};
use lo_imaging::{Image, Photo, RadianceImage, luminance};
use lo_lookup::{Detail, PhotoLookup, SceneRenderer};
use lo_octree::{LightOctree, Provenance, RadiancePoint};
use lo_scene::{Frame, LitScene, OtherPhoto, PanoramaContribution, PanoramaSource};
use proptest::prelude::*;

const LOW: Vec3 = Vec3::new(-2.0, -1.5, -3.4);
const HIGH: Vec3 = Vec3::new(2.0, 1.2, 1.0);

/// Uniform radiance of the room in the octree.
const SMOOTH: [f32; 3] = [0.5, 0.4, 0.3];

fn camera() -> Camera {
    Camera::from_hfov_deg(70.0, 320, 240).unwrap()
}

fn met_m(origin: Vec3, direction: Vec3) -> f32 {
    let (a, b) = ((LOW - origin) / direction, (HIGH - origin) / direction);
    a.max(b).min_element()
}

/// Returns a texture of squares of `side` pixels, brighter and darker than the octree by the same amount.
fn squares(side: usize) -> impl Fn(usize, usize) -> f32 {
    move |x, y| if (x / side + y / side).is_multiple_of(2) { 1.6 } else { 0.4 }
}

fn scene(texture: impl Fn(usize, usize) -> f32, provenance: Provenance) -> LitScene {
    let camera = camera();
    let photo = RadianceImage::from_fn(320, 240, |x, y| SMOOTH.map(|v| v * texture(x, y)));
    let depth_m = Image::from_fn(320, 240, |x, y| {
        let direction = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
        -direction.z * met_m(Vec3::ZERO, direction)
    });
    let points = lo_geometry::fibonacci_sphere(200_000).into_iter().map(|direction| {
        let position_m = direction * (met_m(Vec3::ZERO, direction) + 1e-3);
        RadiancePoint { position_m, radiance: SMOOTH, provenance }
    });
    let cube = Cube { origin_m: Vec3::new(-4.0, -4.0, -4.0), edge_m: 8.0 };
    let light = LightOctree::from_points(&points.collect::<Vec<_>>(), cube, 6, 4).unwrap().0;
    LitScene::observed_only(light, Frame::new(Photo::Linear(photo), depth_m, camera, 1.0).unwrap())
}

/// Traces cones without detail, and with it.
fn traced(scene: &LitScene, cones: &[Cone]) -> (Vec<ConeSample>, Vec<ConeSample>) {
    let tracer = ConeTracer::new(&scene.light, Settings::default()).unwrap();
    let detail = Detail::new(scene, &PhotoLookup::new(scene, &tracer)).unwrap();
    let mut plain = vec![ConeSample::default(); cones.len()];
    tracer.trace_batch(cones, &mut plain);
    let mut detailed = plain.clone();
    detail.add(cones, &mut detailed);
    (plain, detailed)
}

fn cones(origin: Vec3, tan_half_angle: f32, count: usize) -> Vec<Cone> {
    let cone = |direction| Cone { origin, direction, tan_half_angle };
    lo_geometry::fibonacci_sphere(count).into_iter().map(cone).collect()
}

/// Returns whether a direction is some degrees outside the photo.
fn is_outside(direction: Vec3) -> bool {
    let camera = camera();
    let margin = 60.0;
    let near = |(u, v, _)| (-margin..320.0 + margin).contains(&u) && (-margin..240.0 + margin).contains(&v);
    !camera.project(direction).is_some_and(near)
}

#[test]
fn texture_goes_on_and_the_mean_stays() {
    let scene = scene(squares(16), Provenance::Inferred);
    for origin in [Vec3::ZERO, Vec3::new(0.4, -0.5, -1.5)] {
        let cones = cones(origin, 0.004, 20_000);
        let (plain, detailed) = traced(&scene, &cones);
        let (mut sums, mut squares, mut count) = ([0.0f64; 2], 0.0, 0.0);
        for ((cone, plain), detailed) in cones.iter().zip(&plain).zip(&detailed) {
            if is_outside(origin + cone.direction * plain.distance_m) {
                let [a, b] = [plain, detailed].map(|sample| f64::from(luminance(sample.radiance)));
                sums[0] += a;
                sums[1] += b;
                squares += (b / a - 1.0).powi(2);
                count += 1.0;
            }
        }
        let (mean, deviation) = (sums[1] / sums[0], (squares / count).sqrt());
        println!("{origin}: mean {mean}, deviation {deviation}");
        assert!((mean - 1.0).abs() < 0.03, "{origin}: {mean}");
        // In the photo it is 0.6. Poles are smooth.
        assert!((0.3..0.65).contains(&deviation), "{origin}: {deviation}");
    }
}

#[test]
fn wide_cones_see_no_detail() {
    let scene = scene(squares(8), Provenance::Inferred);
    let (plain, detailed) = traced(&scene, &cones(Vec3::ZERO, 0.5, 500));
    for (plain, detailed) in plain.iter().zip(&detailed).filter(|(plain, _)| plain.opacity > 0.5) {
        let ratio = Vec3::from(detailed.radiance) / Vec3::from(plain.radiance);
        assert!((ratio - 1.0).abs().max_element() < 0.12, "{plain:?} {detailed:?}");
    }
}

#[test]
fn the_mirror_image_begins_at_the_photos_border() {
    // A gradient: squares would hide the size of an offset.
    let scene = scene(|x, y| 0.3 + 0.004 * x as f32 + 0.003 * y as f32, Provenance::Inferred);
    let camera = camera();
    let photo = scene.frame.radiance();
    let mut pairs = Vec::new();
    for i in 4..236 {
        pairs.extend([((-0.5, i as f64), (0, i)), ((320.5, i as f64), (319, i))]);
    }
    for i in 4..316 {
        pairs.extend([((i as f64, -0.5), (i, 0)), ((i as f64, 240.5), (i, 239))]);
    }
    let cone = |((u, v), _): &((f64, f64), _)| Cone {
        origin: Vec3::ZERO,
        direction: camera.direction(*u, *v),
        tan_half_angle: 1e-3,
    };
    let cones: Vec<Cone> = pairs.iter().map(cone).collect();
    let (_, detailed) = traced(&scene, &cones);
    for ((beside, inside), detailed) in pairs.iter().zip(&detailed) {
        let off = (Vec3::from(detailed.radiance) - Vec3::from(photo[*inside])).abs().max_element();
        assert!(off < 0.012, "{beside:?}: {detailed:?} beside {:?}", photo[*inside]);
    }
}

#[test]
fn detail_changes_nothing_inside_photos_and_panoramas() {
    let scene = scene(squares(16), Provenance::Inferred);
    // Inside the photo, away from its border.
    let (with, without) = (SceneRenderer::new(&scene).with_detail(&scene), SceneRenderer::new(&scene));
    let [with, without] = [with, without].map(|renderer| renderer.panorama(Vec3::ZERO, 256, 128).radiance);
    let (mut inside, mut changed) = (0, 0);
    for (i, (with, without)) in with.pixels().iter().zip(without.pixels()).enumerate() {
        let direction = lo_geometry::pixel_direction(i % 256, i / 256, 256, 128);
        let is_inside = |(u, v, _)| (20.0..300.0).contains(&u) && (20.0..220.0).contains(&v);
        if camera().project(direction).is_some_and(is_inside) {
            assert_eq!(with, without, "{direction}");
            inside += 1;
        } else {
            changed += usize::from(with != without);
        }
    }
    assert!(inside > 1000 && changed > 10_000, "{inside} {changed}");
    // With a panorama of the room there is no detail, and none on surfaces that another photo observed.
    let source = PanoramaSource {
        file: "room.hdr".into(),
        position_m: Vec3::ZERO,
        yaw_deg: 0.0,
        pitch_deg: 0.0,
        roll_deg: 0.0,
        exposure_ev: 0.0,
        confidence: 1.0,
        clipped: false,
    };
    let share = scene.light.rgba.iter().map(|rows| vec![255; rows.len()]).collect();
    let mut given = scene.clone();
    given.estimate_mut().panorama = Some(PanoramaContribution { source, share, image: None });
    let tracer = ConeTracer::new(&scene.light, Settings::default()).unwrap();
    assert!(Detail::new(&given, &PhotoLookup::new(&given, &tracer)).is_none());
    let mut several = self::scene(squares(16), Provenance::Observed);
    let first_from_camera = RigidTransform { rotation: Quat::IDENTITY, translation_m: Vec3::X };
    several.estimate_mut().other_photos.push(OtherPhoto { first_from_camera, camera: camera(), exposure: 1.0 });
    let (plain, detailed) = traced(&several, &cones(Vec3::new(0.3, 0.0, -0.5), 0.01, 2000));
    for (plain, detailed) in plain.iter().zip(&detailed) {
        let off = (Vec3::from(plain.radiance) - Vec3::from(detailed.radiance)).abs().max_element();
        assert!(off < 1e-4, "{plain:?} {detailed:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// For any photo, radiance stays finite, non-negative, and within the ratio's range of the brightest input.
    #[test]
    fn radiance_stays_in_range(
        values in prop::collection::vec(prop_oneof![Just(0.0f32), 0.0f32..1.0, Just(50.0f32)], 64),
        turn in 0.0f32..6.0,
        place in prop::array::uniform3(-0.9f32..0.9),
    ) {
        let scene = scene(|x, y| values[(x * 8 / 320) + 8 * (y * 8 / 240)], Provenance::Inferred);
        let brightest = scene.frame.radiance().pixels().iter().flatten().copied().fold(SMOOTH[0], f32::max);
        let mut cones = cones(Vec3::from(place), 0.02, 500);
        cones.iter_mut().for_each(|cone| cone.direction = Quat::from_rotation_y(turn) * cone.direction);
        let (plain, detailed) = traced(&scene, &cones);
        for (plain, detailed) in plain.iter().zip(&detailed) {
            let most = detailed.radiance.into_iter().fold(0.0, f32::max);
            prop_assert!(detailed.radiance.iter().all(|v| v.is_finite() && *v >= 0.0) && most < 30.0 * brightest);
            prop_assert_eq!((plain.distance_m, plain.opacity), (detailed.distance_m, detailed.opacity));
        }
    }
}
