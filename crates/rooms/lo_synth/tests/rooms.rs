//! Invariants of every room, checked on its triangles and independent of the placement code.
#![allow(clippy::unwrap_used)]

use std::collections::HashSet;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use lo_geometry::{Quat, Ray, Vec3, fibonacci_sphere};
use lo_mesh::PreparedModel;
use lo_synth::{Interior, LightingMode, Object, RoomKind, Support, SynthConfig, Tilt, Weather};

/// Tolerance of contact between objects, metres; the pile of carpets gives way.
const TOUCH_M: f32 = 0.012;

struct Room {
    interior: Interior,
    model: PreparedModel,
    /// Index of the object that each triangle belongs to.
    owner: Vec<usize>,
}

impl Room {
    fn new(seed: u64, index: u64, config: &SynthConfig) -> Self {
        let interior = Interior::generate(seed, index, config).unwrap();
        let model = PreparedModel::new(interior.world.model.clone());
        let mut owner = vec![usize::MAX; interior.world.model.triangles.len()];
        for (k, object) in interior.objects.iter().enumerate() {
            for part in &object.parts {
                owner[part.clone()].fill(k);
            }
        }
        assert!(owner.iter().all(|&o| o != usize::MAX), "{}: triangles without an object", interior.id);
        Self { interior, model, owner }
    }

    fn corners(&self, part: &std::ops::Range<usize>) -> impl Iterator<Item = Vec3> + '_ {
        let model = &self.interior.world.model;
        model.triangles[part.clone()].iter().flatten().map(|&v| model.positions[v as usize])
    }

    fn bounds(&self, object: &Object) -> (Vec3, Vec3) {
        let all = object.parts.iter().flat_map(|part| self.corners(part));
        all.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(a, b), p| (a.min(p), b.max(p)))
    }

    /// Object index and distance of the first hit.
    fn hit(&self, origin: Vec3, direction: Vec3, max: f32) -> Option<(usize, f32)> {
        let hit = self.model.intersect_both_sides(&Ray { origin, direction }, max)?;
        Some((self.owner[hit.triangle as usize], hit.distance_m))
    }

    fn is_building(&self, object: usize) -> bool {
        self.interior.objects[object].support == Support::Building
    }

    /// Whether a part is closed: its vector areas sum to zero.
    fn is_closed(&self, part: &std::ops::Range<usize>) -> bool {
        let model = &self.interior.world.model;
        let (sum, total) = model.triangles[part.clone()].iter().fold((Vec3::ZERO, 0.0), |(sum, total), t| {
            let [a, b, c] = t.map(|v| model.positions[v as usize]);
            let area = (b - a).cross(c - a);
            (sum + area, total + area.length())
        });
        sum.length() < 1e-3 * total
    }

    /// Whether a point is inside a closed part, by the parity of ray crossings (Möller & Trumbore 1997).
    fn inside(&self, part: &std::ops::Range<usize>, p: Vec3) -> bool {
        let model = &self.interior.world.model;
        let direction = Vec3::new(0.5121, 0.6971, 0.4874).normalize();
        let crossings = model.triangles[part.clone()].iter().filter(|t| {
            let [a, b, c] = t.map(|v| model.positions[v as usize]);
            let (e1, e2) = (b - a, c - a);
            let h = direction.cross(e2);
            let det = e1.dot(h);
            if det.abs() < 1e-14 {
                return false;
            }
            let s = p - a;
            let u = s.dot(h) / det;
            let q = s.cross(e1);
            let v = direction.dot(q) / det;
            u >= 0.0 && v >= 0.0 && u + v <= 1.0 && e2.dot(q) / det > 0.0
        });
        crossings.count() % 2 == 1
    }
}

fn check_numbers(room: &Room) {
    let id = &room.interior.id;
    let model = &room.interior.world.model;
    assert!(model.positions.iter().chain(&model.normals).all(|p| p.is_finite()), "{id}: not finite");
    assert!(model.uvs[0].iter().flatten().all(|x| x.is_finite()), "{id}: texture coordinates are not finite");
    assert!(model.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-3), "{id}: normals are not unit vectors");
    assert!(room.interior.world.outdoors.radiance.pixels().iter().flatten().all(|c| c.is_finite() && *c >= 0.0));
    // Large halls, up to a thousand square metres, have more.
    let max = if room.interior.description.area_m2 > 150.0 { 300_000 } else { 150_000 };
    assert!(model.triangles.len() < max, "{id}: {} triangles", model.triangles.len());
    for (k, t) in model.triangles.iter().enumerate() {
        let [a, b, c] = t.map(|v| model.positions[v as usize]);
        let face = (b - a).cross(c - a);
        let sum: Vec3 = t.iter().map(|&v| model.normals[v as usize]).sum();
        let object = room.interior.objects[room.owner[k]].name;
        assert!(face.length() > 0.0 && sum.dot(face) > 0.0, "{id}: {object} faces inwards: {face} {sum}");
    }
    // glTF requires vertex colours within [0, 1].
    assert!(model.colors.iter().flatten().all(|c| (0.0..=1.0).contains(c)), "{id}: vertex colours are out of range");
    let mut min = model.textures.iter().map(|t| t.levels.last().unwrap()[(0, 0)]);
    assert!(min.all(|mean| mean[3] == 255));
    for (t, &m) in model.triangles.iter().zip(&model.triangle_materials) {
        let material = &model.materials[m as usize];
        for v in t {
            let tint = model.colors[*v as usize];
            let albedo = (0..3).map(|c| material.base_color[c] * tint[c]).fold(0.0, f32::max);
            // Textures hold absolute albedo of at most 0.88.
            let whole = albedo * if material.base_color_texture.is_some() { 0.88 } else { 1.0 };
            assert!(whole <= 0.9 || material.transmission > 0.0, "{id}: {} reflects {whole}", material.name);
        }
    }
}

fn check_outwards(room: &Room) {
    let model = &room.interior.world.model;
    for object in room.interior.objects.iter().filter(|o| o.support != Support::Building) {
        for part in object.parts.iter().filter(|part| room.is_closed(part)) {
            let origin = room.corners(part).next().unwrap();
            let volume: f32 = model.triangles[part.clone()]
                .iter()
                .map(|t| {
                    let [a, b, c] = t.map(|v| model.positions[v as usize] - origin);
                    a.dot(b.cross(c)) / 6.0
                })
                .sum();
            assert!(volume > -1e-7, "{}: {} is inside out: {volume}", room.interior.id, object.name);
        }
    }
}

/// Asserts that objects do not intersect: points just inside each solid are in no solid of another object.
fn check_apart(room: &Room) {
    let objects = &room.interior.objects;
    let boxes: Vec<(Vec3, Vec3)> = objects.iter().map(|o| room.bounds(o)).collect();
    for (i, one) in objects.iter().enumerate() {
        for (j, other) in objects.iter().enumerate() {
            let building = one.support == Support::Building || other.support == Support::Building;
            let apart = boxes[i].0.cmpgt(boxes[j].1 - TOUCH_M).any() || boxes[j].0.cmpgt(boxes[i].1 - TOUCH_M).any();
            let rug = one.name == "rug" || other.name == "rug";
            if i == j || apart || rug || (building && (one.name != "open door" && other.name != "open door")) {
                continue;
            }
            if building && one.support == other.support {
                continue;
            }
            let solids: Vec<_> = other.parts.iter().filter(|part| room.is_closed(part)).collect();
            for part in &one.parts {
                let points: Vec<Vec3> = room.corners(part).collect();
                let middle = points.iter().sum::<Vec3>() / points.len() as f32;
                let step = (points.len() / 24).max(1);
                for p in points.iter().step_by(step).map(|p| *p + (middle - *p) * 0.15).chain([middle]) {
                    for solid in &solids {
                        let (a, b) = room
                            .corners(solid)
                            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(a, b), q| (a.min(q), b.max(q)));
                        // Deeper than the tolerance of contact.
                        let deep = p.cmpgt(a + TOUCH_M * 0.5).all() && p.cmplt(b - TOUCH_M * 0.5).all();
                        assert!(
                            !(deep && room.inside(solid, p)),
                            "{}: {} in {} at {p}",
                            room.interior.id,
                            one.name,
                            other.name
                        );
                    }
                }
            }
        }
    }
}

fn check_supported(room: &Room) {
    let id = &room.interior.id;
    for (k, object) in room.interior.objects.iter().enumerate() {
        let (min, max) = room.bounds(object);
        let name = object.name;
        let near = |direction: Vec3, limit: f32, accept: &dyn Fn(usize) -> bool| {
            object.parts.iter().any(|part| {
                room.corners(part).any(|p| {
                    // Starts slightly before the point and skips hits on the object itself.
                    let mut origin = p - direction * 0.006;
                    let mut left = limit + 0.006;
                    for _ in 0..20 {
                        match room.hit(origin, direction, left) {
                            Some((hit, _)) if accept(hit) => return true,
                            Some((_, distance)) => {
                                origin += direction * (distance + 1e-4);
                                left -= distance + 1e-4;
                            }
                            None => return false,
                        }
                    }
                    false
                })
            })
        };
        match object.support {
            Support::Building => {}
            Support::Floor => assert!((-0.002..0.012).contains(&min.y), "{id}: {name} floats at {}", min.y),
            Support::Ceiling => {
                assert!(
                    near(Vec3::Y, 0.03, &|hit| room.is_building(hit)),
                    "{id}: {name} at {max} is not fixed to the ceiling"
                );
            }
            Support::Wall => {
                let sides = [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z, Vec3::Y];
                let held = sides.iter().any(|&d| near(d, 0.03, &|hit| room.is_building(hit)));
                assert!(held, "{id}: {name} at {min} to {max} is not fixed to a wall");
            }
            Support::Object(carrier) => {
                assert!(carrier < k, "{id}: the object that carries {name} comes later");
                let down = near(Vec3::NEG_Y, TOUCH_M, &|hit| hit == carrier);
                let up = near(Vec3::Y, 0.04, &|hit| hit == carrier);
                let on = room.interior.objects[carrier].name;
                assert!(down || up, "{id}: {name} at {min} floats above {on}");
            }
        }
    }
}

/// Asserts that most of the free floor is connected: cells of 15 cm, a body 42 cm wide probed with rays.
fn check_passages(room: &Room) {
    const CELL: f32 = 0.15;
    let shell = &room.interior.objects[0];
    let (min, max) = room.bounds(shell);
    let size = [((max.x - min.x) / CELL) as usize + 1, ((max.z - min.z) / CELL) as usize + 1];
    let center =
        |k: usize| min + Vec3::new(((k % size[0]) as f32 + 0.5) * CELL, 0.0, ((k / size[0]) as f32 + 0.5) * CELL);
    let free: Vec<bool> = (0..size[0] * size[1])
        .map(|k| {
            let p = center(k);
            let on_floor = {
                let hit =
                    room.model.intersect_both_sides(&Ray { origin: p + Vec3::Y * 1.7, direction: Vec3::NEG_Y }, 2.0);
                // Objects lower than 3 cm can be walked on.
                hit.is_some_and(|hit| hit.distance_m > 1.67)
            };
            on_floor
                && [0.3, 0.85, 1.5].iter().all(|&y| {
                    (0..8).all(|d| {
                        let angle = std::f32::consts::TAU * d as f32 / 8.0;
                        let direction = Vec3::new(angle.cos(), 0.0, angle.sin());
                        room.hit(p + Vec3::Y * y, direction, 0.21).is_none()
                    })
                })
        })
        .collect();
    let all = free.iter().filter(|f| **f).count();
    let mut visited = vec![false; free.len()];
    let mut largest = 0;
    for start in 0..free.len() {
        if !free[start] || visited[start] {
            continue;
        }
        let (mut stack, mut count) = (vec![start], 0);
        visited[start] = true;
        while let Some(k) = stack.pop() {
            count += 1;
            let (x, y) = ((k % size[0]) as i32, (k / size[0]) as i32);
            for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
                let (nx, ny) = (x + dx, y + dy);
                if nx >= 0 && ny >= 0 && (nx as usize) < size[0] && (ny as usize) < size[1] {
                    let next = ny as usize * size[0] + nx as usize;
                    if free[next] && !std::mem::replace(&mut visited[next], true) {
                        stack.push(next);
                    }
                }
            }
        }
        largest = largest.max(count);
    }
    // Islands behind tables may be cut off.
    assert!(all > 0 && largest as f32 > 0.6 * all as f32, "{}: {largest} of {all} cells", room.interior.id);
}

fn check_views(room: &Room) {
    let id = &room.interior.id;
    let directions = fibonacci_sphere(96);
    let clearance =
        |p: Vec3| directions.iter().map(|&d| room.hit(p, d, 50.0).map_or(50.0, |h| h.1)).fold(50.0, f32::min);
    let views = room.interior.camera_poses(2);
    assert_eq!(views[0], room.interior.camera_poses(1)[0], "{id}: a camera depends on the number of cameras");
    for view in &views {
        let p = view.pose.position;
        assert!(
            (0.79..2.01).contains(&p.y) && clearance(p) > 0.15,
            "{id}: camera at {p} has a clearance of {}",
            clearance(p)
        );
        let forward = view.pose.rotation * Vec3::NEG_Z;
        assert!(forward.y.asin().to_degrees().abs() < 15.1 && (49.9..90.1).contains(&view.camera.hfov_deg()));
        let probes = room.interior.probe_positions(view, 6);
        assert_eq!(probes.len(), 6, "{id}: too few probes");
        for probe in probes {
            let local = view.pose.rotation.inverse() * (probe - p);
            let (u, v, _) = view.camera.project(local).unwrap();
            assert!((0.0..480.0).contains(&u) && (0.0..320.0).contains(&v), "{id}: probe outside the image");
            let distance = probe.distance(p);
            assert!(room.hit(p, (probe - p) / distance, distance).is_none(), "{id}: probe is hidden");
            assert!(clearance(probe) > 0.095, "{id}: probe has a clearance of {}", clearance(probe));
        }
        check_closed(room, p, &directions);
    }
}

/// Median distance of the visible surfaces in metres and number of objects, for each of two photos.
fn framing(room: &Room) -> Vec<(f32, usize)> {
    let measure = |view: &lo_synth::CameraPose| {
        let rays = (0..16 * 12).map(|k| (f64::from(k % 16) * 30.0 + 15.0, f64::from(k / 16) * 26.0 + 17.0));
        let hits: Vec<_> = rays
            .filter_map(|(u, v)| room.hit(view.pose.position, view.pose.rotation * view.camera.direction(u, v), 50.0))
            .collect();
        let mut distances: Vec<f32> = hits.iter().map(|hit| hit.1).collect();
        distances.sort_unstable_by(f32::total_cmp);
        let things: HashSet<usize> = hits.iter().map(|hit| hit.0).filter(|&object| !room.is_building(object)).collect();
        (distances[distances.len() / 2], things.len())
    };
    room.interior.camera_poses(2).iter().map(measure).collect()
}

/// Asserts that rays leave the room through portals only.
fn check_closed(room: &Room, from: Vec3, directions: &[Vec3]) {
    let world = &room.interior.world;
    for &direction in directions {
        let (mut origin, mut escaped) = (from, false);
        for _ in 0..12 {
            let Some(hit) = room.model.intersect_both_sides(&Ray { origin, direction }, 200.0) else {
                escaped = true;
                break;
            };
            let material = world.model.triangle_materials[hit.triangle as usize];
            if world.model.materials[material as usize].transmission == 0.0 {
                break;
            }
            origin += direction * (hit.distance_m + 1e-3);
        }
        if !escaped {
            continue;
        }
        let through = world.portals.iter().any(|portal| {
            let normal = portal.edges[0].cross(portal.edges[1]);
            let t = normal.dot(portal.corner - from) / normal.dot(direction);
            let q = from + direction * t - portal.corner;
            let share = |e: Vec3| q.dot(e) / e.length_squared();
            t > 0.0
                && (-0.01..1.01).contains(&share(portal.edges[0]))
                && (-0.01..1.01).contains(&share(portal.edges[1]))
        });
        assert!(through, "{}: light leaks from {from} towards {direction}", room.interior.id);
    }
}

/// Asserts that every portal faces the room and has a pane or a frame in front.
fn check_portals(room: &Room) {
    for portal in &room.interior.world.portals {
        let normal = portal.edges[0].cross(portal.edges[1]).normalize();
        for k in 0..25 {
            let (a, b) = ((k % 5) as f32 * 0.24 + 0.02, (k / 5) as f32 * 0.24 + 0.02);
            let p = portal.corner + portal.edges[0] * a + portal.edges[1] * b;
            let hit = room.hit(p - normal * 0.05, normal, 0.6).unwrap();
            let name = room.interior.objects[hit.0].name;
            assert!(
                ["pane", "window frame", "reveal"].contains(&name),
                "{}: {name} in front of a portal",
                room.interior.id
            );
        }
    }
}

/// Number of rooms: each takes 0.1 s in release builds and 0.5 s in test builds.
const ROOMS: u64 = 100;

/// Asserts that a lamp is on unless the room is lit by daylight only.
fn check_lit(room: &Room) {
    let about = &room.interior.description;
    let lit = about.lighting == LightingMode::Daylight || (about.lamps_on > 0 && about.flux_lm > 0.0);
    assert!(lit, "{}: {:?}, but no lamp is on", room.interior.id, about.lighting);
}

type Check = (&'static str, fn(&Room));

#[test]
fn rooms_keep_the_rules() {
    let framings = keep_the_rules(11, ROOMS, &SynthConfig::default());
    // Few photos show a nearby wall or nothing but walls.
    let share = |test: &dyn Fn(&(f32, usize)) -> bool| {
        framings.iter().filter(|view| test(view)).count() as f32 / framings.len() as f32
    };
    let (near, bare) = (share(&|view| view.0 < 1.3), share(&|view| view.1 < 2));
    eprintln!(
        "{:.1} % have a median distance below 1.3 m, {:.1} % show fewer than two objects",
        100.0 * near,
        100.0 * bare
    );
    assert!(near < 0.03 && bare < 0.08, "{near} {bare}");
}

#[test]
fn rooms_that_are_lived_and_worked_in_keep_the_rules() {
    let kinds = [RoomKind::Laboratory, RoomKind::Cellar, RoomKind::Workshop, RoomKind::Empty, RoomKind::Hall];
    let mut config = SynthConfig { litter_share: 1.0, people_share: 0.6, ..SynthConfig::default() };
    keep_the_rules(12, ROOMS / 4, &config);
    config.room_weights = kinds.into_iter().zip([1.0, 1.0, 1.0, 0.4, 0.4]).collect();
    config.large_share = 0.4;
    keep_the_rules(13, ROOMS / 3, &config);
}

/// Checks rooms and returns the [`framing`] of their photos.
fn keep_the_rules(seed: u64, rooms: u64, config: &SynthConfig) -> Vec<(f32, usize)> {
    let checks: [Check; 8] = [
        ("numbers", check_numbers),
        ("outwards", check_outwards),
        ("apart", check_apart),
        ("supported", check_supported),
        ("views", check_views),
        ("lit", check_lit),
        ("portals", check_portals),
        ("passages", check_passages),
    ];
    let next = AtomicU64::new(0);
    let failed = Mutex::new(Vec::new());
    let framings = Mutex::new(Vec::new());
    let check_rooms = || {
        while let Some(index) = Some(next.fetch_add(1, Ordering::Relaxed)).filter(|&index| index < rooms) {
            let room = Room::new(seed, index, config);
            framings.lock().unwrap().extend(framing(&room));
            // The walking test is slow, so it runs on every fourth room.
            let number = if index % 4 == 0 { checks.len() } else { checks.len() - 1 };
            for (name, check) in &checks[..number] {
                // Collects failures of all rooms instead of stopping at the first.
                if std::panic::catch_unwind(|| check(&room)).is_err() {
                    failed.lock().unwrap().push((index, *name));
                }
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(check_rooms);
        }
    });
    let failed = failed.into_inner().unwrap();
    assert!(failed.is_empty(), "{failed:?}");
    framings.into_inner().unwrap()
}

#[test]
fn a_wall_lamp_burns_where_the_ceiling_has_no_place() {
    // A windowless bedroom whose wardrobe occupies the place of its only ceiling lamp.
    let interior = Interior::generate(100, 418, &SynthConfig::default()).unwrap();
    assert_eq!((interior.description.windows, interior.description.lamps_on), (0, 1));
}

/// Hash of the geometry, materials, textures and outdoors.
fn fingerprint(interior: &Interior) -> u64 {
    let model = &interior.world.model;
    let mut bytes: Vec<u8> = Vec::new();
    for p in &model.positions {
        bytes.extend(p.to_array().iter().flat_map(|x| x.to_le_bytes()));
    }
    for m in &model.materials {
        bytes.extend(m.base_color.iter().chain(&m.emissive).flat_map(|x| x.to_le_bytes()));
    }
    for t in &model.textures {
        bytes.extend(t.levels[0].pixels().iter().flatten());
    }
    bytes.extend(interior.world.outdoors.radiance.pixels().iter().flatten().flat_map(|x| x.to_le_bytes()));
    lo_random::hash(&bytes)
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_thread() {
    let config = SynthConfig::default();
    let make = |index: u64| fingerprint(&Interior::generate(5, index, &config).unwrap());
    let alone: Vec<u64> = (0..4).map(make).collect();
    let together: Vec<u64> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..4).rev().map(|index| scope.spawn(move || (index, make(index)))).collect();
        let mut made: Vec<(u64, u64)> = threads.into_iter().map(|t| t.join().unwrap()).collect();
        made.sort_unstable();
        made.into_iter().map(|m| m.1).collect()
    });
    assert_eq!(alone, together);
}

#[test]
#[ignore = "a thousand rooms take minutes: cargo test -p lo_synth --release -- --ignored"]
fn a_thousand_seeds_give_a_thousand_layouts() {
    let config = SynthConfig::default();
    let mut layouts = HashSet::new();
    for seed in 0..1000 {
        let interior = Interior::generate(seed, 0, &config).unwrap();
        // Positions of the objects to the centimetre, without their appearance.
        let mut bytes = Vec::new();
        for object in &interior.objects {
            let first = interior.world.model.triangles.get(object.parts.first().map_or(0, |p| p.start)).unwrap()[0];
            let p = interior.world.model.positions[first as usize] * 100.0;
            bytes.extend(p.to_array().iter().flat_map(|x| (x.round() as i32).to_le_bytes()));
            bytes.extend(object.name.as_bytes());
        }
        assert!(layouts.insert(lo_random::hash(&bytes)), "seed {seed} repeats a layout");
    }
}

#[test]
fn turned_cameras_are_upright_but_for_a_small_roll() {
    let interior = Interior::generate(3, 0, &SynthConfig::default()).unwrap();
    for view in interior.camera_poses(8) {
        let right = view.pose.rotation * Vec3::X;
        assert!(right.y.asin().to_degrees().abs() < 3.1, "{right}");
        assert!((view.pose.rotation.length() - 1.0).abs() < 1e-4 && view.pose.rotation != Quat::IDENTITY);
    }
}

#[test]
fn close_ups_show_things_within_reach_and_stand_in_nothing() {
    let config = SynthConfig { close_up_share: 1.0, cluttered_share: 0.7, roll_deg: 8.0, ..SynthConfig::default() };
    let (mut distances, mut down) = (Vec::new(), Vec::new());
    let directions = fibonacci_sphere(64);
    for index in 0..12 {
        let room = Room::new(11, index, &config);
        let views = room.interior.camera_poses(3);
        assert_eq!(views[1], room.interior.camera_poses(2)[1], "a camera depends on the number of cameras");
        for view in views {
            let p = view.pose.position;
            let clearance =
                directions.iter().filter_map(|&d| room.hit(p, d, 50.0)).map(|hit| hit.1).fold(50.0, f32::min);
            assert!(room.interior.is_free(p, 0.09) && clearance > 0.09, "camera at {p} has a clearance of {clearance}");
            let pixels = (0..16 * 12).map(|k| (f64::from(k % 16) * 30.0 + 15.0, f64::from(k / 16) * 26.0 + 17.0));
            let mut visible: Vec<f32> = pixels
                .filter_map(|(u, v)| room.hit(p, view.pose.rotation * view.camera.direction(u, v), 50.0))
                .map(|hit| hit.1)
                .collect();
            visible.sort_unstable_by(f32::total_cmp);
            assert!(visible[0] > 0.12, "a surface at {} m is too close to the camera", visible[0]);
            distances.push(visible[visible.len() / 2]);
            down.push((view.pose.rotation * Vec3::NEG_Z).y);
        }
    }
    distances.sort_unstable_by(f32::total_cmp);
    let below = down.iter().filter(|&&y| y < -0.17).count();
    eprintln!("median distances {distances:.2?} m, {below} of {} look down", down.len());
    // Two or three of the twelve rooms have hardly any targets.
    assert!(distances[distances.len() / 2] < 1.5 && distances[distances.len() / 8] > 0.4, "{distances:?}");
    assert!(below as f32 > 0.6 * down.len() as f32);
}

#[test]
fn upright_photos_have_the_same_lens_across_the_longer_side() {
    let config = SynthConfig { upright_share: 0.5, tilt: Tilt::Uniform, pitch_deg: 40.0, ..SynthConfig::default() };
    let interior = Interior::generate(11, 2, &config).unwrap();
    let views = interior.camera_poses(40);
    let upright = views.iter().filter(|view| view.camera.height > view.camera.width).count();
    // 20 expected, standard deviation 3.2.
    assert!((10..=30).contains(&upright), "{upright}");
    let steep = |view: &lo_synth::CameraPose| (view.pose.rotation * Vec3::NEG_Z).y.asin().to_degrees().abs();
    // A uniform pitch up to 40° puts half above 20°, but steep views score lower.
    assert!(views.iter().all(|view| steep(view) < 40.1) && views.iter().filter(|view| steep(view) > 20.0).count() > 6);
    for view in &views {
        let long = 2.0 * view.camera.half_extent().atan().to_degrees();
        assert!((49.9..90.1).contains(&long), "{long}");
        let camera = &view.camera;
        assert_eq!(camera.width.max(camera.height), 480);
        assert_eq!((camera.cx, camera.cy), (0.5 * f64::from(camera.width), 0.5 * f64::from(camera.height)));
    }
}

#[test]
fn the_sun_shines_in_where_it_is_asked_to() {
    let weather_weights = [(Weather::Overcast, 1.0), (Weather::Clear, 1.0), (Weather::Night, 0.5)].into();
    let config = SynthConfig { sun_share: 1.0, weather_weights, windowless_share: 0.0, ..SynthConfig::default() };
    let (mut days, mut nights) = (0, 0);
    for index in 0..30 {
        let interior = Interior::generate(21, index, &config).unwrap();
        if interior.world.portals.is_empty() {
            continue;
        }
        if interior.description.weather == Weather::Night {
            nights += 1;
            assert!(interior.world.outdoors.sun.is_none());
            continue;
        }
        days += 1;
        let sun = interior.world.outdoors.sun.unwrap().direction;
        let faces = |portal: &lo_transport::Portal| {
            // The cross product of the edges points into the room, and so must the sunlight.
            let inward = portal.edges[0].cross(portal.edges[1]).normalize();
            let level = Vec3::new(-sun.x, 0.0, -sun.z).normalize();
            level.dot(inward) > 0.65
        };
        assert!(interior.world.portals.iter().any(faces), "{}: the sun is not in front of a window", interior.id);
    }
    assert!(days > 12 && nights > 1, "{days} {nights}");
}

#[test]
fn dim_rooms_are_dark_and_mixed_light_has_several_colours() {
    let figures = |config: &SynthConfig| {
        let rooms = (0..24).map(|index| Interior::generate(22, index, config).unwrap());
        let mut lm_m2 = Vec::new();
        let mut colours = 0;
        for room in rooms {
            assert!(config.dim_share == 0.0 || room.description.weather == Weather::Night);
            if room.description.lamps_on > 0 && room.description.flux_lm > 0.0 {
                lm_m2.push(room.description.flux_lm / room.description.area_m2);
            }
            let lamps = room.world.model.materials.iter().filter(|m| m.name == "lamp");
            let hues: HashSet<i32> = lamps.map(|m| (20.0 * (m.emissive[2] / m.emissive[0]).ln()) as i32).collect();
            colours += usize::from(hues.len() > 2);
        }
        lm_m2.sort_unstable_by(f32::total_cmp);
        (lm_m2[lm_m2.len() / 2], colours)
    };
    let night = SynthConfig { weather_weights: [(Weather::Night, 1.0)].into(), ..SynthConfig::default() };
    let (usual, few) = figures(&night);
    let (dim, _) = figures(&SynthConfig { dim_share: 1.0, ..night.clone() });
    let (_, many) = figures(&SynthConfig { mixed_light_share: 1.0, ..night });
    // Factors from e^−3.4 to e^−1.4.
    assert!(dim < 0.3 * usual && dim > 0.02 * usual, "{dim} of {usual} lm/m²");
    assert!(many > few + 4, "{many} rooms with more than two colours, {few} usually");
}

#[test]
fn worn_surfaces_have_a_relief_and_others_none() {
    let config = SynthConfig { worn_share: 1.0, ..SynthConfig::default() };
    for index in 0..4 {
        let worn = Interior::generate(23, index, &config).unwrap().world.model;
        let usual = Interior::generate(23, index, &SynthConfig::default()).unwrap().world.model;
        let reliefs = worn.materials.iter().filter(|m| m.normal_texture.is_some()).count();
        assert!(reliefs > 4 && worn.tangents.len() == worn.positions.len(), "{reliefs}");
        assert!(usual.materials.iter().all(|m| m.normal_texture.is_none()) && usual.tangents.is_empty());
        // Wear does not change the geometry.
        assert_eq!(worn.triangles.len(), usual.triangles.len());
    }
}
