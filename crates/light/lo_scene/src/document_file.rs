//! Reading and writing of scene files.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::io::{self, Read, Write};
use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::Arc;

use half::f16;
use lo_geometry::{Camera, Quat};
use lo_imaging::{EncodedPhoto, Image, Photo, open_regular_file, read_regular_file, write_atomically};
use lo_octree::{MAX_RADIANCE, OctreeHeader, read_tensors, write_tensors};
use safetensors::tensor::Metadata as Container;
use safetensors::{Dtype, SafeTensors};
use serde::{Deserialize, Serialize};

use crate::camera_source::is_deviation;
use crate::distorted_photo::{self, DistortedHeader};
use crate::document_tensors::{Tensor, floats, layout, tensor};
use crate::frame::MAX_PHOTO_RADIANCE;
use crate::photo_encoding_file::{self, EncodingHeader};
use crate::{
    CameraSource, Completion, Estimate, EstimateOrigin, ExpectedLight, Frame, LightEdits, ObjectDisplay, OtherPhoto,
    PanoramaContribution, PanoramaImage, PanoramaSource, Room, SceneError, SceneObjects,
};

/// Version of the file format that this crate writes and reads.
pub const FORMAT_VERSION: u32 = 1;

/// Key in the safetensors `__metadata__` map that holds the JSON block. There is one key because the map has no
/// order.
const METADATA_KEY: &str = "lightoctree";

/// Name of the tensor with a panorama's share of each row.
const PANORAMA_SHARE: &str = "panorama_share";

/// Name of the tensor with the panorama.
const PANORAMA: &str = "panorama";

/// Name of the tensor with the expected light around the camera.
const EXPECTED: &str = "expected_light";

/// Name of the tensor with the objects' layout, and prefix of the names of their files' tensors.
const OBJECTS: &str = "objects";

/// Longest safetensors header that is parsed, bytes; typical headers have about 10 kB.
const MAX_HEADER_BYTES: u64 = 1 << 20;

/// Longest scene file that is read, bytes.
pub const MAX_FILE_BYTES: u64 = 1 << 33;

/// JSON block of the file.
#[derive(Serialize, Deserialize)]
struct Metadata {
    format_version: u32,
    program: String,
    octree: OctreeHeader,
    camera: Camera,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    camera_source: Option<CameraSource>,
    exposure: f32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    photo_encoding: Option<EncodingHeader>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    distorted: Option<DistortedHeader>,
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
    panorama_picture: Option<PanoramaHeader>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    expected_light: Option<ExpectedHeader>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    other_photos: Vec<OtherPhoto>,
    #[serde(default, skip_serializing_if = "LightEdits::is_empty")]
    light_edits: LightEdits,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    objects: Option<ObjectsHeader>,
}

/// Metadata of the objects' tensors.
#[derive(Serialize, Deserialize)]
struct ObjectsHeader {
    #[serde(flatten)]
    shown: ObjectDisplay,
    /// File names, in the order of the tensors.
    #[serde(default)]
    files: Vec<String>,
}

/// Metadata of a panorama's tensor.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct PanoramaHeader {
    scale: f32,
    world_from_panorama: Quat,
}

/// Metadata of the tensor of expected light.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct ExpectedHeader {
    #[serde(flatten)]
    image: PanoramaHeader,
    contrast_stops: f32,
}

impl PanoramaHeader {
    fn of(image: &PanoramaImage) -> Self {
        Self { scale: image.scale(), world_from_panorama: image.world_from_panorama }
    }

    fn is_valid(&self) -> bool {
        let unit = (self.world_from_panorama.length_squared() - 1.0).abs() < 1e-3;
        (1.0..=MAX_RADIANCE).contains(&self.scale) && unit
    }
}

/// Content of a scene file: an estimate with the user's light edits and objects.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFile {
    /// The estimate, unchanged by edits.
    pub estimate: Arc<Estimate>,
    /// The user's light edits.
    pub light_edits: LightEdits,
    /// The objects inserted in the photo.
    pub objects: SceneObjects,
}

impl From<Estimate> for SceneFile {
    /// Wraps an estimate without edits and objects.
    fn from(estimate: Estimate) -> Self {
        Self { estimate: estimate.into(), light_edits: LightEdits::default(), objects: SceneObjects::default() }
    }
}

impl SceneFile {
    /// Writes the scene file atomically. `generator` is the name of the writing program.
    ///
    /// # Errors
    /// If the file cannot be written; the error names the path.
    pub fn write(&self, path: &Path, generator: &str) -> Result<(), SceneError> {
        let bytes = self.to_bytes(generator)?;
        write_atomically(path, |out| out.write_all(&bytes)).map_err(SceneError::Write)
    }

    /// Reads a scene file.
    ///
    /// # Errors
    /// If the file cannot be read, is not a regular file, or has more than [`MAX_FILE_BYTES`]; the error names the
    /// path. Also returns all errors of [`SceneFile::from_bytes`].
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let bytes = read_regular_file(path, MAX_FILE_BYTES)
            .map_err(|source| SceneError::Read { path: path.display().to_string(), source })?;
        Self::from_bytes(&bytes)
    }

    /// Returns whether the file has a scene's header and the length that this header states. Tensors are not read.
    ///
    /// # Errors
    /// If the file exists but cannot be read, or is not a regular file. A missing file is not complete.
    pub fn is_complete(path: &Path) -> io::Result<bool> {
        let (mut file, file_bytes) = match open_regular_file(path, MAX_FILE_BYTES) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
            opened => opened?,
        };
        let Some(after_length) = file_bytes.checked_sub(8) else { return Ok(false) };
        let mut length = [0; 8];
        file.read_exact(&mut length)?;
        let length = u64::from_le_bytes(length);
        if length > MAX_HEADER_BYTES.min(after_length) {
            return Ok(false);
        }
        let mut header = Vec::new();
        file.take(length).read_to_end(&mut header)?;
        let Ok(header) = serde_json::from_slice::<Container>(&header) else { return Ok(false) };
        let is_scene = header.metadata().as_ref().is_some_and(|metadata| metadata.contains_key(METADATA_KEY));
        Ok(is_scene && header.data_len() as u64 == after_length - length)
    }

    /// Returns the bytes of the scene file, which are deterministic. `generator` is the name of the writing program.
    ///
    /// # Errors
    /// If the scene is larger than the format can hold, or has objects that could not be read back.
    pub fn to_bytes(&self, generator: &str) -> Result<Vec<u8>, SceneError> {
        let Self { estimate, light_edits, objects } = self;
        let EstimateOrigin { completion, camera_source, up_deviation_deg, sources, predicted_depth, depth_model } =
            &estimate.origin;
        light_edits.check().map_err(SceneError::Metadata)?;
        let objects = (!objects.is_empty()).then_some(objects);
        if let Some(wrong) = objects.and_then(SceneObjects::invalid_field) {
            return Err(SceneError::Objects(wrong));
        }
        let (octree, octree_tensors) = write_tensors(&estimate.light);
        let image = estimate.panorama.as_ref().and_then(|contribution| contribution.image.as_ref());
        let image_header = image.map(PanoramaHeader::of);
        let expected_header = estimate.expected.as_ref().map(|expected| ExpectedHeader {
            image: PanoramaHeader::of(&expected.image),
            contrast_stops: expected.contrast_stops,
        });
        let (photo_encoding, encoding_tensors) = match &estimate.frame.photo {
            Photo::Encoded8(photo) => {
                let (header, tensors) = photo_encoding_file::write(&photo.encoding);
                (Some(header), tensors)
            }
            _ => (None, Vec::new()),
        };
        let (distorted, distorted_tensor) = estimate.distorted.as_deref().map(distorted_photo::write).unzip();
        let metadata = Metadata {
            photo_encoding,
            distorted,
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
            panorama: estimate.panorama.as_ref().map(|contribution| contribution.source.clone()),
            panorama_picture: image_header,
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
            Photo::Srgb8(image) | Photo::Encoded8(EncodedPhoto { image, .. }) => Tensor::srgb8(image),
            Photo::Linear(image) => Tensor::floats(shape, image.pixels().as_flattened()),
        };
        tensors.push(("photo".to_owned(), photo));
        tensors.extend(encoding_tensors);
        tensors.extend(distorted_tensor);
        let shares = [
            ("confidence", estimate.confidence.as_ref()),
            (PANORAMA_SHARE, estimate.panorama.as_ref().map(|contribution| &contribution.share)),
        ];
        for (name, shares) in shares {
            if let Some(shares) = shares {
                let bytes = shares.concat();
                let tensor = Tensor::Plain { dtype: Dtype::U8, shape: vec![bytes.len()], bytes: Cow::Owned(bytes) };
                tensors.push((name.to_owned(), tensor));
            }
        }
        if let (Some(image), Some(header)) = (image, image_header) {
            tensors.push((PANORAMA.to_owned(), Tensor::image(image, header.scale)));
        }
        if let (Some(expected), Some(header)) = (&estimate.expected, expected_header) {
            tensors.push((EXPECTED.to_owned(), Tensor::image(&expected.image, header.image.scale)));
        }
        if let Some(SceneObjects { layout, files, .. }) = objects {
            tensors.push((OBJECTS.to_owned(), Tensor::bytes(layout.as_bytes())));
            let files = files.values().enumerate();
            tensors.extend(files.map(|(index, bytes)| (file_tensor(index), Tensor::bytes(bytes))));
        }
        let map = HashMap::from([(METADATA_KEY.to_owned(), json)]);
        safetensors::serialize(tensors, Some(map)).map_err(|e| SceneError::Container(e.to_string()))
    }

    /// Parses the bytes of a scene file.
    ///
    /// Everything is validated before use. Allocations are proportional to the length of `bytes`.
    ///
    /// # Errors
    /// For the first invalid item, by name.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, SceneError> {
        if let Some(length) = bytes.first_chunk().map(|&length| u64::from_le_bytes(length))
            && length > MAX_HEADER_BYTES
        {
            return Err(SceneError::Container(format!(
                "its first eight bytes state a header of {length} bytes; at most {MAX_HEADER_BYTES} are accepted"
            )));
        }
        let container = |e: safetensors::SafeTensorError| SceneError::Container(e.to_string());
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(container)?;
        let json = header.metadata().as_ref().and_then(|map| map.get(METADATA_KEY));
        let json = json.ok_or(SceneError::NoMetadata { key: METADATA_KEY })?;
        // Read the version alone first: another version may have another layout.
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
            let what = "the room's directions must have unit length, and its planes be within 10 km";
            return Err(SceneError::Metadata(what.to_owned()));
        }
        let deviations = metadata.up_deviation_deg.is_none_or(is_deviation);
        if !(deviations && metadata.camera_source.is_none_or(|source| source.is_valid())) {
            return Err(SceneError::Metadata("an expected angular error is not a valid angle".to_owned()));
        }
        if !metadata.other_photos.iter().all(OtherPhoto::is_valid) {
            return Err(SceneError::Metadata("the pose or camera of one of its other photos is invalid".to_owned()));
        }
        metadata.light_edits.check().map_err(SceneError::Metadata)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(container)?;
        let frame = Frame::new(
            read_photo(&tensors, metadata.photo_encoding.as_ref())?,
            read_depth(&tensors)?,
            metadata.camera,
            metadata.exposure,
        )?;
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
            distorted,
            ..
        } = metadata;
        let distorted =
            distorted.map(|header| distorted_photo::read(&tensors, header, &frame.photo, &frame.camera)).transpose()?;
        let expected = expected_light.map(|header| read_expected(&tensors, header)).transpose()?;
        let objects = objects.map(|header| read_objects(&tensors, header)).transpose()?.unwrap_or_default();
        let panorama =
            panorama.map(|source| read_panorama(&tensors, source, panorama_picture, &light.rgba)).transpose()?;
        let origin =
            EstimateOrigin { completion, camera_source, up_deviation_deg, sources, predicted_depth, depth_model };
        let observed = Estimate::observed_only(light, frame);
        let estimate = Estimate { distorted, room, confidence, expected, panorama, other_photos, origin, ..observed };
        Ok(Self { estimate: estimate.into(), light_edits, objects })
    }
}

fn read_photo(tensors: &SafeTensors<'_>, encoding: Option<&EncodingHeader>) -> Result<Photo, SceneError> {
    let (dtype, shape, bytes) = tensor(tensors, "photo")?;
    match (dtype, shape.as_slice()) {
        (Dtype::U8, &[height, width, 3]) => {
            let image = Image::new(width, height, bytes.as_chunks().0.to_vec());
            let encoding = encoding.map(|header| photo_encoding_file::read(tensors, header)).transpose()?;
            Ok(Photo::encoded8(image, encoding.unwrap_or_default()))
        }
        (Dtype::F32, &[height, width, 3]) => {
            let values = floats(bytes);
            check_values("photo", &values, -MAX_PHOTO_RADIANCE..=MAX_PHOTO_RADIANCE)?;
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
    image: Option<PanoramaHeader>,
    rgba: &[Vec<[f32; 4]>],
) -> Result<PanoramaContribution, SceneError> {
    if !source.is_valid() {
        return Err(SceneError::Metadata(
            "the panorama's position, angles, exposure or confidence is invalid".to_owned(),
        ));
    }
    source.file = file_name(&source.file);
    let image = image.map(|header| read_panorama_image(tensors, PANORAMA, header)).transpose()?;
    Ok(PanoramaContribution { source, share: read_shares(tensors, PANORAMA_SHARE, rgba)?, image })
}

fn read_expected(tensors: &SafeTensors<'_>, header: ExpectedHeader) -> Result<ExpectedLight, SceneError> {
    let ExpectedHeader { image, contrast_stops } = header;
    if !ExpectedLight::is_contrast(contrast_stops) {
        return Err(SceneError::Metadata("contrast_stops of its expected light is out of range".to_owned()));
    }
    Ok(ExpectedLight { image: read_panorama_image(tensors, EXPECTED, image)?, contrast_stops })
}

fn read_panorama_image(
    tensors: &SafeTensors<'_>,
    name: &'static str,
    header: PanoramaHeader,
) -> Result<PanoramaImage, SceneError> {
    if !header.is_valid() {
        return Err(SceneError::Metadata(format!("the scale or rotation of its {name} is invalid")));
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
    check_values(name, &values, 0.0..=MAX_RADIANCE)?;
    let radiance = Image::new(width, height, values.as_chunks().0.to_vec());
    Ok(PanoramaImage { radiance, world_from_panorama: header.world_from_panorama })
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
        .map_err(|error| wrong(format!("their layout is not valid UTF-8: {error}")))?;
    let mut files: BTreeMap<String, Arc<[u8]>> = BTreeMap::new();
    for (index, name) in header.files.into_iter().enumerate() {
        let content = bytes(&file_tensor(index), &name)?.into();
        if files.contains_key(&name) {
            return Err(wrong(format!("two of their files are named {name}")));
        }
        files.insert(name, content);
    }
    let objects = SceneObjects { layout: layout.to_owned(), files, shown: header.shown };
    objects.invalid_field().map_or(Ok(objects), |what| Err(wrong(what)))
}

/// Returns the name of the tensor of an object's file.
fn file_tensor(index: usize) -> String {
    format!("{OBJECTS}.{index}")
}

/// Reads one value per feature row of `rgba[d]`.
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

fn check_values(tensor: &'static str, values: &[f32], range: RangeInclusive<f32>) -> Result<(), SceneError> {
    match values.iter().position(|value| !range.contains(value)) {
        Some(index) => {
            let (least, most) = range.into_inner();
            Err(SceneError::Value { tensor, index, value: values[index], least, most })
        }
        None => Ok(()),
    }
}

/// Returns the part after the last slash or backslash; scene files store no folders.
fn file_name(path: &str) -> String {
    path.rsplit(['/', '\\']).next().unwrap_or_default().to_owned()
}
