use std::f32::consts::PI;

use lo_events::{Cancelled, OnEvent, Stage, Warning, progress, stage, stage_of_steps, warn};
use lo_geometry::Vec3;
use lo_imaging::{Image, Photo, RadianceImage};
use lo_mesh::PreparedModel;
use lo_scene::{Frame, Scene};
use rayon::prelude::*;

use crate::aperture::cone_tangent;
use crate::backdrop::Backdrop;
use crate::composite::{Composite, Layers};
use crate::environment::Environment;
use crate::gather::{Gatherer, object_lights};
use crate::gloss::Gloss;
use crate::matte::Matte;
use crate::object::Object;
use crate::occluders::Occluders;
use crate::patches::{self, patches};
use crate::quality::Counts;
use crate::receivers::PATTERNS;
use crate::shade::Shader;
use crate::shadow::{Caster, ShadowField};
use crate::shadow_ratio::ShadowRatio;
use crate::silhouette::Silhouettes;
use crate::surface::{SurfaceMap, without_photo};
use crate::visibility::{TILE, TileView, Viewer, coverage_pattern, seen_window};
use crate::{Base, InsertError, Lighting, Placement, Quality};

/// Share of the base that must be carried, or the object falls.
const MIN_SUPPORT: f32 = 0.5;

/// Longer side from which on a photo is large.
const LARGE_SIDE: usize = 1440;

/// Puts objects into the photo of one scene.
///
/// It holds what does not depend on the object: the tracers with the main lights split off, the real surfaces, and the light on them
/// as far as it was needed.
pub struct Inserter {
    frame: Frame,
    environment: Environment,
    occluders: Occluders,
    /// For the light that real surfaces in the object's shadow send to it.
    coarse: ShadowField,
    fine: ShadowField,
    directions: Vec<Vec3>,
    counts: Counts,
    /// The octree's cube, for warnings.
    cube: lo_geometry::Cube,
    /// Of what carries the object: 0 for no mirror image.
    floor_gloss: f32,
}

impl Inserter {
    /// Prepares a scene; takes some tenths of a second at draft quality, in which the light on all real surfaces is gathered at once.
    ///
    /// # Errors
    /// Where the environment map is empty or black, or the octree cannot be traced: where its nodes have lobes, give it as it is seen
    /// from the object ([`LightOctree::seen_from`](lo_octree::LightOctree::seen_from)).
    pub fn new(scene: &Scene, lighting: Lighting, quality: Quality) -> Result<Self, InsertError> {
        let counts = quality.counts();
        let environment = Environment::new(scene, lighting, &counts)?;
        // Readings between two surfaces are no receivers of light, but without them an occluder's edge would have gaps.
        let given = without_photo(&scene.frame);
        let clean = given.without_flying_pixels();
        let surfaces = SurfaceMap::new(&clean);
        let occluders = Occluders::new(&surfaces, &given, scene.predicted_depth);
        let up = scene.room.as_ref().map_or(Vec3::Y, |room| room.up);
        let floor = scene.room.as_ref().and_then(|room| room.floor());
        let field = |side| ShadowField::new(surfaces.resampled(&clean, side), up, floor, &counts);
        let (coarse, fine) = (field(counts.coarse_shadow_side), field(counts.shadow_side));
        if quality == Quality::Draft {
            coarse.prepare(&environment);
            fine.prepare(&environment);
        }
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

    /// The same with a glossy support: a clear coat of perceptual roughness 1 − `floor_gloss` that mirrors the object. With 0, as without this, it
    /// mirrors nothing.
    #[must_use]
    pub fn with_floor_gloss(self, floor_gloss: f32) -> Self {
        Self { floor_gloss: floor_gloss.clamp(0.0, 1.0), ..self }
    }

    /// One picture with the object at one place. An object that shows nothing gives the photo with its shadow, and a warning.
    ///
    /// # Errors
    /// Where a number of the placement is not usable, or the model has no extent; [`Cancelled`](lo_events::Cancelled) where `on_event`
    /// breaks off.
    pub fn render(
        &self,
        model: &PreparedModel,
        placement: &Placement,
        on_event: OnEvent<'_>,
    ) -> Result<Composite, InsertError> {
        placement.check()?;
        let object = Object::new(model, placement)?;
        let lights =
            object_lights(&self.environment, &object, self.counts.object_lights, self.counts.share_light_visibility);
        let share_sr = 4.0 * PI / self.directions.len() as f32;
        let tan_half_angle = cone_tangent(self.counts.diffuse_aperture * share_sr);
        let gatherer = |shadow, radiosity| Gatherer {
            environment: &self.environment,
            object: &object,
            radiosity,
            shadow,
            directions: &self.directions,
            tan_half_angle,
            lights: &lights,
        };

        let counts = &self.counts;
        let silhouettes = Silhouettes::new(
            self.environment.lights(),
            counts.background_lights,
            PATTERNS,
            &object,
            counts.silhouette_side,
        );
        let backdrop = Backdrop::new(&self.environment, object.centre_m, counts.backdrop_side);
        let caster = |radiosity| Caster {
            object: &object,
            environment: &self.environment,
            silhouettes: &silhouettes,
            backdrop: &backdrop,
            radiosity,
        };
        let coarse = self.coarse.ratio(&caster(None), Stage::CoarseShadow, on_event)?;
        let patches = patches(&object, self.counts.patches);
        let radiosity = stage_of_steps(on_event, Stage::Radiosity, |on_event| {
            let direct = patches::lit(&gatherer(Some(&coarse), None), &patches);
            progress(on_event, Stage::Radiosity, 1, 2)?;
            let reflected = Gatherer { radiosity: Some(&direct), ..gatherer(Some(&coarse), None) };
            Ok::<_, Cancelled>(patches::lit(&reflected, &patches))
        })?;
        let shadow = if self.counts.refines_shadow {
            let smooth = self.coarse.ratio(&caster(Some(&radiosity)), Stage::CoarseShadow, on_event)?;
            self.fine.refined(&smooth, &caster(Some(&radiosity)), Stage::FineShadow, on_event)?
        } else {
            self.fine.ratio(&caster(Some(&radiosity)), Stage::FineShadow, on_event)?
        };

        let mut layers = Layers::new(self.frame.photo.width(), self.frame.photo.height());
        self.shade_object(&object, gatherer(Some(&shadow), Some(&radiosity)), &mut layers, on_event)?;
        self.warnings(model, placement, &object, &layers).try_for_each(|warning| warn(on_event, warning))?;
        let gloss = placement.support.filter(|_| self.floor_gloss > 0.0).map(|plane| Gloss {
            object: &object,
            environment: &self.environment,
            radiosity: &radiosity,
            occluders: &self.occluders,
            camera: self.frame.camera,
            plane,
            roughness: 1.0 - self.floor_gloss,
            samples: self.counts.gloss_samples,
        });
        Ok(stage(on_event, Stage::Composite, || {
            let reflection = gloss.map(|gloss| gloss.reflection(|pixel| self.radiance(pixel)));
            self.compose(layers, &shadow, reflection)
        })?)
    }

    /// Linear radiance of a photo pixel.
    fn radiance(&self, pixel: (usize, usize)) -> Vec3 {
        let linear = match &self.frame.photo {
            Photo::Srgb8(image) => Vec3::from(image[pixel].map(lo_imaging::linear_from_srgb8)),
            Photo::Linear(image) => Vec3::from(image[pixel]),
        };
        linear * self.frame.exposure
    }

    fn shade_object(
        &self,
        object: &Object,
        gatherer: Gatherer,
        layers: &mut Layers,
        on_event: OnEvent<'_>,
    ) -> Result<(), Cancelled> {
        let samples = coverage_pattern(self.counts.coverage);
        let camera = self.frame.camera;
        let shader = Shader { gatherer, specular_cones: self.counts.specular_cones, stride: self.shade_stride() };
        let Some(window) = seen_window(&camera, object) else { return Ok(()) };
        let (left, top, right, bottom) = window;
        let starts = |from: usize, to: usize| (from / TILE * TILE..to).step_by(TILE);
        let tiles: Vec<_> = starts(top, bottom)
            .flat_map(|y| starts(left, right).map(move |x| (x, y)))
            .map(|(x, y)| (x, y, (x + TILE).min(self.frame.photo.width()), (y + TILE).min(self.frame.photo.height())))
            .collect();
        let (view, fronts) = stage(on_event, Stage::Visibility, || {
            let matte = Matte::new(&camera, object, &self.occluders, |pixel| self.colour(pixel), window);
            let (occluders, thrift) = (&self.occluders, self.counts.thrift);
            let viewer = Viewer { camera, object, occluders, matte: &matte, samples: &samples, thrift };
            let views: Vec<TileView> = tiles.into_par_iter().map(|tile| viewer.tile(tile)).collect();
            let mut view = TileView::default();
            for tile in views {
                view.fragments.extend(tile.fragments);
                view.hidden.extend(tile.hidden);
            }
            (view, matte.fronts)
        })?;
        let radiance = stage_of_steps(on_event, Stage::Shading, |on_event| shader.shade(&view.fragments, on_event))?;
        layers.add(&view, &radiance);
        for (pixel, front) in fronts {
            let linear = |colour: Vec3| Vec3::from(colour.to_array().map(lo_imaging::linear_from_srgb));
            layers.clear_edge(pixel, (linear(front) - linear(self.colour(pixel))) * self.frame.exposure);
        }
        Ok(())
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
        model: &PreparedModel,
        placement: &Placement,
        object: &Object,
        layers: &Layers,
    ) -> impl Iterator<Item = Warning> + use<> {
        let nothing = if layers.hides_anything() { Warning::ObjectHidden } else { Warning::ObjectOutsidePicture };
        let nothing = (!layers.covers_anything()).then_some(nothing);
        let outside = (!self.cube.contains(object.centre_m)).then_some(Warning::ObjectOutsideOctree);
        let overhang = self
            .supported_share(model, placement)
            .filter(|supported| *supported < MIN_SUPPORT)
            .map(|supported| Warning::ObjectOverhangs { supported });
        nothing.into_iter().chain(outside).chain(overhang)
    }

    /// Share of the base of a resting object that real surfaces carry, where half of it and more can be judged.
    fn supported_share(&self, model: &PreparedModel, placement: &Placement) -> Option<f32> {
        placement.support?;
        let base = Base::new(model);
        let known: Vec<Option<bool>> = base
            .spots(placement.scale, placement.rotation())
            .map(|spot| self.occluders.carries(&self.frame.camera, placement.position_m + spot, placement.up))
            .collect();
        let count = |state: bool| known.iter().filter(|known| **known == Some(state)).count();
        let (carried, free) = (count(true), count(false));
        (2 * (carried + free) >= known.len() && carried + free > 0).then(|| carried as f32 / (carried + free) as f32)
    }

    fn compose(&self, layers: Layers, shadow: &ShadowRatio, reflection: Option<Image<Vec3>>) -> Composite {
        let (width, height) = (self.frame.photo.width(), self.frame.photo.height());
        // Beyond what the object reaches nothing is looked up.
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
