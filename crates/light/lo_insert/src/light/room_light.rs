use std::sync::OnceLock;

use lo_cone::{Cone, ConeSample, ConeTracer, Sampling, Settings};
use lo_geometry::Vec3;
use lo_imaging::RadianceImage;
use lo_lights::AnalyticLights;
use lo_lookup::{Detail, PanoramaLookup, PhotoLookup, RadianceMap};
use lo_scene::{Frame, LitScene};

use crate::light::map;
use crate::light::samples::Lights;
use crate::quality::Counts;
use crate::surface::observed_surfaces::Surface;
use crate::{InsertError, Lighting};

/// Number of light samples; subsets of them are used.
const LIGHT_SAMPLES: usize = 1024;

/// Half-angle tangent of shadow rays.
const SHADOW_RAY_TANGENT: f32 = 0.01;

/// Assumed position of objects, as a share of the way from the camera to the surface.
const OBJECT_SHARE: f32 = 0.75;

/// Height in leaf edges above a real surface from which light is gathered; surfaces fill their leaves up to one edge.
const LIFT_EDGES: f32 = 1.5;

/// Light of the room: the lighting octree or a map at infinity, with its main lights split off. All positions and
/// directions are in the axes of the scene.
pub(crate) struct RoomLight {
    source: RoomLightSource,
    pub lights: Lights,
    /// Height in metres above a real surface from which light is gathered.
    pub lift_m: f32,
}

enum RoomLightSource {
    Octree {
        whole: Box<ConeTracer>,
        /// Reads `whole` interpolated between node centres, for reflections.
        smooth: Box<ConeTracer>,
        /// Reads the octree without the light samples, interpolated: cones start at the object and must not jump as
        /// it moves.
        rest: Box<ConeTracer>,
        lookups: Option<Box<Lookups>>,
        /// Lights outside of the octree, added by the user.
        added: Option<Box<AnalyticLights>>,
        leaf_edge_m: f32,
    },
    Map {
        whole: RadianceMap,
        rest: RadianceMap,
        /// The real surfaces and the photo of them, which glass shows.
        behind: Option<Box<Behind>>,
    },
}

/// Real surfaces behind glass under a map at infinity.
struct Behind {
    scene: LitScene,
    tracer: ConeTracer,
    /// Made for the first glass, because it takes some tenths of a second.
    photo: OnceLock<PhotoLookup>,
}

/// Returns positions of the room where objects are likely: before what the photo shows, and at the camera.
fn object_positions(frame: &Frame) -> Vec<Vec3> {
    let (depth, camera) = (&frame.depth_m, frame.depth_camera());
    let (columns, rows) = (3, 2);
    let cells = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row)));
    let position = |(column, row): (usize, usize)| {
        let at = |index: usize, count: usize, size: usize| (2 * index + 1) * size / (2 * count);
        let (x, y) = (at(column, columns, depth.width()), at(row, rows, depth.height()));
        let depth_m = OBJECT_SHARE * depth[(x, y)];
        (depth_m > 0.0).then(|| camera.unproject(x as f64 + 0.5, y as f64 + 0.5, f64::from(depth_m)))
    };
    std::iter::once(Vec3::ZERO).chain(cells.filter_map(position)).collect()
}

/// Lookups that sharpen reflections beyond the octree's resolution.
struct Lookups {
    photo: PhotoLookup,
    panorama: Option<PanoramaLookup>,
    /// Detail where neither photo nor panorama observes anything.
    detail: Option<Detail>,
}

impl Lookups {
    fn new(scene: &LitScene, tracer: &ConeTracer) -> Self {
        let photo = PhotoLookup::new(scene, tracer);
        let detail = Detail::new(scene, &photo);
        Self { photo, panorama: PanoramaLookup::new(scene, tracer), detail }
    }
}

/// A shadow ray from a point to a light sample.
pub(crate) struct LightRay {
    /// The lit point.
    pub place: Vec3,
    /// Start of the ray, above the leaves of the surface there.
    pub apex: Vec3,
    pub direction: Vec3,
    /// Distance to the light; infinite for lights at infinity.
    pub distance_m: f32,
}

/// Part of the light that is gathered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LightPart {
    /// All light.
    All,
    /// The light without that of the light samples.
    Rest,
}

impl RoomLight {
    pub fn new(scene: &LitScene, lighting: Lighting, counts: &Counts) -> Result<Self, InsertError> {
        match lighting {
            Lighting::Octree => Self::from_octree(scene, counts),
            Lighting::EnvironmentMap(map) => Self::from_map(scene, map, counts),
        }
    }

    fn from_octree(scene: &LitScene, counts: &Counts) -> Result<Self, InsertError> {
        let light = &scene.light;
        let leaf_edge_m = light.cube.node_edge_m(light.octree.depth());
        let tracer =
            |light: &lo_octree::LightOctree, settings: Settings| ConeTracer::new(light, settings).map(Box::new);
        let whole = tracer(light, Settings::default())?;
        let lookups = counts.photo_lookup.then(|| Box::new(Lookups::new(scene, &whole)));
        let interpolated = Settings { sampling: Sampling::Interpolated, ..Settings::default() };
        let smooth = tracer(light, interpolated)?;
        let (mut patches, rest) = lo_lights::split_octree(light, &whole, &object_positions(&scene.frame));
        let added = AnalyticLights::of(scene).map(Box::new);
        patches.extend(added.iter().flat_map(|lights| lights.patches()));
        let rest = tracer(&rest, Settings { min_transmittance: counts.min_transmittance, ..interpolated })?;
        let lights = Lights::sample(&patches, LIGHT_SAMPLES);
        let source = RoomLightSource::Octree { whole, smooth, rest, lookups, added, leaf_edge_m };
        Ok(Self { source, lights, lift_m: LIFT_EDGES * leaf_edge_m })
    }

    fn from_map(scene: &LitScene, map: RadianceImage, counts: &Counts) -> Result<Self, InsertError> {
        if map.width() < 2 || map.height() < 1 {
            return Err(InsertError::EnvironmentMap(format!("has only {} × {} pixels", map.width(), map.height())));
        }
        let clean = map.map(|p| p.map(|c| if c.is_finite() { c.clamp(0.0, 1e9) } else { 0.0 }));
        let (patches, rest) = map::split(&clean);
        let lights = Lights::sample(&patches, LIGHT_SAMPLES);
        let behind = if counts.photo_lookup {
            let tracer = ConeTracer::new(&scene.light, Settings::default())?;
            Some(Box::new(Behind { scene: scene.clone(), tracer, photo: OnceLock::new() }))
        } else {
            None
        };
        let source = RoomLightSource::Map { whole: RadianceMap::new(clean), rest: RadianceMap::new(rest), behind };
        Ok(Self { source, lights, lift_m: 0.0 })
    }

    /// Gathers radiance along cones; cones of one aperture should be adjacent. The distance to a map at infinity is
    /// infinite.
    pub fn gather(&self, part: LightPart, cones: &[Cone], samples: &mut Vec<ConeSample>) {
        self.gather_without_added(part, cones, samples);
        if part == LightPart::All {
            self.gather_added(cones, samples);
        }
    }

    fn gather_added(&self, cones: &[Cone], samples: &mut [ConeSample]) {
        if let RoomLightSource::Octree { added: Some(added), .. } = &self.source {
            added.add(cones, samples);
        }
    }

    /// [`RoomLight::gather`] without lights outside of the octree.
    fn gather_without_added(&self, part: LightPart, cones: &[Cone], samples: &mut Vec<ConeSample>) {
        samples.clear();
        match &self.source {
            RoomLightSource::Octree { smooth, rest, .. } => {
                samples.resize(cones.len(), ConeSample::default());
                let tracer = match part {
                    LightPart::All => smooth,
                    LightPart::Rest => rest,
                };
                tracer.trace_batch(cones, samples);
            }
            RoomLightSource::Map { whole, rest, .. } => {
                let map = if part == LightPart::All { whole } else { rest };
                samples.extend(cones.iter().map(|cone| ConeSample {
                    radiance: map.cone(cone.direction, cone.tan_half_angle).to_array(),
                    distance_m: f32::INFINITY,
                    opacity: 1.0,
                }));
            }
        }
    }

    /// Returns the exitant radiance of real surfaces with highlights restored, averaged over about a leaf. It is zero
    /// for a map at infinity.
    pub fn exitant_radiance(&self, surfaces: &[Surface]) -> Vec<Vec3> {
        let RoomLightSource::Octree { smooth, leaf_edge_m, .. } = &self.source else {
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
        // A greater distance means another surface.
        let near = |sample: &ConeSample| sample.distance_m < self.lift_m + 1.5 * leaf_edge_m;
        samples.iter().map(|sample| if near(sample) { Vec3::from(sample.radiance) } else { Vec3::ZERO }).collect()
    }

    /// Gathers radiance along the cones of a reflection with all lights ([`RoomLight::gather`]).
    ///
    /// Where the photo observes the surface that a cone meets, the photo's radiance is used; in unobserved regions,
    /// the photo's detail is added.
    ///
    /// Cones begin at [lifted](super::environment::Environment::lifted) points. For the lookup they are moved to the `apexes` that they
    /// were lifted from, because the photo resolves finer surfaces than the octree's leaves. Distances are then from
    /// there.
    pub fn gather_reflected(
        &self,
        with_detail: bool,
        apexes: &[Vec3],
        cones: &mut [Cone],
        samples: &mut Vec<ConeSample>,
    ) {
        self.gather_without_added(LightPart::All, cones, samples);
        if let RoomLightSource::Octree { lookups: Some(lookups), .. } = &self.source {
            if let Some(detail) = lookups.detail.as_ref().filter(|_| with_detail) {
                detail.add(cones, samples);
            }
            if let Some(panorama) = &lookups.panorama {
                panorama.sharpen(cones, samples);
            }
            lookups.photo.sharpen_from(apexes, cones, samples);
        }
        self.gather_added(cones, samples);
    }

    /// Prepares [`RoomLight::gather_behind`].
    pub fn prepare_behind(&self) {
        if let RoomLightSource::Map { behind: Some(behind), .. } = &self.source {
            behind.photo.get_or_init(|| PhotoLookup::new(&behind.scene, &behind.tracer));
        }
    }

    /// [`RoomLight::gather_reflected`] for cones that pass glass: under a map at infinity too, the photo is used
    /// where it observes what they meet, once it is [prepared](RoomLight::prepare_behind).
    pub fn gather_behind(&self, with_detail: bool, apexes: &[Vec3], cones: &mut [Cone], samples: &mut Vec<ConeSample>) {
        let behind = match &self.source {
            RoomLightSource::Map { behind: Some(behind), .. } => behind.photo.get().map(|photo| (behind, photo)),
            _ => None,
        };
        let Some((behind, photo)) = behind else {
            self.gather_reflected(with_detail, apexes, cones, samples);
            return;
        };
        self.gather(LightPart::All, cones, samples);
        let mut met = vec![ConeSample::default(); cones.len()];
        behind.tracer.trace_batch(cones, &mut met);
        for (met, sample) in met.iter_mut().zip(samples.iter()) {
            met.radiance = sample.radiance;
        }
        photo.sharpen_from(apexes, cones, &mut met);
        for (sample, met) in samples.iter_mut().zip(met) {
            // Elsewhere, the map stays at infinity.
            if met.radiance != sample.radiance {
                *sample = met;
            }
        }
    }

    /// Returns the share of each ray that real surfaces do not occlude.
    pub fn unoccluded_share(&self, rays: &[LightRay], shares: &mut Vec<f32>) {
        shares.clear();
        let RoomLightSource::Octree { whole, added, leaf_edge_m, .. } = &self.source else {
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
        // Suns are outside of the room and have their own occluders.
        let to_sun = |ray: &LightRay| ray.distance_m.is_infinite();
        if let Some(added) = added.as_ref().filter(|_| rays.iter().any(to_sun)) {
            let sunny: Vec<usize> = (0..rays.len()).filter(|&i| to_sun(&rays[i])).collect();
            let cones: Vec<Cone> = sunny.iter().map(|&i| cones[i]).collect();
            let mut free = Vec::new();
            added.unoccluded_to_suns(&cones, sunny.iter().map(|&i| rays[i].place), &mut free);
            sunny.iter().zip(free).for_each(|(&i, free)| shares[i] = free);
        }
    }
}
