use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use lightoctree::cone::Rendering;
use lightoctree::geometry::Vec3;
use lightoctree::imaging::{self, Sh9, ToneCurve};
use lightoctree::insert::surface_at_pixel;
use lightoctree::lights::{LightColor, LightEstimate, LightLayout};
use lightoctree::{
    Document, InferredLight, LevelFrame, LightMode, LightPurpose, LightTuning, LitScene, SceneRenderer, export_web,
};
use lightoctree_cli::commands::environment::{self, PanoramaFileArgs, unusual_position};
use lightoctree_cli::commands::level::OutputFrame;
use lightoctree_cli::commands::lights::{AreaValues, SunValues};
use lightoctree_cli::commands::{self, parse};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use pyo3::types::{PyBytes, PyType};

use crate::choice::{self, point};
use crate::composite::Composite;
use crate::errors::Failure;
use crate::export::Export;
use crate::insert::{Insertion, Sequence};
use crate::job::{self, Handler, Reporter};
use crate::lights;
use crate::octree::Octree;
use crate::preview::png;
use crate::{arrays, signature};

/// Width and height of a panorama in pixels, as of the command `envmap`.
const SIZE: (usize, usize) = (512, 256);

/// Largest width of a panorama in pixels.
const MAX_WIDTH: usize = 16_384;

/// Largest number of images of a sequence, as of the command `insert`.
const MAX_FRAMES: u32 = 100_000;

/// Name in the signature of scene files, as of the command that writes them.
const COMMAND: &str = "estimate";

/// A vector as a tuple.
type Vector = (f32, f32, f32);

/// The light of a room: its octree of radiance, the photo with depth and camera, edits of lights and inserted objects.
///
/// Positions are in metres in the camera's frame: +X right, +Y up, and the camera at the origin looks along −Z.
/// Radiance is linear Rec. 709; 1 is the photo's white.
#[pyclass(frozen, module = "lightoctree")]
pub struct Scene {
    state: Mutex<State>,
}

/// A document, and what was prepared to render it.
#[derive(Clone)]
struct State {
    document: Document,
    /// Number of edits.
    edits: usize,
    renderer: Option<Arc<Renderer>>,
}

/// A scene in one light for panoramas.
struct Renderer {
    light: InferredLight,
    lit: LitScene,
    scene: SceneRenderer,
}

impl Scene {
    /// Wraps a document.
    pub fn new(document: Document) -> Self {
        Self { state: Mutex::new(State { document, edits: 0, renderer: None }) }
    }

    fn state(&self, py: Python<'_>) -> MutexGuard<'_, State> {
        // A panic while it was held has changed nothing: edits are complete values.
        self.state.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns a copy of the document, which shares the estimate.
    fn document(&self, py: Python<'_>) -> Document {
        self.state(py).document.clone()
    }
}

#[pymethods]
impl Scene {
    /// Reads a .scene file.
    #[classmethod]
    fn load(_: &Bound<'_, PyType>, py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let document = py.detach(|| Document::read(path));
        document.map(Self::new).map_err(|error| Failure::from(error).raise(py))
    }

    /// Reads a scene from the bytes of a .scene file.
    #[classmethod]
    fn from_bytes(_: &Bound<'_, PyType>, py: Python<'_>, data: &[u8]) -> PyResult<Self> {
        let document = py.detach(|| Document::from_bytes(data));
        document.map(Self::new).map_err(|error| Failure::from(error).raise(py))
    }

    /// Writes a .scene file, as the command `estimate` does.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let document = self.document(py);
        py.detach(|| document.write(path, &signature(COMMAND))).map_err(|error| Failure::from(error).raise(py))
    }

    /// Returns the bytes of the .scene file.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let document = self.document(py);
        let bytes = py.detach(|| document.to_bytes(&signature(COMMAND)));
        Ok(PyBytes::new(py, &bytes.map_err(|error| Failure::from(error).raise(py))?))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        Ok((slf.get_type().getattr("from_bytes")?, (slf.get().to_bytes(slf.py())?,)))
    }

    fn __copy__(&self, py: Python<'_>) -> Self {
        Self::new(self.document(py))
    }

    /// Renders the HDR panorama at a position: equirectangular, float32 [H, W, 3].
    ///
    /// Its centre faces −Z, and +Y is up. `size` is (width, height); the width is twice the height. With `level`,
    /// gravity points straight down in it. `light` is "even", "expected" or "plausible"; by default that of the scene,
    /// else "expected".
    #[pyo3(
        signature = (at, size = SIZE, level = false, *, light = None),
        text_signature = "($self, at, size=(512, 256), level=False, *, light=None)"
    )]
    fn environment<'py>(
        &self,
        py: Python<'py>,
        at: [f64; 3],
        size: (usize, usize),
        level: bool,
        light: Option<&str>,
    ) -> PyResult<Bound<'py, PyAny>> {
        arrays::of_rgb(py, self.panorama(py, at, size, level, light)?.radiance)
    }

    /// Writes the HDR panorama at a position, as the command `envmap` does: .exr, .hdr or .pfm.
    ///
    /// `orientation` is named after a program that uses it: "lightoctree", "openexr", "threejs", "blender" or "unity".
    /// With `half`, EXR has 16-bit floats. The other parameters are those of `environment`.
    #[pyo3(
        signature = (path, at, size = SIZE, level = false, *, light = None, orientation = "lightoctree", half = false),
        text_signature = "($self, path, at, size=(512, 256), level=False, *, light=None, orientation='lightoctree', \
                          half=False)"
    )]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn save_environment(
        &self,
        py: Python<'_>,
        path: PathBuf,
        at: [f64; 3],
        size: (usize, usize),
        level: bool,
        light: Option<&str>,
        orientation: &str,
        half: bool,
    ) -> PyResult<()> {
        let orientation = choice::orientation(orientation)?;
        let options = PanoramaFileArgs { orientation, half, preview: false, tone: ToneCurve::Clip, preview_ev: 0.0 };
        let panorama = self.panorama(py, at, size, level, light)?.radiance;
        let estimate = self.document(py).estimate;
        let frame = OutputFrame::of(estimate.room.as_ref().filter(|_| level).map(LevelFrame::new));
        let at = Some((point("at", at)?, &frame));
        py.detach(|| environment::write(&path, &panorama, at, &options, "envmap"))
            .map_err(|error| Failure::Library("ImageError", error.into()).raise(py))
    }

    /// Returns nine spherical harmonics of the light at a position: float32 [9, 3], in the order and with the
    /// constants of Ramamoorthi and Hanrahan (2001).
    #[pyo3(signature = (at, level = false, *, light = None))]
    fn sh9<'py>(&self, py: Python<'py>, at: [f64; 3], level: bool, light: Option<&str>) -> PyResult<Bound<'py, PyAny>> {
        let panorama = self.panorama(py, at, SIZE, level, light)?;
        arrays::of_rows(py, Sh9::project(&panorama.radiance).coefficients.to_vec())
    }

    /// Returns the light that contributes the most power at a position; None if nothing stands out.
    #[pyo3(signature = (at, level = false, *, light = None))]
    fn main_light<'py>(
        &self,
        py: Python<'py>,
        at: [f64; 3],
        level: bool,
        light: Option<&str>,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        let panorama = self.panorama(py, at, SIZE, level, light)?;
        let found = py.detach(|| imaging::main_light(&panorama.radiance));
        found.map(|light| lights::of_json(py, "MainLight", &light)).transpose()
    }

    /// Returns the light at a position in the layout of an AR framework or engine, as the command `envmap` writes it.
    ///
    /// `layout` is "webxr", "arkit" or "unity".
    #[pyo3(signature = (at, layout, level = false, *, light = None))]
    fn light_estimate<'py>(
        &self,
        py: Python<'py>,
        at: [f64; 3],
        layout: &str,
        level: bool,
        light: Option<&str>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let layout = choice::choice("layout", layout, &LightLayout::ALL)?;
        let panorama = self.panorama(py, at, SIZE, level, light)?;
        let estimate = py.detach(|| LightEstimate::of(&panorama.radiance).in_layout(layout));
        lights::json(py, &estimate)
    }

    /// Writes the room for other programs, as the command `export` does: .ply, .glb, .usda or .usdz. Returns
    /// the files.
    ///
    /// With `level`, the scene is upright, the floor is at height 0, and the camera is above the origin. `probes` are
    /// positions in the camera's frame whose panoramas are written beside the file. `light` is "even", "expected" or
    /// "plausible"; by default that of the scene, else "plausible".
    #[pyo3(
        signature = (path, *, level = false, probes = Vec::new(), light = None),
        text_signature = "($self, path, *, level=False, probes=(), light=None)"
    )]
    fn export(
        &self,
        py: Python<'_>,
        path: PathBuf,
        level: bool,
        probes: Vec<[f64; 3]>,
        light: Option<&str>,
    ) -> PyResult<Vec<PathBuf>> {
        let probes = probes.into_iter().map(|at| point("probes", at)).collect::<PyResult<_>>()?;
        let export = Export::new(path, level, probes).map_err(|failure| failure.raise(py))?;
        let mut document = self.document(py);
        choose_light(&mut document, light)?;
        job::run(py, Handler::Silent, move |reporter| export.write(&document, reporter))
    }

    /// Writes a folder with a web page that shows objects in the photo, as the command `export --to web` does. Returns
    /// the files.
    ///
    /// `light` is "even", "expected" or "plausible"; by default that of the scene, else "plausible".
    #[pyo3(signature = (folder, *, title = String::new(), light = None), text_signature = "($self, folder, *, title='', light=None)")]
    fn export_web(
        &self,
        py: Python<'_>,
        folder: PathBuf,
        title: String,
        light: Option<&str>,
    ) -> PyResult<Vec<PathBuf>> {
        let mut document = self.document(py);
        choose_light(&mut document, light)?;
        job::run(py, Handler::Silent, move |reporter| {
            let (scene, report) = document.lit_with_report(LightPurpose::Export)?;
            report.fit.warning().iter().for_each(|warning| reporter.warn(warning));
            Ok(export_web(&scene, &title, &folder, &mut |event| reporter.handle(event))?.files)
        })
    }

    /// Returns the position of the observed surface at a pixel of the photo, and its unit normal.
    fn surface_at_pixel(&self, py: Python<'_>, pixel: [f64; 2]) -> PyResult<(Vector, Vector)> {
        let (estimate, [u, v]) = (self.document(py).estimate, pixel);
        let surface = py.detach(|| surface_at_pixel(&estimate, u, v));
        let (position_m, normal) = surface.map_err(|error| Failure::from(error).raise(py))?;
        Ok((position_m.into(), normal.into()))
    }

    /// Inserts objects into the photo, as the command `insert` does.
    ///
    /// Parameters
    /// ----------
    /// objects
    ///     A dictionary or several, with the fields of docs/layout.md, such as
    ///     {"mesh": "chair.glb", "pixel": (960, 1100), "height_m": 0.9, "material": "gold"}; or a file of them.
    ///     Built-in meshes are "builtin:sphere", "builtin:suzanne", "builtin:tea-set", "builtin:glass-sphere",
    ///     "builtin:wine-glass" and "builtin:bottle". Default: the objects saved in the scene.
    /// quality
    ///     "draft", "normal" or "high".
    /// light
    ///     "even", "expected" or "plausible". Default: that of the scene, else "plausible".
    /// floor_gloss
    ///     Gloss of the surface under an object, from 0 to 1. Default: 0, or that saved with the scene's own objects.
    /// match_look
    ///     Whether the objects get the photo's sharpness and grain; drafts never do.
    /// passes
    ///     Whether the composite has the passes of docs/layers.md beside its layers, as `--layers` writes them.
    /// on_event
    ///     As for `estimate`.
    #[pyo3(signature = (
        objects = None, *, quality = "normal", light = None, floor_gloss = None, match_look = true, passes = false,
        on_event = None
    ))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn insert(
        &self,
        py: Python<'_>,
        objects: Option<&Bound<'_, PyAny>>,
        quality: &str,
        light: Option<&str>,
        floor_gloss: Option<f64>,
        match_look: bool,
        passes: bool,
        on_event: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Composite> {
        let insertion = self.insertion(py, objects, quality, light, floor_gloss, match_look, passes)?;
        job::run(py, Handler::new(on_event), |reporter| insertion.image(reporter)?.render(0, reporter))
    }

    /// Inserts objects that move along paths, and returns an iterator that renders one image after the other.
    ///
    /// `frames` is their number, at equal time steps along the paths; by default that saved with the scene's own
    /// objects. The other parameters are those of `insert`.
    #[pyo3(signature = (
        objects = None, frames = None, *, quality = "normal", light = None, floor_gloss = None, match_look = true,
        passes = false, on_event = None
    ))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn sequence(
        &self,
        py: Python<'_>,
        objects: Option<&Bound<'_, PyAny>>,
        frames: Option<u32>,
        quality: &str,
        light: Option<&str>,
        floor_gloss: Option<f64>,
        match_look: bool,
        passes: bool,
        on_event: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Sequence> {
        if let Some(frames) = frames.filter(|frames| !(1..=MAX_FRAMES).contains(frames)) {
            return Err(PyValueError::new_err(format!("frames must be from 1 to {MAX_FRAMES}, not {frames}")));
        }
        let insertion = self.insertion(py, objects, quality, light, floor_gloss, match_look, passes)?;
        let frames = frames.map(|frames| frames as usize);
        let prepared = job::run(py, Handler::new(on_event), move |reporter| insertion.sequence(frames, reporter))?;
        Ok(Sequence::new(prepared, on_event))
    }

    /// The lights of the room with their edits, the strongest first, and the lights that the user added.
    #[getter]
    fn lights<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let document = self.document(py);
        let listed = py.detach(|| document.lights());
        listed.iter().map(|light| lights::listed(py, light)).collect()
    }

    /// Changes a light of `lights` by its name. What is not given stays as it is.
    ///
    /// `scale` is a factor on its radiance, `color` a temperature in kelvin or linear (r, g, b), `at` its new position.
    #[pyo3(signature = (id, *, on = None, scale = None, color = None, at = None))]
    fn set_light(
        &self,
        py: Python<'_>,
        id: &str,
        on: Option<bool>,
        scale: Option<f32>,
        color: Option<&Bound<'_, PyAny>>,
        at: Option<[f64; 3]>,
    ) -> PyResult<()> {
        let at = at.map(|at| point("at", at)).transpose()?;
        let color = color.map(lights::color).transpose()?;
        self.edit(py, |document| lights::change(document, id, on, scale, color, at))
    }

    /// Adds a sun and returns its name in `lights`. Its direction is `azimuth_deg`, to the right of the camera's
    /// heading, and `elevation_deg`, or that of a `shadow`: (u, v, u, v), a pixel of what casts it and one of the
    /// shadow.
    ///
    /// `strength` is the irradiance on a surface that faces the sun; π makes a white one as bright as the photo's
    /// white. Without it, the sun is the photo's own, which the photo's sun patches tell. `angle_deg` is its diameter.
    #[pyo3(
        signature = (
            *, azimuth_deg = None, elevation_deg = None, shadow = None, strength = None, angle_deg = 0.53, color = None
        )
    )]
    #[allow(clippy::too_many_arguments)]
    fn add_sun(
        &self,
        py: Python<'_>,
        azimuth_deg: Option<f64>,
        elevation_deg: Option<f64>,
        shadow: Option<[f64; 4]>,
        strength: Option<f64>,
        angle_deg: f64,
        color: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<String> {
        if azimuth_deg.is_some() != elevation_deg.is_some() || azimuth_deg.is_some() == shadow.is_some() {
            return Err(PyValueError::new_err("give azimuth_deg and elevation_deg, or shadow"));
        }
        let positive = |name: &str, value| choice::number(name, value, parse::positive);
        let values = SunValues {
            azimuth: azimuth_deg.map(|angle| choice::number("azimuth_deg", angle, parse::angle_deg)).transpose()?,
            elevation: elevation_deg
                .map(|angle| choice::number("elevation_deg", angle, parse::elevation_deg))
                .transpose()?,
            shadow: shadow.map(|[u, v, s, t]| [[u, v], [s, t]]),
            strength: strength.map(|value| positive("strength", value)).transpose()?,
            angle: positive("angle_deg", angle_deg)?,
            color: color.map(lights::color).transpose()?,
        };
        self.edit(py, |document| {
            lights::add(document, |document| Ok(commands::lights::sun(&document.estimate, &values)?.0))
        })
    }

    /// Adds an area light and returns its name in `lights`: a rectangle of `size` (width, height) that emits towards
    /// `direction`, or a sphere of `radius`, in metres.
    ///
    /// `radiance` is its luminance, 1 the photo's white; `power` instead of it is in watts as in Blender. It is not
    /// drawn in the photo, and does not block light.
    #[pyo3(
        signature = (
            at, *, size = None, radius = None, direction = None, two_sided = false, radiance = None, power = None,
            color = None
        )
    )]
    #[allow(clippy::too_many_arguments)]
    fn add_area_light(
        &self,
        py: Python<'_>,
        at: [f64; 3],
        size: Option<[f32; 2]>,
        radius: Option<f64>,
        direction: Option<[f64; 3]>,
        two_sided: bool,
        radiance: Option<f64>,
        power: Option<f64>,
        color: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<String> {
        if size.is_some() == radius.is_some() || size.is_some() != direction.is_some() {
            return Err(PyValueError::new_err("give size and direction, or radius"));
        }
        if radiance.is_some() == power.is_some() {
            return Err(PyValueError::new_err("give radiance or power"));
        }
        if two_sided && radius.is_some() {
            return Err(PyValueError::new_err("two_sided has no effect on spheres"));
        }
        let positive = |name: &str, value| choice::number(name, value, parse::positive);
        let values = AreaValues {
            at: point("at", at)?,
            size,
            radius: radius.map(|value| positive("radius", value)).transpose()?,
            direction: direction.map(|direction| choice::direction("direction", direction)).transpose()?,
            two_sided,
            radiance: radiance.map(|value| positive("radiance", value)).transpose()?,
            power: power.map(|value| positive("power", value)).transpose()?,
            color: color.map_or(Ok(LightColor::Rgb([1.0; 3])), lights::color)?,
        };
        self.edit(py, |document| lights::add(document, |document| commands::lights::area(&document.estimate, &values)))
    }

    /// Removes an added light by its name.
    fn remove_light(&self, py: Python<'_>, id: &str) -> PyResult<()> {
        self.edit(py, |document| lights::remove(document, id))
    }

    /// Undoes the edits of a light, or all edits, with the choice of light and the added lights.
    #[pyo3(signature = (id = None))]
    fn reset_lights(&self, py: Python<'_>, id: Option<&str>) -> PyResult<()> {
        self.edit(py, |document| Ok(document.reset_lights(id)?))
    }

    /// The octree of radiance as estimated, without edits of lights and expected light.
    #[getter]
    fn octree(&self, py: Python<'_>) -> Octree {
        Octree::new(self.document(py).estimate)
    }

    /// The photo, read-only, [H, W, 3]: uint8 as in an 8-bit file, else linear float32.
    #[getter]
    fn photo<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::photo(py, &self.document(py).estimate, |estimate| &estimate.frame.photo)
    }

    /// The photo's depth in metres along the optical axis, read-only float32 [h, w]; 0 where there is no reading.
    #[getter]
    fn depth<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::view(py, &self.document(py).estimate, |estimate| arrays::grey(&estimate.frame.depth_m))
    }

    /// Focal lengths and principal point (fx, fy, cx, cy) in pixels of the photo.
    #[getter]
    fn intrinsics(&self, py: Python<'_>) -> (f64, f64, f64, f64) {
        let camera = self.document(py).estimate.frame.camera;
        (camera.fx, camera.fy, camera.cx, camera.cy)
    }

    /// Unit vector against gravity in the camera's frame; None if it is unknown.
    #[getter]
    fn up(&self, py: Python<'_>) -> Option<Vector> {
        self.document(py).estimate.room.as_ref().map(|room| room.up.into())
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        png(py, &self.document(py).estimate.frame.photo)
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let estimate = self.document(py).estimate;
        let (photo, light) = (&estimate.frame.photo, &estimate.light);
        format!(
            "<lightoctree.Scene: photo of {} × {} pixels, octree of depth {} with {} leaves>",
            photo.width(),
            photo.height(),
            light.octree.depth(),
            light.octree.leaf_nodes().count()
        )
    }
}

impl Scene {
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn insertion(
        &self,
        py: Python<'_>,
        objects: Option<&Bound<'_, PyAny>>,
        quality: &str,
        light: Option<&str>,
        floor_gloss: Option<f64>,
        match_look: bool,
        passes: bool,
    ) -> PyResult<Insertion> {
        let quality = choice::quality(quality)?;
        let mut document = self.document(py);
        choose_light(&mut document, light)?;
        Insertion::new(py, document, objects, quality, floor_gloss, match_look, passes)
    }

    /// Renders a panorama.
    fn panorama(
        &self,
        py: Python<'_>,
        at: [f64; 3],
        (width, height): (usize, usize),
        level: bool,
        light: Option<&str>,
    ) -> PyResult<Rendering> {
        if width != 2 * height || !(1..=MAX_WIDTH).contains(&width) {
            let limits = "the width of a panorama must be twice its height, and at most 16384";
            return Err(PyValueError::new_err(format!("size is (width, height) = ({width}, {height}): {limits}")));
        }
        let at = point("at", at)?;
        let mut state = self.state(py).clone();
        choose_light(&mut state.document, light)?;
        let level = match (&state.document.estimate.room, level) {
            (_, false) => None,
            (Some(room), true) => Some(LevelFrame::new(room)),
            (None, true) => {
                let message = "level: the scene has no up direction; estimate it again, if necessary with up";
                return Err(PyValueError::new_err(message));
            }
        };
        let edits = state.edits;
        let (panorama, renderer) = job::run(py, Handler::Silent, move |reporter| {
            let renderer = state.renderer(reporter)?;
            if let Some(unusual) = unusual_position(&renderer.lit, at) {
                reporter.warn(format!("({}, {}, {}) is {unusual}", at.x, at.y, at.z));
            }
            Ok((renderer.panorama(at, height, level), renderer))
        })?;
        // The next panorama uses it, unless the lights were edited meanwhile.
        let mut state = self.state(py);
        if state.edits == edits {
            state.renderer = Some(renderer);
        }
        Ok(panorama)
    }

    /// Edits the document.
    fn edit<T: Send>(
        &self,
        py: Python<'_>,
        change: impl FnOnce(&mut Document) -> Result<T, Failure> + Send,
    ) -> PyResult<T> {
        let edited = py.detach(|| {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            let result = change(&mut state.document)?;
            state.edits += 1;
            state.renderer = None;
            Ok::<_, Failure>(result)
        });
        edited.map_err(|failure| failure.raise(py))
    }
}

impl State {
    /// Returns the prepared scene in the document's light.
    fn renderer(&self, reporter: &mut Reporter) -> Result<Arc<Renderer>, Failure> {
        let light = self.document.inferred_light(LightPurpose::Panorama);
        if let Some(renderer) = self.renderer.as_ref().filter(|renderer| renderer.light == light) {
            return Ok(renderer.clone());
        }
        let (lit, report) = self.document.lit_with_report(LightPurpose::Panorama)?;
        report.fit.warning().iter().for_each(|warning| reporter.warn(warning));
        let scene = SceneRenderer::new(&lit);
        Ok(Arc::new(Renderer { light, lit, scene }))
    }
}

impl Renderer {
    fn panorama(&self, at: Vec3, height: usize, level: Option<LevelFrame>) -> Rendering {
        match level {
            None => self.scene.panorama(at, 2 * height, height),
            Some(level) => {
                let rows = LevelFrame::rendered_height(height);
                level.panorama(&self.scene.panorama(at, 2 * rows, rows), height)
            }
        }
    }
}

/// Sets the light of this name, if there is one.
fn choose_light(document: &mut Document, light: Option<&str>) -> PyResult<()> {
    if let Some(light) = light {
        let light: LightMode = choice::light(light)?;
        document.light_edits.inferred = Some(InferredLight { light, tuning: LightTuning::default() });
    }
    Ok(())
}
