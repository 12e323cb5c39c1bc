//! Generation of one room from its seed.

use std::ops::Range;
use std::sync::OnceLock;

use lo_geometry::Vec3;
use lo_imaging::RadianceImage;
use lo_mesh::{Material, Model, PreparedModel};
use lo_random::Stream;
use lo_transport::{Outdoors, World};

use crate::camera::{CameraPose, SolidBox, ViewpointSampler};
use crate::chance::{between, chance, weighted};
use crate::config::SynthConfig;
use crate::description::{Description, LightingMode, RoomKind, Weather};
use crate::error::SynthError;
use crate::object::Object;
use crate::palette::{Mood, Palette, Style};
use crate::pictures::Pictures;
use crate::plan::Plan;
use crate::room_builder::RoomBuilder;
use crate::{doors, furniture, lighting, outdoors, shell, windows};

/// A generated room with furniture, lamps and outdoors.
#[derive(Debug)]
pub struct Interior {
    /// Permanent id of the room: `synth-SEED-INDEX`.
    pub id: String,
    /// Input of light transport.
    pub world: World,
    /// Statistics of the room.
    pub description: Description,
    /// Objects of the model in triangle order.
    pub objects: Vec<Object>,
    seed: u64,
    index: u64,
    config: SynthConfig,
    plan: Plan,
    solids: Vec<SolidBox>,
    /// Bare triangles for ray queries, prepared on first use.
    prepared: OnceLock<PreparedModel>,
}

impl Interior {
    /// Generates room number `index` of `seed`. Equal arguments give identical bytes.
    ///
    /// # Errors
    /// If the config is out of range, or if a folder or file of outdoor panoramas or pictures cannot be read.
    pub fn generate(seed: u64, index: u64, config: &SynthConfig) -> Result<Self, SynthError> {
        config.validate()?;
        let mut random = lo_random::stream(seed, "synth room", index);
        let kinds: Vec<(RoomKind, f32)> = config.room_weights.iter().map(|(&kind, &w)| (kind, w)).collect();
        let kind = weighted(&mut random, &kinds);
        let drawn = |name: &str, share: f32| {
            let mut random = lo_random::stream(seed, name, index);
            chance(&mut random, share).then_some(random)
        };
        let mut weather = draw_weather(&mut random, config);
        let dim = drawn("synth dim", config.dim_share).map(|mut random| between(&mut random, -3.4, -1.4).exp());
        let mut sun = drawn("synth sun", config.sun_share);
        if dim.is_some() {
            weather = Weather::Night;
        } else if sun.is_some() && weather == Weather::Overcast {
            weather = Weather::Clear;
        }
        let mood = weighted(
            &mut random,
            &[
                (Mood::Dark, config.dark_share),
                (Mood::Light, config.light_share),
                (Mood::Warm, 1.0 - config.dark_share - config.light_share),
            ],
        );
        let clutter = draw_clutter(&mut random, config);
        let wet = kind == RoomKind::Bathroom;
        let rough = matches!(kind, RoomKind::Cellar | RoomKind::Workshop | RoomKind::Hall);
        let sober =
            rough || matches!(kind, RoomKind::Office | RoomKind::Classroom | RoomKind::Corridor | RoomKind::Laboratory);
        let mut style = Style::draw(&mut random, mood, wet, sober);
        style.rough = rough;
        let large = drawn("synth large", config.large_share).filter(|_| kind.can_be_large());
        let size_factor = large.map_or(1.0, |mut random| between(&mut random, 1.4f32.ln(), 3f32.ln()).exp());
        let glazed = drawn("synth glazed", config.glazed_share).filter(|_| kind.can_be_glazed());
        let plan = Plan::draw(&mut lo_random::stream(seed, "synth plan", index), kind, config, size_factor, glazed);
        let mut palette = Palette::new(seed, index, style);
        let litter = drawn("synth litter", config.litter_share).map(|mut random| between(&mut random, 0.4, 1.0));
        palette.has_prints = litter.is_some();
        palette.wear = drawn("synth worn", config.worn_share).map(|mut random| between(&mut random, 0.2, 1.0));
        palette.pictures = Pictures::load(&mut lo_random::stream(seed, "synth pictures", index), config)?;
        let mut builder = RoomBuilder::new(plan, palette, lo_random::stream(seed, "synth stage", index));
        let windows = builder.plan.walls.iter().flat_map(|w| &w.openings).filter(|o| o.is_window()).count();
        let mut lighting = draw_lighting(&mut random, config, weather, windows);
        if dim.is_some() && lighting == LightingMode::OverLit {
            lighting = LightingMode::Normal;
        }
        if drawn("synth daylit", config.daylit_share).is_some() && windows > 0 && weather != Weather::Night {
            lighting = LightingMode::Daylight;
        }
        builder.dimming = dim.unwrap_or(1.0);
        builder.mixed_light = drawn("synth mixed light", config.mixed_light_share);

        shell::build(&mut builder);
        doors::build(&mut builder);
        let portals = windows::build(&mut builder, weather == Weather::Night);
        builder.random = lo_random::stream(seed, "synth furniture", index);
        // Repeats by length, not by area, so that large rooms are emptier.
        for _ in 0..size_factor.round() as usize {
            furniture::furnish(&mut builder, kind, clutter, lighting);
        }
        let people = drawn("synth people", config.people_share).is_some() && kind != RoomKind::Bathroom;
        builder.random = lo_random::stream(seed, "synth life", index);
        furniture::add_people_and_litter(&mut builder, litter, people);
        builder.random = lo_random::stream(seed, "synth lamps", index);
        lighting::add_lamps(&mut builder, kind, lighting);
        let outdoors = if portals.is_empty() {
            // A world without portals would see the outdoors everywhere, so a room without windows gets black outdoors.
            Outdoors { radiance: RadianceImage::new(1, 1, vec![[0.0; 3]]), sun: None }
        } else {
            outdoors::generate(
                &mut lo_random::stream(seed, "synth outdoors", index),
                weather,
                &builder.plan,
                config,
                sun.as_mut(),
            )?
        };

        let description = describe(&builder, kind, weather, lighting, clutter);
        let solids = solids(&builder);
        let objects = objects(&builder);
        let RoomBuilder { plan, palette, shape, .. } = builder;
        let mut model = Model {
            positions: shape.positions,
            normals: shape.normals,
            uvs: [shape.uvs, Vec::new()],
            colors: shape.tints.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect(),
            triangles: shape.triangles,
            triangle_materials: shape.materials,
            materials: palette.materials,
            textures: palette.textures,
            ..Model::default()
        };
        model.complete_tangents();
        Ok(Self {
            id: format!("synth-{seed}-{index:06}"),
            world: World { model, outdoors, portals },
            description,
            seed,
            index,
            config: config.clone(),
            plan,
            objects,
            solids,
            prepared: OnceLock::new(),
        })
    }

    /// Returns the first `count` cameras of the room, in free space. Each camera is independent of `count`.
    pub fn camera_poses(&self, count: usize) -> Vec<CameraPose> {
        let sampler = self.sampler();
        let drawn = |name: &str, k: u64, share: f32| {
            share > 0.0 && chance(&mut self.stream(&format!("synth {name} {k}")), share)
        };
        let camera = |k: u64| {
            let upright = drawn("upright", k, self.config.upright_share);
            let near = drawn("near", k, self.config.close_up_share)
                .then(|| sampler.close_up(&mut self.stream(&format!("synth close-up {k}")), &self.config, upright));
            let random = || self.stream(&format!("synth camera {k}"));
            near.flatten().unwrap_or_else(|| {
                let low = drawn("low", k, self.config.low_camera_share);
                sampler.camera(&mut random(), &self.config, upright, low)
            })
        };
        (0..count as u64).map(camera).collect()
    }

    /// Returns up to `count` free points in a photo's frustum, in front of the visible surfaces.
    ///
    /// Points keep 15 cm from all surfaces, 10 cm in narrow places. Fewer are returned if no more are found.
    pub fn probe_positions(&self, view: &CameraPose, count: usize) -> Vec<Vec3> {
        let sampler = self.sampler();
        let p = view.pose.position;
        let q = view.pose.rotation;
        let numbers = [p.x, p.y, p.z, q.x, q.y, q.z, q.w, view.camera.fx as f32];
        let bytes: Vec<u8> = numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
        let mut random = self.stream(&format!("synth probes {}", lo_random::hash(&bytes)));
        (0..count).filter_map(|_| sampler.probe(&mut random, view)).collect()
    }

    /// Whether a point is inside the room and at least `margin_m` from all surfaces.
    pub fn is_free(&self, point: Vec3, margin_m: f32) -> bool {
        self.sampler().is_free(point, margin_m)
    }

    fn stream(&self, name: &str) -> Stream {
        lo_random::stream(self.seed, name, self.index)
    }

    fn sampler(&self) -> ViewpointSampler<'_> {
        let model = self.prepared.get_or_init(|| {
            let bare = Model {
                positions: self.world.model.positions.clone(),
                triangles: self.world.model.triangles.clone(),
                triangle_materials: vec![0; self.world.model.triangles.len()],
                materials: vec![Material::default()],
                ..Model::default()
            };
            PreparedModel::new(bare)
        });
        ViewpointSampler { plan: &self.plan, solids: &self.solids, model, objects: &self.objects }
    }
}

fn draw_weather(random: &mut Stream, config: &SynthConfig) -> Weather {
    if config.panorama_folder.is_some() && chance(random, config.panorama_share) {
        return Weather::Panorama;
    }
    let known = config.weather_weights.iter().filter(|(w, _)| **w != Weather::Panorama);
    let known: Vec<(Weather, f32)> = known.map(|(&w, &weight)| (w, weight)).collect();
    weighted(random, &known)
}

fn draw_clutter(random: &mut Stream, config: &SynthConfig) -> f32 {
    let normal = 1.0 - config.clean_share - config.cluttered_share;
    match weighted(random, &[(0, config.clean_share), (1, normal), (2, config.cluttered_share)]) {
        0 => between(random, 0.0, 0.15),
        1 => between(random, 0.25, 0.6),
        _ => between(random, 0.75, 1.0),
    }
}

/// Draws which lamps are on. Rooms with windows often need none by day.
fn draw_lighting(random: &mut Stream, config: &SynthConfig, weather: Weather, windows: usize) -> LightingMode {
    let single = (LightingMode::SingleLamp, config.single_lamp_share);
    let over = (LightingMode::OverLit, config.over_lit_share);
    let rest = 1.0 - single.1 - over.1;
    let dark_outside = weather == Weather::Night || windows == 0;
    let shares = if dark_outside { [0.0, 0.65, 0.35] } else { [0.5, 0.35, 0.15] };
    let [daylight, normal, mixed] = shares.map(|s| s * rest);
    weighted(
        random,
        &[
            (LightingMode::Daylight, daylight),
            (LightingMode::Normal, normal),
            (LightingMode::Mixed, mixed),
            single,
            over,
        ],
    )
}

fn describe(
    builder: &RoomBuilder,
    kind: RoomKind,
    weather: Weather,
    lighting: LightingMode,
    clutter: f32,
) -> Description {
    let openings = || builder.plan.walls.iter().flat_map(|w| &w.openings);
    let window_area: f32 = openings().filter(|o| o.is_window()).map(|o| o.width_m() * (o.h[1] - o.h[0])).sum();
    Description {
        kind,
        outline: builder.plan.outline,
        area_m2: builder.plan.area_m2(),
        height_m: builder.plan.height_m,
        sloped: builder.plan.slope.is_some(),
        weather,
        lighting,
        clutter,
        dark: builder.palette.style().mood == Mood::Dark,
        window_share: window_area.max(0.0) / builder.plan.area_m2(),
        windows: openings().filter(|o| o.is_window()).count(),
        doors: openings().filter(|o| !o.is_window()).count(),
        people: builder.objects.iter().filter(|object| object.name == "person").count(),
        lamps: builder.lamps,
        lamps_on: builder.lamps_on,
        flux_lm: builder.flux_lm,
        objects: builder.objects.len(),
        triangles: builder.shape.triangles.len(),
    }
}

fn objects(builder: &RoomBuilder) -> Vec<Object> {
    let placed = builder.objects.iter();
    let parts = |parts: &Range<usize>| builder.shape.parts[parts.clone()].iter().map(|p| p.triangles.clone()).collect();
    placed.map(|o| Object { name: o.name, support: o.support, parts: parts(&o.parts) }).collect()
}

/// Oriented boxes of all solids except the building's shell.
fn solids(builder: &RoomBuilder) -> Vec<SolidBox> {
    let enclosing = ["shell", "hallway", "reveal", "cornice"];
    let objects = builder.objects.iter().filter(|o| !enclosing.contains(&o.name));
    objects.flat_map(|o| builder.shape.parts[o.parts.clone()].iter()).map(|part| solid_box(builder, part)).collect()
}

fn solid_box(builder: &RoomBuilder, part: &crate::solids::ShapePart) -> SolidBox {
    let back = part.rotation.inverse();
    let corners = builder.shape.triangles[part.triangles.clone()].iter().flatten();
    let (min, max) = corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), &v| {
        let p = back * builder.shape.positions[v as usize];
        (min.min(p), max.max(p))
    });
    SolidBox { center: part.rotation * ((min + max) * 0.5), rotation: part.rotation, half: (max - min) * 0.5 }
}
