//! Objects in a photo under the panoramas of several methods, compared with the same objects under the true panorama.

use lo_dataset::{NovelView, Sample};
use lo_events::ignore;
use lo_imaging::{Image, Photo, RadianceImage, luminance, srgb8_from_linear};
use lo_insert::{Align, Composite, InsertError, Inserter, Instance, Lighting, Placement, Quality, surface_at_pixel};
use lo_mesh::MeshError;
use lo_metrics::{rmse, si_rmse};
use lo_scene::LitScene;

use super::objects::{PreparedObject, TestObject};
use crate::method::{estimate_scene, in_photo_frame};
use crate::sheet::NOTHING;
use crate::{DepthInput, MethodError, Scores, Tools};

/// The objects, from left to right.
const OBJECTS: [TestObject; 3] = [TestObject::Diffuse, TestObject::Rough, TestObject::Mirror];

/// Apparent radius of the spheres, and distance between their bases, as shares of the photo's shorter side.
const RADIUS_SHARE: f64 = 0.1;
const APART_SHARE: f64 = 0.28;

/// Rows and columns at which the base of the middle sphere may be, as shares of the photo, in order of preference.
const ROWS: [f64; 5] = [0.84, 0.76, 0.68, 0.9, 0.6];
const COLUMNS: [f64; 5] = [0.5, 0.4, 0.6, 0.35, 0.65];

/// Largest tilt of the surface, degrees: predicted normals of level surfaces are off by some degrees.
const MAX_TILT_DEG: f32 = 20.0;

/// Largest share by which a sphere's base may be nearer or farther than the middle one's.
const DEPTH_RANGE: f32 = 0.35;

/// Share of a sphere's apparent radius within which its pixels are compared.
const INNER: f64 = 0.9;

/// Distance from a base up to which shadows are compared, in apparent radii.
const SHADOW_RADII: f64 = 3.0;

/// Smallest number of pixels for a figure.
const MIN_PIXELS: usize = 12;

/// Objects to be inserted into photos.
pub(crate) struct PhotoObjects {
    objects: Vec<PreparedObject>,
    quality: Quality,
}

/// A photo with the objects under the true panorama.
pub(crate) struct PhotoReference<'a> {
    objects: &'a PhotoObjects,
    scene: LitScene,
    /// The view whose panorama lights the objects.
    view: NovelView,
    placements: Vec<Placement>,
    spheres: Vec<Disc>,
    composite: Composite,
}

/// A sphere in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Disc {
    middle: [f64; 2],
    radius_px: f64,
    base: [f64; 2],
}

impl PhotoObjects {
    /// Builds the objects.
    ///
    /// # Errors
    /// Oversized meshes; does not occur.
    pub fn new(quality: Quality) -> Result<Self, MeshError> {
        Ok(Self { objects: PreparedObject::all(&OBJECTS)?, quality })
    }

    /// Places the objects in a photo and renders them under its first panorama.
    ///
    /// The room's geometry is from true depth if there is any, else estimated by the networks from the photo alone.
    ///
    /// # Errors
    /// Photos without panoramas, and those that show no level surface with enough room; missing tools.
    pub fn reference(&self, sample: &Sample, tools: &Tools) -> Result<PhotoReference<'_>, MethodError> {
        if sample.has_clipped_panoramas() {
            return Err(MethodError::Needs("panoramas that are not clipped at white"));
        }
        let view = sample.views.first().ok_or(MethodError::Needs("a panorama"))?.clone();
        let input = sample.depth_m.is_some().then_some(DepthInput::True);
        let scene = LitScene::as_estimated(estimate_scene(sample, input, tools)?);
        let (placements, spheres) =
            self.placed(&scene).ok_or(MethodError::Needs("a level surface with room for the objects"))?;
        let lighting = Lighting::EnvironmentMap(in_photo_frame(&view));
        let composite =
            self.render(&scene, &placements, lighting).map_err(|e| MethodError::Insertion(e.to_string()))?;
        Ok(PhotoReference { objects: self, scene, view, placements, spheres, composite })
    }

    /// Places the spheres side by side on a level surface; `None` if there is no room.
    fn placed(&self, scene: &LitScene) -> Option<(Vec<Placement>, Vec<Disc>)> {
        let camera = scene.frame.camera;
        let (width, height) = (f64::from(camera.width), f64::from(camera.height));
        let side = width.min(height);
        let candidates = ROWS.iter().flat_map(|row| COLUMNS.iter().map(move |column| [column * width, row * height]));
        candidates.into_iter().find_map(|[u, v]| {
            let middle_m = -self.sphere(scene, 1, [u, v])?.0.position_m.z;
            let all = (0..OBJECTS.len()).map(|index| {
                let offset = (index as f64 - 1.0) * APART_SHARE * side;
                let (placement, disc) = self.sphere(scene, index, [u + offset, v])?;
                let is_near = (-placement.position_m.z / middle_m - 1.0).abs() < DEPTH_RANGE;
                is_near.then_some((placement, disc))
            });
            all.collect::<Option<Vec<_>>>().map(|all| all.into_iter().unzip())
        })
    }

    /// Puts a sphere down at a pixel; `None` if no level surface carries it there, or it is not entirely in the photo.
    fn sphere(&self, scene: &LitScene, index: usize, [u, v]: [f64; 2]) -> Option<(Placement, Disc)> {
        let camera = scene.frame.camera;
        let (width, height) = (f64::from(camera.width), f64::from(camera.height));
        let (_, normal) = surface_at_pixel(scene, u, v).ok()?;
        if normal.angle_between(scene.up()) > MAX_TILT_DEG.to_radians() {
            return None;
        }
        let resting = Placement::rest_on_pixel(scene, u, v, Align::Gravity).ok()?;
        let radius_px = RADIUS_SHARE * width.min(height);
        let scale = (radius_px / camera.fx) as f32 * -resting.position_m.z;
        let placement = resting.scaled(scale).settled(scene, &self.objects[index].base);
        let [base, middle] = [0.0, scale].map(|up_m| camera.project(placement.position_m + placement.up * up_m));
        let ((base_u, base_v, _), (u, v, axis_m)) = (base?, middle?);
        let radius_px = f64::from(scale) * camera.fx / axis_m;
        let is_inside = u > radius_px && u < width - radius_px && v > radius_px && v < height - radius_px;
        is_inside.then_some((placement, Disc { middle: [u, v], radius_px, base: [base_u, base_v] }))
    }

    fn render(&self, scene: &LitScene, placements: &[Placement], lighting: Lighting) -> Result<Composite, InsertError> {
        let instances: Vec<Instance> = self
            .objects
            .iter()
            .zip(placements)
            .map(|(object, &placement)| Instance::new(&object.model, placement))
            .collect();
        Inserter::new(scene, lighting, self.quality)?.render(&instances, &mut ignore)
    }
}

impl PhotoReference<'_> {
    /// Renders the objects under a method's panorama of the photo's first view.
    ///
    /// # Errors
    /// The objects cannot be rendered.
    pub fn under(&self, panorama: RadianceImage) -> Result<Composite, MethodError> {
        let view = NovelView { radiance: panorama, depth_m: None, ..self.view };
        let lighting = Lighting::EnvironmentMap(in_photo_frame(&view));
        let composite = self.objects.render(&self.scene, &self.placements, lighting);
        composite.map_err(|error| MethodError::Insertion(error.to_string()))
    }

    /// Adds the figures of the objects under a method's panorama.
    pub fn compare(&self, got: &Composite, scores: &mut Scores) {
        for (object, sphere) in OBJECTS.into_iter().zip(&self.spheres) {
            let inner = |pixel| distance(pixel, sphere.middle) < INNER * sphere.radius_px;
            if let Some([rmse, si_rmse]) = self.errors(got, inner) {
                scores.add(format!("object_{}_rmse", object.name()), Some(rmse));
                scores.add(format!("object_{}_si_rmse", object.name()), Some(si_rmse));
            }
        }
        scores.add("shadow_rms", self.shadow_rms(got));
    }

    /// Returns RMSE and scale-invariant RMSE of the objects' radiance over some of their pixels.
    fn errors(&self, got: &Composite, is_compared: impl Fn([usize; 2]) -> bool) -> Option<[f64; 2]> {
        let is_object = |&[x, y]: &[usize; 2]| self.composite.alpha[(x, y)] > super::compare::MIN_ALPHA;
        let pixels: Vec<_> = self.pixels().filter(|&pixel| is_compared(pixel)).filter(is_object).collect();
        let of = |composite: &Composite| {
            let radiance = pixels.iter().map(|&[x, y]| composite.object[(x, y)]).collect();
            RadianceImage::new(pixels.len(), 1, radiance)
        };
        let ones = vec![1.0; pixels.len()];
        let (truth, got) = (of(&self.composite), of(got));
        (pixels.len() >= MIN_PIXELS).then_some(())?;
        Some([rmse(&truth, &got, &ones)?, si_rmse(&truth, &got, &ones)?])
    }

    /// Returns the RMS error of the irradiance ratio around the objects.
    fn shadow_rms(&self, got: &Composite) -> Option<f64> {
        let is_near =
            |pixel| self.spheres.iter().any(|sphere| distance(pixel, sphere.base) < SHADOW_RADII * sphere.radius_px);
        let shown = self.pixels().filter(|&[x, y]| self.composite.alpha[(x, y)] == 0.0).filter(|&pixel| is_near(pixel));
        let squares: Vec<f64> = shown
            .map(|[x, y]| {
                let [truth, got] = [&self.composite, got].map(|c| f64::from(luminance(c.shadow_ratio[(x, y)])));
                (truth - got).powi(2)
            })
            .collect();
        (squares.len() >= MIN_PIXELS).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }

    fn pixels(&self) -> impl Iterator<Item = [usize; 2]> + use<> {
        let (width, height) = (self.composite.alpha.width(), self.composite.alpha.height());
        (0..height).flat_map(move |y| (0..width).map(move |x| [x, y]))
    }

    /// Returns the picture of a method without a result.
    pub fn missing(&self) -> Image<[u8; 3]> {
        self.composite.alpha.map(|_| NOTHING)
    }

    /// Returns the reference as a picture.
    pub fn picture(&self) -> Image<[u8; 3]> {
        picture(&self.composite.image)
    }
}

/// Returns a composite as 8-bit sRGB.
pub(crate) fn picture(image: &Photo) -> Image<[u8; 3]> {
    Image::from_fn(image.width(), image.height(), |x, y| image.linear_at((x, y)).map(srgb8_from_linear))
}

/// Returns the distance between a pixel's centre and a position, in pixels.
fn distance([x, y]: [usize; 2], [u, v]: [f64; 2]) -> f64 {
    (x as f64 + 0.5 - u).hypot(y as f64 + 0.5 - v)
}
