use std::collections::{BTreeSet, HashMap};
use std::f32::consts::PI;

use lo_events::{Cancelled, OnEvent, Stage, Warning, progress, stage, stage_of_steps, warn};
use lo_geometry::{Ray, Vec3};
use lo_imaging::{Image, Photo, RadianceImage};
use lo_scene::{Frame, LitScene};
use rayon::prelude::*;

use crate::light::aperture::cone_tangent;
use crate::light::environment::Environment;
use crate::light::gather::{Gatherer, object_lights};
use crate::matte::alpha::Matte;
use crate::objects::object::Object;
use crate::objects::patches::{self, patches};
use crate::objects::tracing::Objects;
use crate::quality::Counts;
use crate::shade::composite::{Composite, Layers};
use crate::shade::gloss::Gloss;
use crate::shade::shader::Shader;
use crate::shade::visibility::{TILE, TileView, Viewer, coverage_pattern, is_in_view, seen_window};
use crate::shadow::backdrop::Backdrop;
use crate::shadow::field::{Caster, ShadowField};
use crate::shadow::ratio::ShadowRatio;
use crate::shadow::silhouette::Silhouettes;
use crate::surface::occluders::Occluders;
use crate::surface::receivers::PATTERNS;
use crate::surface::seen_surfaces::{SurfaceMap, without_photo};
use crate::{Base, InsertError, Instance, Lighting, Quality};

/// Share of the base that must be carried, or the object falls.
const MIN_SUPPORT: f32 = 0.5;

/// Another object carries what stands this near above or below its surface, in metres.
const CARRIES_M: f32 = 0.01;

/// Longer side from which on a photo is large.
const LARGE_SIDE: usize = 1440;

/// What the picture shows of an object.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    /// Any of it.
    shows: bool,
    /// Something stands before it.
    hides: bool,
}

/// Puts objects into the photo of one scene.
///
/// It holds what does not depend on the objects: the tracers with the main lights split off, the real surfaces, and the light on them
/// as far as it was needed.
pub struct Inserter {
    frame: Frame,
    environment: Environment,
    occluders: Occluders,
    /// For the light that real surfaces in the objects' shadow send to them.
    coarse: ShadowField,
    fine: ShadowField,
    directions: Vec<Vec3>,
    counts: Counts,
    /// The octree's cube, for warnings.
    cube: lo_geometry::Cube,
    /// Of what carries objects: 0 for no mirror image.
    floor_gloss: f32,
}

impl Inserter {
    /// Prepares a scene; takes some tenths of a second at draft quality, in which the light on all real surfaces is gathered at once.
    ///
    /// # Errors
    /// Where the environment map is empty or black, or the octree cannot be traced: where its nodes have lobes, give it as it is seen
    /// from the objects ([`LightOctree::seen_from`](lo_octree::LightOctree::seen_from)).
    pub fn new(scene: &LitScene, lighting: Lighting, quality: Quality) -> Result<Self, InsertError> {
        let inserter = Self::unprepared(scene, lighting, quality)?;
        if quality == Quality::Draft {
            inserter.prepare();
        }
        Ok(inserter)
    }

    /// [`Inserter::new`] that gathers light only when a picture needs it: for a single picture in this light.
    ///
    /// # Errors
    /// As of [`Inserter::new`].
    pub fn unprepared(scene: &LitScene, lighting: Lighting, quality: Quality) -> Result<Self, InsertError> {
        let counts = quality.counts();
        let environment = Environment::new(scene, lighting, &counts)?;
        // Readings between two surfaces are no receivers of light, but without them an occluder's edge would have gaps.
        let given = without_photo(&scene.frame);
        let clean = given.without_flying_pixels();
        let surfaces = SurfaceMap::new(&clean);
        let occluders = Occluders::new(&surfaces, &given, scene.origin.predicted_depth);
        let up = scene.up();
        let floor = scene.room.as_ref().and_then(|room| room.floor());
        let field = |side| ShadowField::new(surfaces.resampled(&clean, side), up, floor, &counts);
        let (coarse, fine) = (field(counts.coarse_shadow_side), field(counts.shadow_side));
        Ok(Self {
            frame: scene.frame.clone(),
            environment,
            occluders,
            coarse,
            fine,
            directions: lo_geometry::fibonacci_sphere(counts.diffuse_cones),
            counts,
            cube: scene.light.cube,
            floor_gloss: 0.0,
        })
    }

    /// Gathers the light on all real surfaces now, so that no picture has to.
    pub fn prepare(&self) {
        self.coarse.prepare(&self.environment);
        self.fine.prepare(&self.environment);
    }

    /// The same with a glossy support: a clear coat of perceptual roughness 1 − `floor_gloss` that mirrors the objects. With 0, as without this, it
    /// mirrors nothing.
    #[must_use]
    pub fn with_floor_gloss(self, floor_gloss: f32) -> Self {
        Self { floor_gloss: floor_gloss.clamp(0.0, 1.0), ..self }
    }

    /// Keeps reflections as smooth as the octree where nothing was seen, without the photo's
    /// [`Detail`](lo_lookup::Detail).
    #[must_use]
    pub fn without_detail(mut self) -> Self {
        self.environment.remove_detail();
        self
    }

    /// The same for the photo at another size; what is held of the scene does not depend on that.
    #[must_use]
    pub fn with_photo(mut self, photo: Photo) -> Self {
        self.frame.camera = self.frame.camera.resized(photo.width() as u32, photo.height() as u32);
        self.frame.photo = photo;
        self
    }

    /// One picture with objects that shadow, hide, light and mirror one another; their order does not matter, and without any it is the photo.
    /// An object that shows nothing gives its shadow alone, and a warning.
    ///
    /// # Errors
    /// [`InsertError::Object`] where a number of a placement is not usable, or a model has no extent; [`Cancelled`](lo_events::Cancelled)
    /// where `on_event` breaks off.
    pub fn render(&self, instances: &[Instance], on_event: OnEvent<'_>) -> Result<Composite, InsertError> {
        let objects = Objects::new(instances)?;
        let counts = &self.counts;
        let lights = object_lights(&self.environment, &objects, counts.object_lights, counts.share_light_visibility);
        let share_sr = 4.0 * PI / self.directions.len() as f32;
        let tan_half_angle = cone_tangent(counts.diffuse_aperture * share_sr);
        let gatherer = |shadow, radiosity| Gatherer {
            environment: &self.environment,
            objects: &objects,
            radiosity,
            shadow,
            directions: &self.directions,
            tan_half_angle,
            lights: &lights,
        };

        let silhouettes: Vec<Silhouettes> = objects
            .iter()
            .map(|object| {
                let lights = self.environment.lights();
                Silhouettes::new(lights, counts.background_lights, PATTERNS, object, counts.silhouette_side)
            })
            .collect();
        let backdrop = |object: &Object| Backdrop::new(&self.environment, object.centre_m, counts.backdrop_side);
        let backdrops: Vec<Backdrop> = objects.iter().map(backdrop).collect();
        let caster = |radiosity| Caster {
            objects: &objects,
            environment: &self.environment,
            silhouettes: &silhouettes,
            backdrops: &backdrops,
            radiosity,
        };
        let coarse = self.coarse.ratio(&caster(None), Stage::CoarseShadow, on_event)?;
        let patches = patches(&objects, counts.patches);
        let radiosity = stage_of_steps(on_event, Stage::Radiosity, |on_event| {
            let direct = patches::lit(&gatherer(Some(&coarse), None), &patches);
            progress(on_event, Stage::Radiosity, 1, 2)?;
            let reflected = Gatherer { radiosity: Some(&direct), ..gatherer(Some(&coarse), None) };
            Ok::<_, Cancelled>(patches::lit(&reflected, &patches))
        })?;
        let shadow = if counts.refines_shadow {
            let smooth = self.coarse.ratio(&caster(Some(&radiosity)), Stage::CoarseShadow, on_event)?;
            self.fine.refined(&smooth, &caster(Some(&radiosity)), Stage::FineShadow, on_event)?
        } else {
            self.fine.ratio(&caster(Some(&radiosity)), Stage::FineShadow, on_event)?
        };

        let mut layers = Layers::new(self.frame.photo.width(), self.frame.photo.height());
        let seen = self.shade_objects(gatherer(Some(&shadow), Some(&radiosity)), &mut layers, on_event)?;
        self.warnings(instances, &objects, &seen).try_for_each(|warning| warn(on_event, warning))?;
        let gloss = (self.floor_gloss > 0.0).then(|| Gloss {
            objects: &objects,
            environment: &self.environment,
            radiosity: &radiosity,
            occluders: &self.occluders,
            camera: self.frame.camera,
            roughness: 1.0 - self.floor_gloss,
            samples: counts.gloss_samples,
        });
        let gloss = gloss.filter(|_| objects.iter().any(|object| object.support.is_some()));
        Ok(stage(on_event, Stage::Composite, || {
            let reflection = gloss.map(|gloss| gloss.reflection(|pixel| self.radiance(pixel)));
            self.compose(layers, &shadow, reflection)
        })?)
    }

    /// Linear radiance of a photo pixel.
    fn radiance(&self, pixel: (usize, usize)) -> Vec3 {
        Vec3::from(self.frame.photo.linear_at(pixel)) * self.frame.exposure
    }

    /// Shades what is seen of the objects; tells for each how much of it that is.
    fn shade_objects(
        &self,
        gatherer: Gatherer,
        layers: &mut Layers,
        on_event: OnEvent<'_>,
    ) -> Result<Vec<Seen>, Cancelled> {
        let objects = gatherer.objects;
        let samples = coverage_pattern(self.counts.coverage);
        let camera = self.frame.camera;
        let shader = Shader { gatherer, specular_cones: self.counts.specular_cones, stride: self.shade_stride() };
        let windows: Vec<Option<_>> = objects.iter().map(|object| seen_window(&camera, object)).collect();
        let mut seen = vec![Seen::default(); objects.len()];
        if windows.iter().all(Option::is_none) {
            return Ok(seen);
        }
        let starts = |from: usize, to: usize| (from / TILE * TILE..to).step_by(TILE);
        let of_window = |&(left, top, right, bottom): &(usize, usize, usize, usize)| {
            starts(top, bottom).flat_map(move |y| starts(left, right).map(move |x| (y, x)))
        };
        // Row by row, each once.
        let tiles: BTreeSet<(usize, usize)> = windows.iter().flatten().flat_map(of_window).collect();
        let (width, height) = (self.frame.photo.width(), self.frame.photo.height());
        let tiles: Vec<_> =
            tiles.into_iter().map(|(y, x)| (x, y, (x + TILE).min(width), (y + TILE).min(height))).collect();
        let (view, fronts) = stage(on_event, Stage::Visibility, || {
            let colour = |pixel| self.colour(pixel);
            let matte = |(object, window): (&Object, &Option<_>)| {
                window.map(|window| Matte::new(&camera, object, &self.occluders, colour, window))
            };
            let mattes: Vec<Option<Matte>> = objects.iter().zip(&windows).map(matte).collect();
            let (occluders, thrift) = (&self.occluders, self.counts.thrift);
            let viewer = Viewer { camera, objects, occluders, mattes: &mattes, samples: &samples, thrift };
            let views: Vec<TileView> = tiles.into_par_iter().map(|tile| viewer.tile(tile)).collect();
            let mut view = TileView::default();
            for tile in views {
                view.fragments.extend(tile.fragments);
                view.hidden.extend(tile.hidden);
            }
            // What hides several objects along one edge: the mean of what is known of it.
            let mut fronts: HashMap<(usize, usize), (Vec3, f32)> = HashMap::new();
            for (pixel, front) in mattes.into_iter().flatten().flat_map(|matte| matte.fronts) {
                let (sum, count) = fronts.entry(pixel).or_default();
                (*sum, *count) = (*sum + front, *count + 1.0);
            }
            (view, fronts)
        })?;
        let radiance = stage_of_steps(on_event, Stage::Shading, |on_event| shader.shade(&view.fragments, on_event))?;
        layers.add(&view, &radiance);
        for (pixel, (sum, count)) in fronts {
            let linear = |colour: Vec3| Vec3::from(colour.to_array().map(lo_imaging::linear_from_srgb));
            layers.clear_edge(pixel, (linear(sum / count) - linear(self.colour(pixel))) * self.frame.exposure);
        }
        view.fragments.iter().for_each(|fragment| seen[fragment.object].shows |= fragment.weight > 0.0);
        view.hidden.iter().for_each(|hidden| seen[hidden.object].hides |= hidden.share > 0.0);
        for ((object, seen), window) in objects.iter().zip(&mut seen).zip(&windows) {
            // Behind another one it has no part in the picture of all.
            seen.hides |= !seen.shows && window.is_some_and(|window| is_in_view(&camera, object, window));
        }
        Ok(seen)
    }

    /// Colour of a photo pixel as the eye tells colours apart: in sRGB's range.
    fn colour(&self, pixel: (usize, usize)) -> Vec3 {
        match &self.frame.photo {
            Photo::Srgb8(image) => Vec3::from(image[pixel].map(f32::from)) / 255.0,
            Photo::Linear(image) => {
                Vec3::from(image[pixel].map(|value| lo_imaging::srgb_from_linear(value.clamp(0.0, 1.0))))
            }
        }
    }

    /// Pixels along the side of the blocks that share diffuse light: as many as cover about as much of the picture in large photos
    /// as in small ones.
    fn shade_stride(&self) -> usize {
        let large = self.frame.photo.width().max(self.frame.photo.height()) >= LARGE_SIDE;
        self.counts.shade_stride[usize::from(large)]
    }

    fn warnings(
        &self,
        instances: &[Instance],
        objects: &Objects,
        seen: &[Seen],
    ) -> impl Iterator<Item = Warning> + use<> {
        let of_object = |object: usize| {
            let Seen { shows, hides } = seen[object];
            let nothing =
                if hides { Warning::ObjectHidden { object } } else { Warning::ObjectOutsidePicture { object } };
            let nothing = (!shows).then_some(nothing);
            let is_outside = !self.cube.contains(objects[object].centre_m);
            let outside = is_outside.then_some(Warning::ObjectOutsideOctree { object });
            let overhang = self
                .supported_share(object, &instances[object], objects)
                .filter(|supported| *supported < MIN_SUPPORT)
                .map(|supported| Warning::ObjectOverhangs { object, supported });
            nothing.into_iter().chain(outside).chain(overhang)
        };
        let warnings: Vec<Warning> = (0..objects.len()).flat_map(of_object).collect();
        let pairs: Vec<Warning> = objects.intersecting().map(|objects| Warning::ObjectsIntersect { objects }).collect();
        warnings.into_iter().chain(pairs)
    }

    /// Share of the base of a resting object that real surfaces or other objects carry, where half of it and more can be judged.
    fn supported_share(&self, index: usize, instance: &Instance, objects: &Objects) -> Option<f32> {
        let &Instance { model, placement } = instance;
        placement.support?;
        let on_other = |point: Vec3| {
            let down = Ray { origin: point + placement.up * CARRIES_M, direction: -placement.up };
            let mut others = objects.iter().enumerate().filter(|&(i, _)| i != index);
            others.any(|(_, other)| other.blocks(&down, 2.0 * CARRIES_M))
        };
        let known: Vec<Option<bool>> = Base::new(model)
            .spots(placement.scale, placement.rotation())
            .map(|spot| placement.position_m + spot)
            .map(|point| {
                if on_other(point) {
                    return Some(true);
                }
                self.occluders.carries(&self.frame.camera, point, placement.up)
            })
            .collect();
        let count = |state: bool| known.iter().filter(|known| **known == Some(state)).count();
        let (carried, free) = (count(true), count(false));
        (2 * (carried + free) >= known.len() && carried + free > 0).then(|| carried as f32 / (carried + free) as f32)
    }

    fn compose(&self, layers: Layers, shadow: &ShadowRatio, reflection: Option<Image<Vec3>>) -> Composite {
        let (width, height) = (self.frame.photo.width(), self.frame.photo.height());
        // Beyond what the objects reach nothing is looked up.
        let (left, top, right, bottom) = shadow.reach(width, height);
        let mut ratio = vec![[1.0; 3]; width * height];
        let within = ratio.par_chunks_mut(width).enumerate().skip(top).take(bottom.saturating_sub(top));
        within.for_each(|(y, row)| {
            let v = (y as f32 + 0.5) / height as f32;
            for (x, ratio) in row.iter_mut().enumerate().take(right).skip(left) {
                let u = (x as f32 + 0.5) / width as f32;
                let seen = || Some(self.occluders.at(f64::from(u), f64::from(v))?.position_m);
                *ratio = shadow.for_photo(u, v, seen).to_array();
            }
        });
        let reflection = reflection.map(|image| image.map(|radiance| radiance.to_array()));
        Composite::new(&self.frame, layers, RadianceImage::new(width, height, ratio), reflection)
    }
}
