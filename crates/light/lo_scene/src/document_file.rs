//! The scene file.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use std::sync::Arc;

use half::f16;
use lo_geometry::{Camera, Quat};
use lo_imaging::{Image, Photo, write_atomically};
use lo_octree::{NamedTensor, OctreeHeader, read_tensors, write_tensors};
use safetensors::{Dtype, SafeTensors, View};
use serde::{Deserialize, Serialize};

use crate::camera_source::is_deviation;
use crate::{
    CameraSource, Completion, Estimate, EstimateOrigin, ExpectedLight, Frame, LaidPanorama, LightEdits, ObjectsShown,
    OtherPhoto, PanoramaPicture, PanoramaSource, Room, SceneError, SceneObjects,
};

/// Version of the file's layout that this crate writes and reads.
pub const FORMAT_VERSION: u32 = 1;

/// Key in the safetensors `__metadata__` map that holds the JSON block; the only one, because the map has no order.
const METADATA_KEY: &str = "lightoctree";

/// Tensor of what a panorama gave.
const PANORAMA_SHARE: &str = "panorama_share";

/// Tensor of the panorama itself.
const PANORAMA: &str = "panorama";

/// Tensor of the light that is expected around the camera.
const EXPECTED: &str = "expected_light";

/// Tensor of the objects' layout, and what the names of their files' tensors begin with.
const OBJECTS: &str = "objects";

/// Longest safetensors header that is parsed; ours have about 10 kB.
const MAX_HEADER_BYTES: u64 = 1 << 20;

/// Longest file that is read.
const MAX_FILE_BYTES: u64 = 1 << 33;

/// The JSON block.
#[derive(Serialize, Deserialize)]
struct Metadata {
    format_version: u32,
    program: String,
    octree: OctreeHeader,
    camera: Camera,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    camera_source: Option<CameraSource>,
    exposure: f32,
    completion: Completion,
    room: Option<Room>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    up_deviation_deg: Option<f32>,
    sources: Vec<String>,
    #[serde(default)]
    predicted_depth: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    depth_model: Option<String>,
    #[serde(default)]
    confidence: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    panorama: Option<PanoramaSource>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    panorama_picture: Option<PictureHeader>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    expected_light: Option<ExpectedHeader>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    other_photos: Vec<OtherPhoto>,
    #[serde(default, skip_serializing_if = "LightEdits::is_empty")]
    light_edits: LightEdits,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    objects: Option<ObjectsHeader>,
}

/// What is to be known of the objects' tensors.
#[derive(Serialize, Deserialize)]
struct ObjectsHeader {
    #[serde(flatten)]
    shown: ObjectsShown,
    /// The name of each file's tensor's content.
    #[serde(default)]
    files: Vec<String>,
}

/// What is to be known of a panorama's tensor.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct PictureHeader {
    scale: f32,
    world_from_panorama: Quat,
}

/// What is to be known of the tensor of expected light.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct ExpectedHeader {
    #[serde(flatten)]
    picture: PictureHeader,
    contrast_stops: f32,
}

impl PictureHeader {
    fn of(picture: &PanoramaPicture) -> Self {
        Self { scale: picture.scale(), world_from_panorama: picture.world_from_panorama }
    }

    fn is_valid(&self) -> bool {
        let unit = (self.world_from_panorama.length_squared() - 1.0).abs() < 1e-3;
        self.scale.is_finite() && self.scale >= 1.0 && unit
    }
}

/// The content of a scene file: an estimate with the user's light edits and objects.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFile {
    /// The estimate, which edits leave as it is.
    pub estimate: Arc<Estimate>,
    /// The user's changes of its light.
    pub light_edits: LightEdits,
    /// The objects in its photo.
    pub objects: SceneObjects,
}

impl From<Estimate> for SceneFile {
    /// An estimate without edits and objects.
    fn from(estimate: Estimate) -> Self {
        Self { estimate: estimate.into(), light_edits: LightEdits::default(), objects: SceneObjects::default() }
    }
}

impl SceneFile {
    /// Writes the scene file, and in it `generator`, the name of the writing program; it appears whole or not at all.
    ///
    /// # Errors
    /// Of the file system, naming the path.
    pub fn write(&self, path: &Path, generator: &str) -> Result<(), SceneError> {
        let bytes = self.to_bytes(generator)?;
        write_atomically(path, |out| out.write_all(&bytes)).map_err(SceneError::Write)
    }

    /// Reads a scene file.
    ///
    /// # Errors
    /// Of the file system, naming the path, and all of [`SceneFile::from_bytes`].
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let named = |source| SceneError::Read { path: path.display().to_string(), source };
        let file = File::open(path).map_err(named)?;
        let length = file.metadata().map_err(named)?.len();
        if length > MAX_FILE_BYTES {
            return Err(SceneError::TooLarge { bytes: length, most: MAX_FILE_BYTES });
        }
        let mut bytes = Vec::with_capacity(length as usize);
        // A pipe or a growing file has no length that could be trusted.
        file.take(MAX_FILE_BYTES).read_to_end(&mut bytes).map_err(named)?;
        Self::from_bytes(&bytes)
    }

    /// The bytes of the scene file. The same scene gives the same bytes. `generator` names the writing program in them.
    ///
    /// # Errors
    /// Where the scene is larger than the format can hold, or has objects that would not be read.
    pub fn to_bytes(&self, generator: &str) -> Result<Vec<u8>, SceneError> {
        let Self { estimate, light_edits, objects } = self;
        let EstimateOrigin { completion, camera_source, up_deviation_deg, sources, predicted_depth, depth_model } =
            &estimate.origin;
        let objects = (!objects.is_empty()).then_some(objects);
        if let Some(wrong) = objects.and_then(SceneObjects::wrong) {
            return Err(SceneError::Objects(wrong));
        }
        let (octree, octree_tensors) = write_tensors(&estimate.light);
        let picture = estimate.panorama.as_ref().and_then(|laid| laid.picture.as_ref());
        let picture_header = picture.map(PictureHeader::of);
        let expected_header = estimate.expected.as_ref().map(|expected| ExpectedHeader {
            picture: PictureHeader::of(&expected.picture),
            contrast_stops: expected.contrast_stops,
        });
        let metadata = Metadata {
            format_version: FORMAT_VERSION,
            program: format!("{generator} {}", env!("CARGO_PKG_VERSION")),
            octree,
            camera: estimate.frame.camera,
            camera_source: *camera_source,
            exposure: estimate.frame.exposure,
            completion: *completion,
            room: estimate.room.clone(),
            up_deviation_deg: *up_deviation_deg,
            sources: sources.iter().map(|name| file_name(name)).collect(),
            predicted_depth: *predicted_depth,
            depth_model: depth_model.clone(),
            confidence: estimate.confidence.is_some(),
            panorama: estimate.panorama.as_ref().map(|laid| laid.source.clone()),
            panorama_picture: picture_header,
            expected_light: expected_header,
            other_photos: estimate.other_photos.clone(),
            light_edits: light_edits.clone(),
            objects: objects.map(|SceneObjects { shown, files, .. }| ObjectsHeader {
                shown: *shown,
                files: files.keys().cloned().collect(),
            }),
        };
        let json = serde_json::to_string(&metadata).map_err(|e| SceneError::Metadata(e.to_string()))?;
        let mut tensors: Vec<(String, Tensor)> =
            octree_tensors.into_iter().map(|tensor| (tensor.name.clone(), Tensor::Octree(tensor))).collect();
        let depth = &estimate.frame.depth_m;
        tensors.push(("depth_m".to_owned(), Tensor::floats(vec![depth.height(), depth.width()], depth.pixels())));
        let shape = vec![estimate.frame.photo.height(), estimate.frame.photo.width(), 3];
        let photo = match &estimate.frame.photo {
            Photo::Srgb8(image) => {
                Tensor::Plain { dtype: Dtype::U8, shape, bytes: Cow::Borrowed(image.pixels().as_flattened()) }
            }
            Photo::Linear(image) => Tensor::floats(shape, image.pixels().as_flattened()),
        };
        tensors.push(("photo".to_owned(), photo));
        let shares = [
            ("confidence", estimate.confidence.as_ref()),
            (PANORAMA_SHARE, estimate.panorama.as_ref().map(|laid| &laid.share)),
        ];
        for (name, shares) in shares {
            if let Some(shares) = shares {
                let bytes = shares.concat();
                let tensor = Tensor::Plain { dtype: Dtype::U8, shape: vec![bytes.len()], bytes: Cow::Owned(bytes) };
                tensors.push((name.to_owned(), tensor));
            }
        }
        if let (Some(picture), Some(header)) = (picture, picture_header) {
            tensors.push((PANORAMA.to_owned(), Tensor::picture(picture, header.scale)));
        }
        if let (Some(expected), Some(header)) = (&estimate.expected, expected_header) {
            tensors.push((EXPECTED.to_owned(), Tensor::picture(&expected.picture, header.picture.scale)));
        }
        if let Some(SceneObjects { layout, files, .. }) = objects {
            tensors.push((OBJECTS.to_owned(), Tensor::bytes(layout.as_bytes())));
            let files = files.values().enumerate();
            tensors.extend(files.map(|(index, bytes)| (file_tensor(index), Tensor::bytes(bytes))));
        }
        let map = HashMap::from([(METADATA_KEY.to_owned(), json)]);
        safetensors::serialize(tensors, Some(map)).map_err(|e| SceneError::Container(e.to_string()))
    }

    /// Reads the bytes of a scene file.
    ///
    /// Everything is checked before it is used; what is allocated stays in proportion to the bytes given.
    ///
    /// # Errors
    /// The first thing that is wrong, by name.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, SceneError> {
        if let Some(length) = bytes.first_chunk().map(|&length| u64::from_le_bytes(length))
            && length > MAX_HEADER_BYTES
        {
            return Err(SceneError::Container(format!(
                "its first eight bytes announce a header of {length} bytes, at most {MAX_HEADER_BYTES} are believed"
            )));
        }
        let container = |e: safetensors::SafeTensorError| SceneError::Container(e.to_string());
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(container)?;
        let json = header.metadata().as_ref().and_then(|map| map.get(METADATA_KEY));
        let json = json.ok_or(SceneError::NoMetadata { key: METADATA_KEY })?;
        // The version alone first: another version may have another layout.
        #[derive(Deserialize)]
        struct Version {
            format_version: u32,
        }
        let parse_error = |e: serde_json::Error| SceneError::Metadata(e.to_string());
        let version: Version = serde_json::from_str(json).map_err(parse_error)?;
        if version.format_version != FORMAT_VERSION {
            return Err(SceneError::Version { got: version.format_version, known: FORMAT_VERSION });
        }
        let metadata: Metadata = serde_json::from_str(json).map_err(parse_error)?;
        if !metadata.room.as_ref().is_none_or(Room::is_valid) {
            return Err(SceneError::Metadata("the room's directions are not of unit length".to_owned()));
        }
        let deviations = metadata.up_deviation_deg.is_none_or(is_deviation);
        if !(deviations && metadata.camera_source.is_none_or(|source| source.is_valid())) {
            return Err(SceneError::Metadata("a deviation that is no angle".to_owned()));
        }
        if !metadata.other_photos.iter().all(OtherPhoto::is_valid) {
            return Err(SceneError::Metadata("the pose or camera of one of its other photos".to_owned()));
        }
        metadata.light_edits.check().map_err(SceneError::Metadata)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(container)?;
        let frame = Frame::new(read_photo(&tensors)?, read_depth(&tensors)?, metadata.camera, metadata.exposure)?;
        let light = read_tensors(&tensors, &metadata.octree)?;
        let sources = metadata.sources.iter().map(|name| file_name(name)).collect();
        let confidence = metadata.confidence.then(|| read_shares(&tensors, "confidence", &light.rgba)).transpose()?;
        let Metadata {
            camera_source,
            completion,
            room,
            up_deviation_deg,
            predicted_depth,
            depth_model,
            panorama,
            panorama_picture,
            expected_light,
            other_photos,
            light_edits,
            objects,
            ..
        } = metadata;
        let expected = expected_light.map(|header| read_expected(&tensors, header)).transpose()?;
        let objects = objects.map(|header| read_objects(&tensors, header)).transpose()?.unwrap_or_default();
        let panorama =
            panorama.map(|source| read_panorama(&tensors, source, panorama_picture, &light.rgba)).transpose()?;
        let origin =
            EstimateOrigin { completion, camera_source, up_deviation_deg, sources, predicted_depth, depth_model };
        let observed = Estimate::as_seen(light, frame);
        let estimate = Estimate { room, confidence, expected, panorama, other_photos, origin, ..observed };
        Ok(Self { estimate: estimate.into(), light_edits, objects })
    }
}

fn read_photo(tensors: &SafeTensors<'_>) -> Result<Photo, SceneError> {
    let (dtype, shape, bytes) = tensor(tensors, "photo")?;
    match (dtype, shape.as_slice()) {
        (Dtype::U8, &[height, width, 3]) => Ok(Photo::Srgb8(Image::new(width, height, bytes.as_chunks().0.to_vec()))),
        (Dtype::F32, &[height, width, 3]) => {
            let values = floats(bytes);
            if let Some(index) = values.iter().position(|v| !v.is_finite()) {
                return Err(SceneError::Value { tensor: "photo", index, value: values[index] });
            }
            Ok(Photo::Linear(Image::new(width, height, values.as_chunks().0.to_vec())))
        }
        _ => Err(layout("photo", "U8 or F32 [height, width, 3]", dtype, &shape)),
    }
}

fn read_depth(tensors: &SafeTensors<'_>) -> Result<Image<f32>, SceneError> {
    let (dtype, shape, bytes) = tensor(tensors, "depth_m")?;
    match (dtype, shape.as_slice()) {
        (Dtype::F32, &[height, width]) => Ok(Image::new(width, height, floats(bytes))),
        _ => Err(layout("depth_m", "F32 [height, width]", dtype, &shape)),
    }
}

fn read_panorama(
    tensors: &SafeTensors<'_>,
    mut source: PanoramaSource,
    picture: Option<PictureHeader>,
    rgba: &[Vec<[f32; 4]>],
) -> Result<LaidPanorama, SceneError> {
    if !source.is_valid() {
        return Err(SceneError::Metadata(
            "the panorama's place, angles, exposure or confidence are no such numbers".to_owned(),
        ));
    }
    source.file = file_name(&source.file);
    let picture = picture.map(|header| read_picture(tensors, PANORAMA, header)).transpose()?;
    Ok(LaidPanorama { source, share: read_shares(tensors, PANORAMA_SHARE, rgba)?, picture })
}

fn read_expected(tensors: &SafeTensors<'_>, header: ExpectedHeader) -> Result<ExpectedLight, SceneError> {
    let ExpectedHeader { picture, contrast_stops } = header;
    if !ExpectedLight::is_contrast(contrast_stops) {
        return Err(SceneError::Metadata("contrast_stops of its expected light is out of range".to_owned()));
    }
    Ok(ExpectedLight { picture: read_picture(tensors, EXPECTED, picture)?, contrast_stops })
}

fn read_picture(
    tensors: &SafeTensors<'_>,
    name: &'static str,
    header: PictureHeader,
) -> Result<PanoramaPicture, SceneError> {
    if !header.is_valid() {
        return Err(SceneError::Metadata(format!("scale or rotation of its {name} are no such numbers")));
    }
    let (dtype, shape, bytes) = tensor(tensors, name)?;
    let &[height, width, 3] = shape.as_slice() else {
        return Err(layout(name, "F16 [h, 2 h, 3]", dtype, &shape));
    };
    if dtype != Dtype::F16 || width != 2 * height || height == 0 {
        return Err(layout(name, "F16 [h, 2 h, 3]", dtype, &shape));
    }
    let value = |&word: &[u8; 2]| f16::from_le_bytes(word).to_f32() * header.scale;
    let values: Vec<f32> = bytes.as_chunks().0.iter().map(value).collect();
    if let Some(index) = values.iter().position(|value| !(value.is_finite() && *value >= 0.0)) {
        return Err(SceneError::Value { tensor: name, index, value: values[index] });
    }
    let radiance = Image::new(width, height, values.as_chunks().0.to_vec());
    Ok(PanoramaPicture { radiance, world_from_panorama: header.world_from_panorama })
}

fn read_objects(tensors: &SafeTensors<'_>, header: ObjectsHeader) -> Result<SceneObjects, SceneError> {
    let wrong = SceneError::Objects;
    let bytes = |name: &str, what: &str| {
        let view = tensors.tensor(name).map_err(|_| wrong(format!("tensor {name} with {what} is missing")))?;
        match (view.dtype(), view.shape()) {
            (Dtype::U8, [_]) => Ok(view.data()),
            (dtype, shape) => Err(wrong(format!("tensor {name}: expected U8 [bytes], got {dtype} {shape:?}"))),
        }
    };
    let layout = std::str::from_utf8(bytes(OBJECTS, "their layout")?)
        .map_err(|error| wrong(format!("their layout is no UTF-8 text: {error}")))?;
    let mut files: BTreeMap<String, Arc<[u8]>> = BTreeMap::new();
    for (index, name) in header.files.into_iter().enumerate() {
        let content = bytes(&file_tensor(index), &name)?.into();
        if files.contains_key(&name) {
            return Err(wrong(format!("two of their files are called {name}")));
        }
        files.insert(name, content);
    }
    let objects = SceneObjects { layout: layout.to_owned(), files, shown: header.shown };
    objects.wrong().map_or(Ok(objects), |what| Err(wrong(what)))
}

/// Name of the tensor of an object's file.
fn file_tensor(index: usize) -> String {
    format!("{OBJECTS}.{index}")
}

/// One value for each of the feature rows `rgba[d]`.
fn read_shares(
    tensors: &SafeTensors<'_>,
    name: &'static str,
    rgba: &[Vec<[f32; 4]>],
) -> Result<Vec<Vec<u8>>, SceneError> {
    let (dtype, shape, bytes) = tensor(tensors, name)?;
    let rows: usize = rgba.iter().map(Vec::len).sum();
    if dtype != Dtype::U8 || shape != [rows] {
        return Err(layout(name, "U8 [feature rows of all depths]", dtype, &shape));
    }
    let mut rest = bytes;
    let depths = rgba.iter().map(|rows| {
        let (depth, below) = rest.split_at(rows.len());
        rest = below;
        depth.to_vec()
    });
    Ok(depths.collect())
}

/// Type, shape and bytes; the bytes are as many as type and shape say, safetensors has seen to that.
fn tensor<'data>(
    tensors: &SafeTensors<'data>,
    name: &'static str,
) -> Result<(Dtype, Vec<usize>, &'data [u8]), SceneError> {
    let view = tensors.tensor(name).map_err(|_| SceneError::MissingTensor(name))?;
    Ok((view.dtype(), view.shape().to_vec(), view.data()))
}

fn layout(tensor: &'static str, expected: &'static str, dtype: Dtype, shape: &[usize]) -> SceneError {
    SceneError::Layout { tensor, expected, got: format!("{dtype} {shape:?}") }
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks().0.iter().map(|&word| f32::from_le_bytes(word)).collect()
}

/// What follows the last slash or backslash: scenes travel, folders stay.
fn file_name(path: &str) -> String {
    path.rsplit(['/', '\\']).next().unwrap_or_default().to_owned()
}

enum Tensor<'a> {
    Octree(NamedTensor),
    Plain { dtype: Dtype, shape: Vec<usize>, bytes: Cow<'a, [u8]> },
}

impl<'a> Tensor<'a> {
    fn bytes(bytes: &'a [u8]) -> Self {
        Self::Plain { dtype: Dtype::U8, shape: vec![bytes.len()], bytes: Cow::Borrowed(bytes) }
    }

    fn picture(picture: &PanoramaPicture, scale: f32) -> Self {
        let values = picture.radiance.pixels().as_flattened();
        let bytes = values.iter().flat_map(|value| f16::from_f32(value / scale).to_le_bytes()).collect();
        let shape = vec![picture.radiance.height(), picture.radiance.width(), 3];
        Self::Plain { dtype: Dtype::F16, shape, bytes: Cow::Owned(bytes) }
    }

    fn floats(shape: Vec<usize>, values: &[f32]) -> Self {
        let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        Self::Plain { dtype: Dtype::F32, shape, bytes: Cow::Owned(bytes) }
    }
}

impl View for Tensor<'_> {
    fn dtype(&self) -> Dtype {
        match self {
            Self::Octree(tensor) => tensor.dtype(),
            Self::Plain { dtype, .. } => *dtype,
        }
    }

    fn shape(&self) -> &[usize] {
        match self {
            Self::Octree(tensor) => tensor.shape(),
            Self::Plain { shape, .. } => shape,
        }
    }

    fn data(&self) -> Cow<'_, [u8]> {
        match self {
            Self::Octree(tensor) => tensor.data(),
            Self::Plain { bytes, .. } => Cow::Borrowed(bytes),
        }
    }

    fn data_len(&self) -> usize {
        match self {
            Self::Octree(tensor) => tensor.data_len(),
            Self::Plain { bytes, .. } => bytes.len(),
        }
    }
}
