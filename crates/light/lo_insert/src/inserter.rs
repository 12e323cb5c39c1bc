use std::collections::{BTreeSet, HashMap};
use std::f32::consts::PI;
use std::sync::Arc;

use lo_events::{Cancelled, OnEvent, progress, stage, stage_of_steps, warn};
use lo_geometry::{Plane, RigidTransform, Vec2, Vec3};
use lo_imaging::{BlackBars, Image, Photo, RadianceImage};
use lo_scene::{DistortedPhoto, Frame, LitScene};
use rayon::prelude::*;

use crate::light::aperture::cone_tangent;
use crate::light::environment::Environment;
use crate::light::gather::{Gatherer, object_lights};
use crate::look::Look;
use crate::matte::alpha::Matte;
use crate::objects::object::Object;
use crate::objects::patches::{self, patches};
use crate::objects::size::RoomSize;
use crate::objects::tracing::Objects;
use crate::placement_check::{ObjectVisibility, PlacementCheck};
use crate::plate::{Plate, PlatePose};
use crate::quality::Counts;
use crate::shade::composite::{Composite, Layers};
use crate::shade::gloss::Gloss;
use crate::shade::passes::{MotionOf, PassImages};
use crate::shade::redistortion::Redistortion;
use crate::shade::shader::{Shaded, Shader};
use crate::shade::visibility::{Fragment, RayCaster, TILE, TileView, coverage_pattern, is_in_view, seen_window};
use crate::shadow::backdrop::Backdrop;
use crate::shadow::field::{Caster, ShadowField};
use crate::shadow::ratio::ShadowRatio;
use crate::shadow::silhouette::Silhouettes;
use crate::surface::observed_surfaces::{SurfaceMap, without_photo};
use crate::surface::occluders::Occluders;
use crate::surface::receivers::PATTERNS;
use crate::{InsertError, Instance, Lighting, Quality, stages};

/// Smallest longer side of a large photo, pixels.
const LARGE_SIDE: usize = 1440;

/// Inserts objects into the photo of one scene.
///
/// It holds everything that does not depend on the objects: the tracers with the main lights split off, the real
/// surfaces, and their irradiance, computed on demand.
pub struct Inserter {
    frame: Frame,
    /// Black bars of the photo, which objects do not cover.
    bars: Option<BlackBars>,
    /// The photo as its lens took it, of which composites are made.
    distorted: Option<(Arc<DistortedPhoto>, Arc<Redistortion>)>,
    environment: Environment,
    surfaces: Surfaces,
    directions: Vec<Vec3>,
    counts: Counts,
    /// Cube of the octree, for warnings.
    cube: lo_geometry::Cube,
    /// Extent of the room, for warnings.
    room: RoomSize,
    /// Unit vector against gravity, in the scene's axes.
    up: Vec3,
    /// The floor, in the scene's axes.
    floor: Option<Plane>,
    /// Pose of the camera of a plate; `None` for the scene's own photo.
    pose: Option<PlatePose>,
    /// Gloss of the supporting surface; 0 for no reflection.
    floor_gloss: f32,
    /// Exponent of the shadow ratio.
    shadow_strength: f32,
    /// The photo's sharpness and grain, if objects get them.
    look: Option<Look>,
    /// Whether composites have passes.
    passes: bool,
}

/// Real surfaces that the photo shows, as occluders and as receivers of shadow.
struct Surfaces {
    occluders: Occluders,
    /// Shadow for the light that real surfaces near the objects reflect to them.
    coarse: ShadowField,
    fine: ShadowField,
}

impl Surfaces {
    fn new(
        frame: &Frame,
        predicted_depth: bool,
        up: Vec3,
        floor: Option<Plane>,
        environment: &Environment,
        counts: &Counts,
    ) -> Self {
        // Flying pixels receive no light, but without them an occluder's edge would have gaps.
        let given = without_photo(frame);
        let clean = given.without_flying_pixels();
        let surfaces = SurfaceMap::new(&clean);
        let field = |side| ShadowField::new(surfaces.resampled(&clean, side), up, floor, environment, counts);
        Self {
            occluders: Occluders::new(&surfaces, &given, predicted_depth),
            coarse: field(counts.coarse_shadow_side),
            fine: field(counts.shadow_side),
        }
    }
}

impl Inserter {
    /// Prepares a scene. At draft quality, this gathers the light on all real surfaces, which takes some tenths of a
    /// second.
    ///
    /// # Errors
    /// If the environment map is empty or black, or the octree cannot be traced. An octree with lobes must first be
    /// evaluated from the objects ([`LightOctree::seen_from`](lo_octree::LightOctree::seen_from)).
    pub fn new(scene: &LitScene, lighting: Lighting, quality: Quality) -> Result<Self, InsertError> {
        let inserter = Self::unprepared(scene, lighting, quality)?;
        if quality == Quality::Draft {
            inserter.prepare();
        }
        Ok(inserter)
    }

    /// [`Inserter::new`] that gathers light on demand: for a single image in this light.
    ///
    /// # Errors
    /// As for [`Inserter::new`].
    pub fn unprepared(scene: &LitScene, lighting: Lighting, quality: Quality) -> Result<Self, InsertError> {
        let counts = quality.counts();
        let environment = Environment::new(scene, lighting, &counts)?;
        let up = scene.up();
        let floor = scene.room.as_ref().and_then(|room| room.floor());
        let surfaces = Surfaces::new(&scene.frame, scene.origin.predicted_depth, up, floor, &environment, &counts);
        Ok(Self {
            bars: scene.black_bars(),
            distorted: scene
                .distorted
                .as_ref()
                .map(|distorted| (Arc::clone(distorted), Arc::new(Redistortion::new(&distorted.undistortion)))),
            frame: scene.frame.clone(),
            environment,
            surfaces,
            directions: lo_geometry::fibonacci_sphere(counts.diffuse_cones),
            counts,
            cube: scene.light.cube,
            room: RoomSize::new(scene),
            up,
            floor,
            pose: None,
            floor_gloss: 0.0,
            shadow_strength: 1.0,
            look: None,
            passes: false,
        })
    }

    /// Gathers the light on all real surfaces in advance.
    pub fn prepare(&self) {
        self.surfaces.coarse.prepare(&self.environment);
        self.surfaces.fine.prepare(&self.environment);
    }

    /// Sets a glossy support: a clear coat of perceptual roughness 1 − `floor_gloss` that mirrors the objects. With
    /// 0, the default, it mirrors nothing.
    #[must_use]
    pub fn with_floor_gloss(self, floor_gloss: f32) -> Self {
        Self { floor_gloss: floor_gloss.clamp(0.0, 1.0), ..self }
    }

    /// Sets the strength of shadow and bounced light on the photo, an exponent of the shadow ratio: 0 for none, 1 (the
    /// default) for what the light gives, 2 for twice as many stops.
    #[must_use]
    pub fn with_shadow_strength(self, shadow_strength: f32) -> Self {
        Self { shadow_strength: shadow_strength.max(0.0), ..self }
    }

    /// Gives the objects the photo's sharpness at their place and depth, and its grain, except in drafts.
    #[must_use]
    pub fn with_photo_look(mut self) -> Self {
        if !self.counts.photo_look {
            return self;
        }
        let photo = self.distorted.as_ref().map_or(&self.frame.photo, |(distorted, _)| &distorted.photo);
        self.look = Some(Look::measure(&self.frame, photo));
        self
    }

    /// Gives composites their [`Passes`](crate::Passes), for compositing in other programs.
    #[must_use]
    pub fn with_passes(self) -> Self {
        Self { passes: true, ..self }
    }

    /// Disables the photo's [`Detail`](lo_lookup::Detail): reflections of unobserved regions stay as smooth as the
    /// octree.
    #[must_use]
    pub fn without_detail(mut self) -> Self {
        self.environment.remove_detail();
        self
    }

    /// Replaces the photo by one of another size; prepared data is kept. Composites are not distorted back any more.
    #[must_use]
    pub fn with_photo(mut self, photo: Photo) -> Self {
        let size = [photo.width(), photo.height()];
        self.bars = self.bars.map(|bars| bars.resized([self.frame.photo.width(), self.frame.photo.height()], size));
        self.frame.camera = self.frame.camera.resized(photo.width() as u32, photo.height() as u32);
        self.frame.photo = photo;
        self.distorted = None;
        if self.look.is_some() { self.with_photo_look() } else { self }
    }

    /// Prepares an image of a moving camera. Settings stay, and the look is that of the plate. Light on its surfaces is
    /// gathered on demand.
    #[must_use]
    pub fn on_plate(&self, plate: &Plate) -> Self {
        let pose = PlatePose::new(plate);
        let camera_from_room = plate.room_from_camera.inverse();
        let environment = self.environment.seen_from(plate.room_from_camera);
        let (up, floor) = (camera_from_room.direction(self.up), self.floor.map(|floor| floor.moved(&camera_from_room)));
        let surfaces = Surfaces::new(&plate.frame, plate.predicted_depth, up, floor, &environment, &self.counts);
        let size = |photo: &Photo| [photo.width(), photo.height()];
        let inserter = Self {
            bars: self.bars.map(|bars| bars.resized(size(&self.frame.photo), size(&plate.frame.photo))),
            distorted: plate
                .distorted
                .as_ref()
                .map(|distorted| (Arc::clone(distorted), Arc::new(Redistortion::new(&distorted.undistortion)))),
            frame: plate.frame.clone(),
            directions: environment.fixed_in_room(lo_geometry::fibonacci_sphere(self.counts.diffuse_cones)),
            environment,
            surfaces,
            pose: Some(pose),
            look: None,
            ..*self
        };
        if self.look.is_some() { inserter.with_photo_look() } else { inserter }
    }

    /// Renders one image with objects that shadow, hide, light and mirror one another. Their order does not matter;
    /// without objects the image is the photo. A hidden object only casts its shadow, with a warning.
    ///
    /// # Errors
    /// [`InsertError::Object`] if a number of a placement is invalid or a model has no extent;
    /// [`Cancelled`](lo_events::Cancelled) if `on_event` cancels.
    pub fn render(&self, instances: &[Instance], on_event: OnEvent<'_>) -> Result<Composite, InsertError> {
        if let Some(pose) = &self.pose {
            let seen: Vec<Instance> = instances.iter().map(|instance| pose.seen(instance)).collect();
            return self.render_seen(&seen, on_event);
        }
        self.render_seen(instances, on_event)
    }

    /// [`render`](Self::render) with objects in the camera's axes.
    fn render_seen(&self, instances: &[Instance], on_event: OnEvent<'_>) -> Result<Composite, InsertError> {
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
        let coarse = self.surfaces.coarse.ratio(&caster(None), stages::COARSE_SHADOW, on_event)?;
        let patches = patches(&objects, counts.patches);
        let radiosity = stage_of_steps(on_event, stages::RADIOSITY, |on_event| {
            let direct = patches::radiosity(&gatherer(Some(&coarse), None), &patches);
            progress(on_event, stages::RADIOSITY, 1, 2)?;
            let reflected = Gatherer { radiosity: Some(&direct), ..gatherer(Some(&coarse), None) };
            Ok::<_, Cancelled>(patches::radiosity(&reflected, &patches))
        })?;
        let shadow = if counts.refines_shadow {
            let smooth = self.surfaces.coarse.ratio(&caster(Some(&radiosity)), stages::COARSE_SHADOW, on_event)?;
            self.surfaces.fine.refined(&smooth, &caster(Some(&radiosity)), stages::FINE_SHADOW, on_event)?
        } else {
            self.surfaces.fine.ratio(&caster(Some(&radiosity)), stages::FINE_SHADOW, on_event)?
        };

        let mut layers = Layers::new(self.frame.photo.width(), self.frame.photo.height());
        let names: Vec<String> = (instances.iter().enumerate())
            .map(|(i, instance)| instance.name.map_or_else(|| format!("object {}", i + 1), str::to_owned))
            .collect();
        let (seen, passes) =
            self.shade_objects(gatherer(Some(&shadow), Some(&radiosity)), &names, &mut layers, on_event)?;
        let check = PlacementCheck {
            occluders: &self.surfaces.occluders,
            camera: &self.frame.camera,
            cube: &self.cube,
            room: &self.room,
            up: self.up,
        };
        // Other plates show the placement that the scene's own photo is checked for.
        if self.pose.is_none_or(|pose| pose.room_from_camera == RigidTransform::IDENTITY) {
            check.warnings(instances, &objects, &seen).try_for_each(|warning| warn(on_event, warning))?;
        }
        let gloss = (self.floor_gloss > 0.0).then(|| Gloss {
            objects: &objects,
            environment: &self.environment,
            radiosity: &radiosity,
            occluders: &self.surfaces.occluders,
            camera: self.frame.camera,
            roughness: 1.0 - self.floor_gloss,
            samples: counts.gloss_samples,
        });
        let gloss = gloss.filter(|_| objects.iter().any(|object| object.support.is_some()));
        Ok(stage(on_event, stages::COMPOSITE, || {
            let reflection = gloss.map(|gloss| gloss.reflection(|pixel| self.radiance(pixel)));
            self.compose(layers, passes, &shadow, reflection)
        })?)
    }

    /// Returns the linear radiance of a photo pixel.
    fn radiance(&self, pixel: (usize, usize)) -> Vec3 {
        Vec3::from(self.frame.photo.linear_at(pixel)) * self.frame.exposure
    }

    /// Shades the visible parts of the objects, and returns the visibility of each and the passes, if asked for.
    fn shade_objects(
        &self,
        gatherer: Gatherer,
        names: &[String],
        layers: &mut Layers,
        on_event: OnEvent<'_>,
    ) -> Result<(Vec<ObjectVisibility>, Option<PassImages>), Cancelled> {
        let objects = gatherer.objects;
        let samples = coverage_pattern(self.counts.coverage);
        let samples_of_glass = coverage_pattern(self.counts.glass_rays);
        let camera = self.frame.camera;
        let shader = Shader {
            gatherer,
            specular_cones: self.counts.specular_cones,
            stride: self.shade_stride(),
            camera,
            glass_rays: &samples_of_glass,
        };
        let windows: Vec<Option<_>> = objects.iter().map(|object| seen_window(&camera, object)).collect();
        let mut seen = vec![ObjectVisibility::default(); objects.len()];
        if windows.iter().all(Option::is_none) {
            return Ok((seen, None));
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
        let (view, occluder_colours) = stage(on_event, stages::VISIBILITY, || {
            let colour = |pixel| self.colour(pixel);
            let matte = |(object, window): (&Object, &Option<_>)| {
                window.map(|window| Matte::new(&camera, object, &self.surfaces.occluders, colour, window))
            };
            let mattes: Vec<Option<Matte>> = objects.iter().zip(&windows).map(matte).collect();
            let (occluders, adaptive_coverage) = (&self.surfaces.occluders, self.counts.adaptive_coverage);
            let viewer =
                RayCaster { camera, objects, occluders, mattes: &mattes, samples: &samples, adaptive_coverage };
            let views: Vec<TileView> = tiles.into_par_iter().map(|tile| viewer.tile(tile)).collect();
            let mut view = TileView::default();
            for tile in views {
                view.fragments.extend(tile.fragments);
                view.hidden.extend(tile.hidden);
            }
            // An occluder of several objects along one edge has the mean of its estimated colours.
            let mut occluder_colours: HashMap<(usize, usize), (Vec3, f32)> = HashMap::new();
            for (pixel, front) in mattes.into_iter().flatten().flat_map(|matte| matte.occluder_colours) {
                let (sum, count) = occluder_colours.entry(pixel).or_default();
                (*sum, *count) = (*sum + front, *count + 1.0);
            }
            (view, occluder_colours)
        })?;
        let shaded = stage_of_steps(on_event, stages::SHADING, |on_event| shader.shade(&view.fragments, on_event))?;
        let blurs_px: Option<Vec<f32>> =
            self.look.as_ref().map(|look| objects.iter().map(|object| self.blur_px(look, object)).collect());
        let add_to = |layers: &mut Layers, values: &[Vec3]| match &blurs_px {
            Some(blurs_px) => layers.add_softened(&view, values, blurs_px),
            None => layers.add(&view, values),
        };
        let radiance: Vec<Vec3> = shaded.iter().map(Shaded::total).collect();
        add_to(layers, &radiance);
        let mut passes = self.passes.then(|| {
            let add = |values: &[Vec3]| {
                let mut layers = Layers::new(width, height);
                add_to(&mut layers, values);
                layers.object
            };
            let material = |fragment: &Fragment| objects[fragment.object].material_name(fragment.material).to_owned();
            let motion = |fragment: &Fragment| {
                let at = |point: Vec3| {
                    camera.project(point).map_or(Vec3::ZERO, |(u, v, _)| Vec3::new(u as f32, -v as f32, 0.0))
                };
                let point = fragment.point.position;
                let moved = objects[fragment.object].moved(point);
                moved.map_or([Vec3::ZERO; 2], |[previous, next]| [at(next) - at(point), at(point) - at(previous)])
            };
            let motion = objects.iter().any(Object::moves).then_some(&motion as &MotionOf);
            let passes = PassImages::new(&view, &shaded, [width, height], names, material, motion, &add);
            match &self.pose {
                Some(pose) => passes.in_room(&pose.room_from_camera),
                None => passes,
            }
        });
        for (pixel, (sum, count)) in occluder_colours {
            let linear = |colour: Vec3| Vec3::from(colour.to_array().map(lo_imaging::linear_from_srgb));
            let change = (linear(sum / count) - linear(self.colour(pixel))) * self.frame.exposure;
            let added = layers.clear_edge(pixel, change);
            if let Some(passes) = &mut passes {
                passes.add_edge(pixel, added);
            }
        }
        view.fragments.iter().for_each(|fragment| seen[fragment.object].shows |= fragment.weight > 0.0);
        view.hidden.iter().for_each(|hidden| seen[hidden.object].hides |= hidden.share > 0.0);
        for ((object, seen), window) in objects.iter().zip(&mut seen).zip(&windows) {
            // An object completely behind another has no visible part.
            seen.hides |= !seen.shows && window.is_some_and(|window| is_in_view(&camera, object, window));
        }
        Ok((seen, passes))
    }

    /// Returns the colour of a photo pixel in sRGB's range, which is perceptually uniform.
    fn colour(&self, pixel: (usize, usize)) -> Vec3 {
        match &self.frame.photo {
            Photo::Srgb8(image) => Vec3::from(image[pixel].map(f32::from)) / 255.0,
            photo => {
                let linear = photo.linear_at(pixel);
                Vec3::from(linear.map(|value| lo_imaging::srgb_from_linear(value.clamp(0.0, 1.0))))
            }
        }
    }

    /// Returns the blur of an object by the photo's sharpness around its middle, in pixels.
    fn blur_px(&self, look: &Look, object: &Object) -> f32 {
        let camera = &self.frame.camera;
        let Some((u, v, depth_m)) = camera.project(object.centre_m) else { return 0.0 };
        let at = Vec2::new(u as f32, v as f32) / camera.width.max(camera.height) as f32;
        look.sharpness.blur_px(at, depth_m as f32)
    }

    /// Returns the side in pixels of the blocks that share diffuse light; they cover a similar part of large and
    /// small photos.
    fn shade_stride(&self) -> usize {
        let large = self.frame.photo.width().max(self.frame.photo.height()) >= LARGE_SIDE;
        self.counts.shade_stride[usize::from(large)]
    }

    fn compose(
        &self,
        mut layers: Layers,
        mut passes: Option<PassImages>,
        shadow: &ShadowRatio,
        mut reflection: Option<Image<Vec3>>,
    ) -> Composite {
        let (width, height) = (self.frame.photo.width(), self.frame.photo.height());
        // Pixels outside the objects' reach are not looked up.
        let (left, top, right, bottom) = shadow.reach(width, height);
        let mut ratio = vec![[1.0; 3]; width * height];
        let within = ratio.par_chunks_mut(width).enumerate().skip(top).take(bottom.saturating_sub(top));
        within.for_each(|(y, row)| {
            let v = (y as f32 + 0.5) / height as f32;
            for (x, ratio) in row.iter_mut().enumerate().take(right).skip(left) {
                let u = (x as f32 + 0.5) / width as f32;
                let seen = || Some(self.surfaces.occluders.at(f64::from(u), f64::from(v))?.position_m);
                *ratio = shadow.for_photo(u, v, seen).to_array();
                if self.shadow_strength != 1.0 {
                    *ratio = ratio.map(|share| share.max(0.0).powf(self.shadow_strength));
                }
            }
        });
        if let Some(bars) = self.bars {
            for at in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                if bars.contains(at, [width, height]) {
                    layers.clear(at);
                    if let Some(passes) = &mut passes {
                        passes.clear(at);
                    }
                    ratio[at.1 * width + at.0] = [1.0; 3];
                    if let Some(reflection) = &mut reflection {
                        reflection[at] = Vec3::ZERO;
                    }
                }
            }
        }
        let (mut photo, exposure) = (&self.frame.photo, self.frame.exposure);
        let mut ratio = RadianceImage::new(width, height, ratio);
        if let Some((distorted, back)) = &self.distorted {
            photo = &distorted.photo;
            layers = layers.distorted(back);
            ratio = back.layer(&ratio.map(|&rgb| Vec3::from(rgb)), Vec3::ONE).map(|ratio| ratio.to_array());
            reflection = reflection.map(|image| back.layer(&image, Vec3::ZERO));
        }
        let reflection = reflection.map(|image| image.map(|radiance| radiance.to_array()));
        let grain = self.look.as_ref().and_then(|look| look.grain.as_ref());
        let back = self.distorted.as_ref().map(|(_, back)| &**back);
        let passes = passes.map(|passes| Box::new(passes.finish(back)));
        Composite { passes, ..Composite::new(photo, exposure, layers, ratio, reflection, grain) }
    }
}
