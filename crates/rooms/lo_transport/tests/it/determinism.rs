//! Determinism across thread counts, and errors instead of panics.

use crate::support::{Builder, RoomLight, cornell, living_room, panorama, photo};
use lo_geometry::Vec3;
use lo_transport::{BakeSettings, BakedWorld, Portal, TransportError};

#[test]
fn threads_do_not_change_a_bit() {
    let settings = BakeSettings { spacing_m: 0.3, gather_rays: 32, ..BakeSettings::default() };
    let made = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let light = RoomLight { sky: [1.0; 3], sun: Some([1e5; 3]), lamps: true };
            let baked = BakedWorld::bake(living_room(&light), &settings).unwrap();
            let views = [panorama(Vec3::new(0.3, 1.2, 0.6), 24), photo(Vec3::new(1.8, 1.5, 1.6), 0.7, -0.15, [48, 32])];
            (views.map(|view| baked.render(&view)), baked.radiance_points(0.2))
        })
    };
    let (views, points) = made(1);
    let (other_views, other_points) = made(3);
    assert_eq!(points, other_points);
    for (a, b) in views.iter().zip(&other_views) {
        assert_eq!(a.radiance, b.radiance);
        assert_eq!((&a.depth_m, &a.normal, &a.albedo), (&b.depth_m, &b.normal, &b.albedo));
        assert!(a.radiance.pixels().iter().flatten().all(|v| v.is_finite() && *v >= 0.0));
    }
}

#[test]
fn views_measure_depth_and_normals() {
    let baked = BakedWorld::bake(cornell(), &BakeSettings { spacing_m: 0.5, ..BakeSettings::default() }).unwrap();
    // Looks at the back wall, 2.7 + 2.8 m away, above the blocks.
    let made = baked.render(&photo(Vec3::new(1.5, 4.6, 2.7), 0.0, 0.0, [32, 24]));
    for pixel in [(10, 12), (16, 12), (20, 12)] {
        assert!((made.depth_m[pixel] - 5.5).abs() < 1e-3, "{}", made.depth_m[pixel]);
        assert!((Vec3::from(made.normal[pixel]) - Vec3::Z).length() < 1e-4);
        assert_eq!(made.albedo[pixel], [0.73; 3]);
    }
    // A panorama's depth is measured along the ray.
    let made = baked.render(&panorama(Vec3::new(1.5, 4.6, 2.7), 32));
    let direction = lo_geometry::pixel_direction(30, 15, 64, 32);
    assert!((made.depth_m[(30, 15)] - 5.5 / -direction.z).abs() < 1e-2);
}

#[test]
fn invalid_worlds_are_rejected() {
    let bake = |change: &dyn Fn(&mut lo_transport::World)| {
        let mut world = cornell();
        change(&mut world);
        BakedWorld::bake(world, &BakeSettings::default()).err().unwrap()
    };
    assert_eq!(bake(&|w| w.model.positions[0].x = f32::NAN), TransportError::Triangle { index: 0 });
    assert!(matches!(bake(&|w| w.model.materials[3].emissive[1] = -1.0), TransportError::Emission { index: 3, .. }));
    let flat = Portal { corner: Vec3::ZERO, edges: [Vec3::X, Vec3::X] };
    assert_eq!(bake(&|w| w.portals.push(flat)), TransportError::Portal { index: 0 });
    assert!(matches!(
        bake(&|w| w.outdoors.radiance.pixels_mut()[5][0] = f32::INFINITY),
        TransportError::OutdoorsRadiance { pixel: 5, .. }
    ));
    let settings = BakeSettings { spacing_m: 0.0, ..BakeSettings::default() };
    let error = BakedWorld::bake(cornell(), &settings).err().unwrap();
    assert!(matches!(error, TransportError::Setting { name: "spacing_m", .. }));
    let mut huge = Builder::new();
    let white = huge.matte([0.5; 3]);
    huge.sheet(Vec3::ZERO, Vec3::X * 9000.0, Vec3::Z * 9000.0, [1, 1], white);
    let world = huge.world([1.0; 3], None, Vec::new());
    let error = BakedWorld::bake(world, &BakeSettings::default()).err().unwrap();
    assert!(matches!(error, TransportError::TooLarge { .. }));
}

#[test]
fn an_empty_world_shows_the_sky() {
    let world = Builder::new().world([0.25, 0.5, 1.0], None, Vec::new());
    let baked = BakedWorld::bake(world, &BakeSettings::default()).unwrap();
    let made = baked.render(&panorama(Vec3::ZERO, 8));
    assert!(made.radiance.pixels().iter().all(|&p| p == [0.25, 0.5, 1.0]));
    assert!(made.depth_m.pixels().iter().all(|&d| d == 0.0) && baked.radiance_points(0.1).points.is_empty());
}
