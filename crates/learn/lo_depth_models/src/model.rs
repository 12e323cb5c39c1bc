use std::collections::HashMap;
use std::io::{BufRead, BufReader, Cursor, Seek};
use std::path::Path;
use std::sync::{Arc, Mutex};

use lo_events::{OnEvent, stage};
use lo_geometry::Camera;
use lo_imaging::{Image, open_regular_file};

use crate::error::short;
use crate::facts::Known;
use crate::metric3d::Letterbox;
use crate::onnx::{Graph, Weights, read_model, simplify};
use crate::plan::{InputContent, plan};
use crate::preprocess::{input_dims, input_size, prepared};
use crate::recipe::Recipe;
use crate::runtime::{Array, Loaded, Runtime};
use crate::stages;
use crate::{FieldOfView, Geometry, ModelConfig, ModelError, OutputKind, Prediction, depth_anything, metric3d, moge};

/// Largest file in bytes.
const MAX_FILE_BYTES: u64 = 1 << 31;

/// Smallest share of finite values in a valid output.
const MIN_FINITE: f64 = 0.1;

/// Largest log ratio between the aspects of an output and of the input. Coarse outputs are rounded to whole pixels.
const MAX_ASPECT: f64 = 0.1;

/// Name, shape and values of an output.
pub type RawOutput = (String, Vec<usize>, Vec<f32>);

/// A third-party depth network, ready to run.
pub struct DepthModel {
    file_name: String,
    recipe: Recipe,
    graph: Graph,
    opset: i64,
    runtime: Runtime,
    /// Shape of the last input, and the graph planned for it.
    last: Mutex<Option<(Vec<usize>, Arc<Loaded>)>>,
}

impl std::fmt::Debug for DepthModel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DepthModel").field("name", &self.name()).field("recipe", &self.recipe).finish_non_exhaustive()
    }
}

impl DepthModel {
    /// Reads an ONNX file, and its external weights from files in the same folder. `config` describes an unknown model.
    ///
    /// For any content, it allocates at most twice the file's length, and never more than 2 GB.
    ///
    /// # Errors
    /// A file that cannot be read, is damaged, too large or not supported; an unknown model without a config.
    pub fn read(path: impl AsRef<Path>, config: Option<&ModelConfig>) -> Result<Self, ModelError> {
        let path = path.as_ref();
        let named = |error: ModelError| match error {
            ModelError::Read { path: empty, source } if empty.is_empty() => {
                ModelError::Read { path: path.display().to_string(), source }
            }
            error => error,
        };
        let (file, _) = open_regular_file(path, MAX_FILE_BYTES).map_err(ModelError::read).map_err(named)?;
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let folder = path.parent().map(|folder| if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
        Self::of(BufReader::new(file), folder, &short(&name), config).map_err(named)
    }

    /// Reads the bytes of an ONNX file without external weights.
    ///
    /// # Errors
    /// Those of [`DepthModel::read`].
    pub fn from_bytes(bytes: &[u8], config: Option<&ModelConfig>) -> Result<Self, ModelError> {
        Self::of(Cursor::new(bytes), None, "", config)
    }

    fn of<R: BufRead + Seek>(
        file: R,
        folder: Option<&Path>,
        name: &str,
        config: Option<&ModelConfig>,
    ) -> Result<Self, ModelError> {
        let (mut model, file) = read_model(file)?;
        simplify(&mut model)?;
        let opset = model.opset();
        let opsets = std::mem::take(&mut model.opsets);
        let mut graph = model.graph;
        let weights = Weights::gather(&mut graph, file, folder)?;
        let recipe = Recipe::of(&graph, config, name)?;
        Ok(Self {
            file_name: name.to_owned(),
            recipe,
            graph,
            opset,
            runtime: Runtime::new(weights, opsets)?,
            last: Mutex::new(None),
        })
    }

    /// Display name: the family and the file name.
    pub fn name(&self) -> String {
        if self.file_name.is_empty() {
            self.recipe.family.clone()
        } else {
            format!("{} ({})", self.recipe.family, self.file_name)
        }
    }

    /// Meaning of its output.
    pub fn kind(&self) -> OutputKind {
        self.recipe.kind
    }

    /// Whether it predicts the field of view if no camera is given.
    pub fn predicts_field_of_view(&self) -> bool {
        self.recipe.kind == OutputKind::Points
    }

    /// Whether its depth is in metres. Otherwise metric depth of the same photo is needed to convert it
    /// ([`crate::affine`]).
    pub fn is_metric(&self) -> bool {
        match self.recipe.kind {
            OutputKind::Metric => true,
            OutputKind::Points => self.recipe.scale.is_some(),
            OutputKind::InverseAffine | OutputKind::Log => false,
        }
    }

    /// Predicts depth for a photo. `camera`, in pixels of the photo, if the lens is known.
    ///
    /// # Errors
    /// A photo that is too small or narrow, sizes in the graph that do not match it, a run beyond the memory limit,
    /// outputs that do not match the model's kind; [`Cancelled`](lo_events::Cancelled) before or after the run.
    pub fn predict(
        &self,
        photo: &Image<[u8; 3]>,
        camera: Option<&Camera>,
        on_event: OnEvent<'_>,
    ) -> Result<Prediction, ModelError> {
        let (width, height) = (photo.width(), photo.height());
        if width.min(height) < 16 || width.max(height) > 20 * width.min(height) {
            return Err(ModelError::Photo(format!(
                "{width} × {height} pixels are too small or too narrow for a depth model"
            )));
        }
        if camera.is_none() && self.recipe.canonical_focal_px.is_some() {
            return Err(ModelError::Photo("the model needs the camera's focal length".to_owned()));
        }
        let size = input_size(&self.recipe, (width, height));
        let loaded =
            stage(on_event, stages::PREPARE_DEPTH_MODEL, || self.loaded(&input_dims(self.recipe.layout, size)))??;
        let outputs = self.recipe.outputs();
        let (prepared, arrays) = stage(on_event, stages::DEPTH_MODEL, || {
            let prepared = prepared(&self.recipe, photo);
            loaded.run(&self.recipe.input, &prepared.array, &outputs).map(|arrays| (prepared, arrays))
        })??;
        let outputs =
            Outputs { arrays: outputs.into_iter().zip(arrays).collect(), letterbox: prepared.letterbox, size };
        self.prediction(&outputs, (width as u32, height as u32), camera, prepared.photo.0 as f64 / width as f64)
    }

    /// Runs the model on an input tensor and returns all outputs, for comparison with other runtimes.
    ///
    /// # Errors
    /// Those of [`DepthModel::predict`].
    #[doc(hidden)]
    pub fn raw(&self, dims: &[usize], values: &[f32]) -> Result<Vec<RawOutput>, ModelError> {
        let outputs = self.recipe.outputs();
        let array = Array { dims: dims.to_vec(), values: values.to_vec() };
        let arrays = self.loaded(dims)?.run(&self.recipe.input, &array, &outputs)?;
        Ok(outputs.into_iter().zip(arrays).map(|(name, array)| (name, array.dims, array.values)).collect())
    }

    /// The graph planned for an input of this shape.
    fn loaded(&self, dims: &[usize]) -> Result<Arc<Loaded>, ModelError> {
        let mut last = self.last.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some((_, loaded)) = last.as_ref().filter(|(known, _)| known == dims) {
            return Ok(Arc::clone(loaded));
        }
        *last = None;
        let mut contents = HashMap::from([(self.recipe.input.clone(), InputContent::Sized(dims.to_vec()))]);
        for (name, value) in &self.recipe.integers {
            let shape = self.graph.inputs.iter().find(|info| info.name == *name).and_then(|info| info.dims.as_ref());
            let dims = vec![1; shape.map_or(0, Vec::len)];
            let value =
                i32::try_from(*value).map_err(|_| ModelError::Config(format!("{name} = {value} is too large")))?;
            contents.insert(name.clone(), InputContent::Value(dims, Known::Ints(vec![value])));
        }
        let evaluate =
            |node: &crate::onnx::Node, values: &[(String, Vec<usize>, Known)]| self.runtime.evaluate(node, values);
        let plan =
            plan(&self.graph, self.opset, &contents, &self.recipe.outputs(), self.runtime.weight_bytes(), &evaluate)?;
        let loaded = Arc::new(self.runtime.load(&plan)?);
        *last = Some((dims.to_vec(), Arc::clone(&loaded)));
        Ok(loaded)
    }

    /// Interprets the outputs by the recipe.
    fn prediction(
        &self,
        outputs: &Outputs,
        photo: (u32, u32),
        camera: Option<&Camera>,
        pixels_per_pixel: f64,
    ) -> Result<Prediction, ModelError> {
        let recipe = &self.recipe;
        let output = &recipe.output;
        let mask = recipe.mask.as_ref().map(|name| outputs.scalars(name)).transpose()?;
        let mut field_of_view = None;
        let geometry = match recipe.kind {
            OutputKind::Metric => {
                let depth = outputs.scalars(output)?;
                let focal = camera.zip(recipe.canonical_focal_px);
                let mut depth_m = match focal {
                    Some((camera, canonical_px)) => metric3d::metres(
                        &depth,
                        camera.fx * pixels_per_pixel * metric3d::CANONICAL_FOCAL_PX / canonical_px,
                    ),
                    None => depth_anything::metres(&depth),
                };
                masked(&mut depth_m, mask.as_ref(), 0.0);
                Geometry::Metric(depth_m)
            }
            OutputKind::InverseAffine => {
                let mut inverse = outputs.scalars(output)?;
                if recipe.family.starts_with("Depth Anything") {
                    inverse = depth_anything::inverse(&inverse);
                }
                masked(&mut inverse, mask.as_ref(), f32::NAN);
                Geometry::AffineInverse(inverse)
            }
            OutputKind::Log => {
                let mut log = outputs.scalars(output)?;
                masked(&mut log, mask.as_ref(), f32::NAN);
                Geometry::Log(log)
            }
            OutputKind::Points => {
                let points = outputs.vectors(output)?;
                let unusable =
                    |error: moge::PointsError| ModelError::Output { output: short(output), why: error.to_string() };
                let solved = moge::focal_and_shift(&points, mask.as_ref(), photo, camera).map_err(unusable)?;
                if camera.is_none() {
                    field_of_view = Some(solved.field_of_view(photo));
                }
                match &recipe.scale {
                    Some(name) => {
                        let scale = outputs.number(name)?;
                        Geometry::Metric(moge::metres(&points, mask.as_ref(), solved.shift, scale).map_err(unusable)?)
                    }
                    None => {
                        let depth = moge::metres(&points, mask.as_ref(), solved.shift, 1.0).map_err(unusable)?;
                        Geometry::Log(depth.map(|&z| if z > 0.0 { z.ln() } else { f32::NAN }))
                    }
                }
            }
        };
        let normals = recipe.normals.as_ref().map(|name| outputs.vectors(name)).transpose()?;
        let normals = normals.map(|normals| -> Result<_, ModelError> {
            let reliable = match &recipe.normals_kappa {
                Some(name) => metric3d::reliable_normals(&normals, &outputs.scalars(name)?),
                None => normals,
            };
            let [half_width, half_height] = half_sizes(photo, camera, field_of_view);
            Ok(moge::normals(
                &reliable,
                mask.as_ref().filter(|mask| mask.pixels().len() == reliable.pixels().len()),
                half_width,
                half_height,
            ))
        });
        Ok(Prediction { geometry, field_of_view, normals: normals.transpose()? })
    }
}

/// Half of the image's width and height at one metre, by the camera, the predicted field of view, or an ordinary lens.
fn half_sizes(photo: (u32, u32), camera: Option<&Camera>, predicted: Option<FieldOfView>) -> [f32; 2] {
    match (camera, predicted) {
        (Some(camera), _) => {
            [0.5 * f64::from(photo.0) / camera.fx, 0.5 * f64::from(photo.1) / camera.fy].map(|half| half as f32)
        }
        (None, Some(angles)) => {
            [angles.horizontal_deg, angles.vertical_deg].map(|angle| (0.5 * angle).to_radians().tan() as f32)
        }
        (None, None) => [0.6, 0.6 * photo.1 as f32 / photo.0 as f32],
    }
}

fn masked(image: &mut Image<f32>, mask: Option<&Image<f32>>, no_reading: f32) {
    let Some(mask) = mask.filter(|mask| mask.pixels().len() == image.pixels().len()) else { return };
    for (value, mask) in image.pixels_mut().iter_mut().zip(mask.pixels()) {
        if mask.is_nan() || *mask < moge::MASK_THRESHOLD {
            *value = no_reading;
        }
    }
}

/// A model's outputs.
struct Outputs {
    arrays: HashMap<String, Array>,
    letterbox: Option<Letterbox>,
    /// Width and height of the model's input.
    size: (usize, usize),
}

impl Outputs {
    fn array(&self, name: &str) -> Result<&Array, ModelError> {
        self.arrays.get(name).ok_or_else(|| ModelError::Output { output: short(name), why: "it is missing".to_owned() })
    }

    /// An image with one channel, cropped to the photo; not finite where there is no reading.
    fn scalars(&self, name: &str) -> Result<Image<f32>, ModelError> {
        let array = self.array(name)?;
        let sides: Vec<usize> = squeezed(&array.dims);
        let [height, width] = sides[..] else { return Err(misshapen(name, array, "an image with one channel")) };
        self.checked(name, Image::new(width, height, array.values.clone()), |value| value.is_finite())
    }

    /// An image of vectors, cropped to the photo; three channels first or last.
    fn vectors(&self, name: &str) -> Result<Image<[f32; 3]>, ModelError> {
        let array = self.array(name)?;
        let sides: Vec<usize> = array.dims.iter().copied().skip_while(|&size| size == 1).collect();
        let image = match sides[..] {
            [height, width, 3] => Image::new(width, height, array.values.as_chunks().0.to_vec()),
            // A fourth channel would be the normals' concentration.
            [channels @ (3 | 4), height, width] if channels * height * width == array.values.len() => {
                let plane = height * width;
                Image::from_fn(width, height, |x, y| {
                    [0, 1, 2].map(|channel| array.values[channel * plane + y * width + x])
                })
            }
            _ => return Err(misshapen(name, array, "an image with three channels")),
        };
        self.checked(name, image, |vector| vector.iter().all(|value| value.is_finite()))
    }

    /// One number.
    fn number(&self, name: &str) -> Result<f32, ModelError> {
        let array = self.array(name)?;
        match array.values[..] {
            [number] => Ok(number),
            _ => Err(misshapen(name, array, "one number")),
        }
    }

    fn checked<T: Copy>(
        &self,
        name: &str,
        image: Image<T>,
        is_finite: impl Fn(&T) -> bool,
    ) -> Result<Image<T>, ModelError> {
        let aspect = |(width, height): (usize, usize)| (width as f64 / height as f64).ln();
        let made = (image.width(), image.height());
        if made.0 == 0 || made.1 == 0 || (aspect(made) - aspect(self.size)).abs() > MAX_ASPECT {
            let why = format!(
                "its {} × {} pixels do not have the aspect ratio of the input, {} × {}",
                made.0, made.1, self.size.0, self.size.1
            );
            return Err(ModelError::Output { output: short(name), why });
        }
        let whole = self.letterbox.map(|letterbox| letterbox.cropped(&image)).unwrap_or(image);
        let finite = whole.pixels().iter().filter(|value| is_finite(value)).count();
        if (finite as f64) < MIN_FINITE * whole.pixels().len() as f64 || finite == 0 {
            let why =
                format!("{} of its {} pixels are not finite", whole.pixels().len() - finite, whole.pixels().len());
            return Err(ModelError::Output { output: short(name), why });
        }
        Ok(whole)
    }
}

/// Shape of an image with one channel, without axes of size 1 at either end.
fn squeezed(dims: &[usize]) -> Vec<usize> {
    let mut sides = dims.to_vec();
    while sides.len() > 2 && sides[0] == 1 {
        sides.remove(0);
    }
    while sides.len() > 2 && sides.last() == Some(&1) {
        sides.pop();
    }
    sides
}

fn misshapen(name: &str, array: &Array, expected: &str) -> ModelError {
    ModelError::Output { output: short(name), why: format!("its shape is {:?}, expected {expected}", array.dims) }
}
