use lo_cone::{Cone, ConeSample, ConeTracer, Sampling, Settings};
use lo_geometry::{Plane, Vec3};
use lo_imaging::RadianceImage;
use lo_lights::AnalyticLights;
use lo_lookup::{Detail, PanoramaLookup, PhotoLookup, RadianceMap};
use lo_scene::LitScene;

use crate::light::map;
use crate::light::samples::Lights;
use crate::quality::Counts;
use crate::surface::seen_surfaces::Surface;
use crate::{InsertError, Lighting};

/// Light samples that are kept; subsets of them are used.
const LIGHT_SAMPLES: usize = 1024;

/// Half-angle tangent of the rays that ask whether a light is seen.
const SHADOW_RAY_TANGENT: f32 = 0.01;

/// Real surfaces fill the octree's leaves up to an edge above themselves; light is gathered from this many leaf edges above.
const LIFT_EDGES: f32 = 1.5;

/// What shines on the object: the lighting octree or a map at infinity, with its main lights split off.
pub(crate) struct Environment {
    source: Source,
    lights: Lights,
    /// Height above a real surface from which light is gathered, in metres.
    pub lift_m: f32,
}

enum Source {
    Octree {
        whole: Box<ConeTracer>,
        /// Reads `whole` between node centres, for reflections.
        smooth: Box<ConeTracer>,
        /// Reads the rest between node centres: the cones start where the object is, and must not jump as it moves.
        dimmed: Box<ConeTracer>,
        pictures: Option<Box<Pictures>>,
        /// Lights that no octree holds: added ones.
        beside: Option<Box<AnalyticLights>>,
        leaf_edge_m: f32,
    },
    Map {
        whole: RadianceMap,
        dimmed: RadianceMap,
    },
}

/// Pictures that reflections show instead of the octree's blocks and smooth estimates.
struct Pictures {
    photo: PhotoLookup,
    panorama: Option<PanoramaLookup>,
    /// Of what neither of them shows.
    detail: Option<Detail>,
}

impl Pictures {
    fn new(scene: &LitScene, tracer: &ConeTracer) -> Self {
        let photo = PhotoLookup::new(scene, tracer);
        let detail = Detail::new(scene, &photo);
        Self { photo, panorama: PanoramaLookup::new(scene, tracer), detail }
    }
}

/// A ray from a place that a light sample lights.
pub(crate) struct LightRay {
    /// The place.
    pub place: Vec3,
    /// Where the ray begins, above the leaves of the surface there.
    pub apex: Vec3,
    pub direction: Vec3,
    /// Infinite for lights at infinity.
    pub distance_m: f32,
}

/// Which light is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// All of it.
    Whole,
    /// Without what the light samples carry.
    Dimmed,
}

impl Environment {
    pub fn new(scene: &LitScene, lighting: Lighting, counts: &Counts) -> Result<Self, InsertError> {
        match lighting {
            Lighting::Octree => Self::from_octree(scene, counts),
            Lighting::EnvironmentMap(map) => Self::from_map(map),
        }
    }

    fn from_octree(scene: &LitScene, counts: &Counts) -> Result<Self, InsertError> {
        let light = &scene.light;
        let leaf_edge_m = light.cube.node_edge_m(light.octree.depth());
        let tracer =
            |light: &lo_octree::LightOctree, settings: Settings| ConeTracer::new(light, settings).map(Box::new);
        let whole = tracer(light, Settings::default())?;
        let pictures = counts.photo_lookup.then(|| Box::new(Pictures::new(scene, &whole)));
        let interpolated = Settings { sampling: Sampling::Interpolated, ..Settings::default() };
        let smooth = tracer(light, interpolated)?;
        // The back of a closed room's shell looks into empty space: nothing is met there before the end of the cube.
        let faces_room = |origin: Vec3, normal: Vec3| {
            let cone = Cone { origin, direction: normal, tan_half_angle: SHADOW_RAY_TANGENT };
            whole.trace(&cone).opacity > 0.5
        };
        let (mut patches, dimmed) = lo_lights::split_octree(light, faces_room);
        let beside = AnalyticLights::of(scene).map(Box::new);
        patches.extend(beside.iter().flat_map(|lights| lights.patches()));
        let dimmed = tracer(&dimmed, Settings { min_transmittance: counts.min_transmittance, ..interpolated })?;
        let lights = Lights::sample(&patches, LIGHT_SAMPLES);
        let source = Source::Octree { whole, smooth, dimmed, pictures, beside, leaf_edge_m };
        Ok(Self { source, lights, lift_m: LIFT_EDGES * leaf_edge_m })
    }

    fn from_map(map: RadianceImage) -> Result<Self, InsertError> {
        if map.width() < 2 || map.height() < 1 {
            return Err(InsertError::EnvironmentMap(format!("has only {} × {} pixels", map.width(), map.height())));
        }
        let clean = map.map(|p| p.map(|c| if c.is_finite() { c.clamp(0.0, 1e9) } else { 0.0 }));
        let (patches, dimmed) = map::split(&clean);
        let lights = Lights::sample(&patches, LIGHT_SAMPLES);
        let source = Source::Map { whole: RadianceMap::new(clean), dimmed: RadianceMap::new(dimmed) };
        Ok(Self { source, lights, lift_m: 0.0 })
    }

    /// Removes the detail of what was not seen from reflections.
    pub fn remove_detail(&mut self) {
        if let Source::Octree { pictures: Some(pictures), .. } = &mut self.source {
            pictures.detail = None;
        }
    }

    pub fn lights(&self) -> &Lights {
        &self.lights
    }

    /// What each cone sees; cones of one aperture should lie next to each other. At infinity the distance is infinite.
    pub fn gather(&self, part: Part, cones: &[Cone], samples: &mut Vec<ConeSample>) {
        self.gather_room(part, cones, samples);
        if part == Part::Whole {
            self.add_beside(cones, samples);
        }
    }

    fn add_beside(&self, cones: &[Cone], samples: &mut [ConeSample]) {
        if let Source::Octree { beside: Some(beside), .. } = &self.source {
            beside.add(cones, samples);
        }
    }

    /// [`Environment::gather`] without the lights beside the octree.
    fn gather_room(&self, part: Part, cones: &[Cone], samples: &mut Vec<ConeSample>) {
        samples.clear();
        match &self.source {
            Source::Octree { smooth, dimmed, .. } => {
                samples.resize(cones.len(), ConeSample::default());
                let tracer = match part {
                    Part::Whole => smooth,
                    Part::Dimmed => dimmed,
                };
                tracer.trace_batch(cones, samples);
            }
            Source::Map { whole, dimmed } => {
                let map = if part == Part::Whole { whole } else { dimmed };
                samples.extend(cones.iter().map(|cone| ConeSample {
                    radiance: map.cone(cone.direction, cone.tan_half_angle).to_array(),
                    distance_m: f32::INFINITY,
                    opacity: 1.0,
                }));
            }
        }
    }

    /// Radiance that real surfaces give off, with highlights restored, over about a leaf; nothing is known of it by a map at infinity.
    pub fn given_off(&self, surfaces: &[Surface]) -> Vec<Vec3> {
        let Source::Octree { smooth, leaf_edge_m, .. } = &self.source else {
            return vec![Vec3::ZERO; surfaces.len()];
        };
        let down = |surface: &Surface| Cone {
            origin: surface.position_m + surface.normal * self.lift_m,
            direction: -surface.normal,
            tan_half_angle: 0.5 / LIFT_EDGES,
        };
        let cones: Vec<Cone> = surfaces.iter().map(down).collect();
        let mut samples = vec![ConeSample::default(); cones.len()];
        smooth.trace_batch(&cones, &mut samples);
        // What lies further off is another surface.
        let near = |sample: &ConeSample| sample.distance_m < self.lift_m + 1.5 * leaf_edge_m;
        samples.iter().map(|sample| if near(sample) { Vec3::from(sample.radiance) } else { Vec3::ZERO }).collect()
    }

    /// Radiance along the cones of a reflection with all lights ([`Environment::gather`]). Where the photo shows the surface
    /// that is met, the photo's radiance is used; where nothing was seen, the photo's detail is added. Cones begin at
    /// [lifted](Environment::lifted) places, and are lowered to the `apexes` that they were lifted from where the photo is looked up: it knows surfaces
    /// finer than the octree's leaves. Distances are from where the cones begin then.
    pub fn gather_reflected(&self, apexes: &[Vec3], cones: &mut [Cone], samples: &mut Vec<ConeSample>) {
        self.gather_room(Part::Whole, cones, samples);
        if let Source::Octree { pictures: Some(pictures), .. } = &self.source {
            if let Some(detail) = &pictures.detail {
                detail.add(cones, samples);
            }
            if let Some(panorama) = &pictures.panorama {
                panorama.sharpen(cones, samples);
            }
            pictures.photo.sharpen_from(apexes, cones, samples);
        }
        self.add_beside(cones, samples);
    }

    /// Share of each ray's way that real surfaces leave free.
    pub fn unoccluded_share(&self, rays: &[LightRay], shares: &mut Vec<f32>) {
        shares.clear();
        let Source::Octree { whole, beside, leaf_edge_m, .. } = &self.source else {
            shares.resize(rays.len(), 1.0);
            return;
        };
        let ray =
            |ray: &LightRay| Cone { origin: ray.apex, direction: ray.direction, tan_half_angle: SHADOW_RAY_TANGENT };
        let cones: Vec<Cone> = rays.iter().map(ray).collect();
        let mut samples = vec![ConeSample::default(); rays.len()];
        whole.trace_batch(&cones, &mut samples);
        let free =
            |(ray, sample): (&LightRay, &ConeSample)| lo_lights::unoccluded_share(ray.distance_m, sample, *leaf_edge_m);
        shares.extend(rays.iter().zip(&samples).map(free));
        // Suns are beyond the room, and other things hide them.
        let to_sun = |ray: &LightRay| ray.distance_m.is_infinite();
        if let Some(beside) = beside.as_ref().filter(|_| rays.iter().any(to_sun)) {
            let sunny: Vec<usize> = (0..rays.len()).filter(|&i| to_sun(&rays[i])).collect();
            let cones: Vec<Cone> = sunny.iter().map(|&i| cones[i]).collect();
            let mut free = Vec::new();
            beside.unoccluded_to_suns(&cones, sunny.iter().map(|&i| rays[i].place), &mut free);
            sunny.iter().zip(free).for_each(|(&i, free)| shares[i] = free);
        }
    }

    /// Where to gather light for a point of an object that rests on `support`: high enough above the leaves of that surface.
    pub fn lifted(&self, point: Vec3, support: Option<Plane>) -> Vec3 {
        let Some(plane) = support else { return point };
        let height_m = plane.signed_distance_m(point);
        point + plane.normal * (self.lift_m - height_m).clamp(0.0, 2.0 * self.lift_m)
    }
}
