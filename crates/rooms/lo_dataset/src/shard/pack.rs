//! Conversion between a record and the files of a shard. File names in the header omit the record's key and its dot.

use half::f16;
use lo_geometry::{Camera, Quat, Vec3};
use lo_imaging::{
    DepthMap, Image, Photo, RadianceImage, encode_png, linear_from_srgb8, photo_from_bytes, srgb8_from_linear,
};
use lo_octree::{Provenance, RadiancePoint};

use super::array::{decode, encode, halves};
use super::header::{FORMAT_VERSION, FRAME, HalfFloats, PointsHeader, RecordHeader, ShotHeader, UNITS, ViewHeader};
use crate::{NovelView, Record, Shot};

/// Name of the header file.
pub(super) const HEADER: &str = "json";

/// Error in a file of a record.
#[derive(Debug)]
pub(super) struct MemberError {
    /// The file; [`HEADER`] if the header is wrong.
    pub file: String,
    /// Part of the file.
    pub field: String,
    /// Description of the problem.
    pub reason: String,
}

impl MemberError {
    pub fn new(file: &str, field: impl Into<String>, reason: impl ToString) -> Self {
        Self { file: file.to_owned(), field: field.into(), reason: reason.to_string() }
    }
}

/// Returns the files of a record, the header first.
pub(super) fn pack(record: &Record, generator: &str) -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    let points = (!record.points.is_empty()).then(|| pack_points(&record.points, record.point_area_m2, &mut files));
    let views = record
        .views
        .iter()
        .enumerate()
        .map(|(i, view)| ViewHeader {
            position_m: view.position_m.to_array(),
            rotation_xyzw: view.rotation.to_array(),
            radiance: pack_radiance(&view.radiance, format!("view{i}.radiance.npy"), &mut files),
            depth: view.depth_m.as_ref().map(|depth| pack_depth(depth, format!("view{i}.depth.npy"), &mut files)),
        })
        .collect();
    let shots = record.shots.iter().enumerate().map(|(i, shot)| pack_shot(shot, i, &mut files)).collect();
    let header = RecordHeader {
        format_version: FORMAT_VERSION,
        generator: generator.to_owned(),
        scene_id: record.scene_id.clone(),
        frame: FRAME.to_owned(),
        units: UNITS.to_owned(),
        up: record.up.map(|up| up.to_array()),
        points,
        views,
        shots,
        metadata: record.metadata.clone(),
    };
    let json = serde_json::to_vec(&header).expect("a header has only string keys and is written to memory");
    files.insert(0, (HEADER.to_owned(), json));
    files
}

type Files = Vec<(String, Vec<u8>)>;

fn push_file(files: &mut Files, name: String, bytes: Vec<u8>) -> String {
    files.push((name.clone(), bytes));
    name
}

fn pack_points(points: &[RadiancePoint], area_m2: Option<f32>, files: &mut Files) -> PointsHeader {
    let finite = |p: &&RadiancePoint| p.position_m.is_finite();
    let low = points.iter().filter(finite).map(|p| p.position_m).reduce(Vec3::min).unwrap_or_default();
    let high = points.iter().filter(finite).map(|p| p.position_m).reduce(Vec3::max).unwrap_or_default();
    let step_m = ((high - low).max_element() / f32::from(u16::MAX)).max(1e-6);
    let count = points.len();
    let codes = points.iter().flat_map(|p| ((p.position_m - low) / step_m).to_array()).map(|v| v.round() as u16);
    let position = push_file(files, "points.position.npy".to_owned(), encode(&[count, 3], codes));
    let (exponent, values) = halves(points.iter().flat_map(|p| p.radiance));
    let file = push_file(files, "points.radiance.npy".to_owned(), encode(&[count, 3], values));
    PointsHeader { position, origin_m: low.to_array(), step_m, radiance: HalfFloats { file, exponent }, area_m2 }
}

fn pack_radiance(image: &RadianceImage, name: String, files: &mut Files) -> HalfFloats {
    let (exponent, values) = halves(image.pixels().iter().flatten().copied());
    let shape = [image.height(), image.width(), 3];
    HalfFloats { file: push_file(files, name, encode(&shape, values)), exponent }
}

fn pack_depth(depth: &DepthMap, name: String, files: &mut Files) -> String {
    // Depth beyond the range of u16 millimetres becomes "no reading"; a valid reading never becomes 0.
    let code = |&z: &f32| match (z * 1000.0).round() {
        mm if mm > 0.0 && mm <= f32::from(u16::MAX) => mm as u16,
        _ => u16::from(z > 0.0 && z < 0.001),
    };
    push_file(files, name, encode(&[depth.height(), depth.width()], depth.pixels().iter().map(code)))
}

fn pack_shot(shot: &Shot, number: usize, files: &mut Files) -> ShotHeader {
    let name = |what: &str| format!("shot{number}.{what}");
    let (extension, bytes) = match &shot.jpeg {
        Some(jpeg) => ("photo.jpg", jpeg.clone()),
        None => ("photo.png", encode_png(&shot.photo)),
    };
    let photo = push_file(files, name(extension), bytes);
    let radiance = shot.radiance.as_ref().map(|image| pack_radiance(image, name("radiance.npy"), files));
    let depth = shot.depth_m.as_ref().map(|depth| pack_depth(depth, name("depth.npy"), files));
    let sensor_depth = shot.sensor_depth_m.as_ref().map(|depth| pack_depth(depth, name("sensor.npy"), files));
    let normal = shot.normal.as_ref().map(|image| {
        let codes = image.pixels().iter().flatten().map(|v| (v * 127.0).round() as i8);
        push_file(files, name("normal.npy"), encode(&[image.height(), image.width(), 3], codes))
    });
    let albedo = shot
        .albedo
        .as_ref()
        .map(|image| push_file(files, name("albedo.png"), encode_png(&image.map(|rgb| rgb.map(srgb8_from_linear)))));
    ShotHeader {
        position_m: shot.position_m.to_array(),
        rotation_xyzw: shot.rotation.to_array(),
        gains: shot.gains,
        camera: shot.camera,
        photo,
        radiance,
        depth,
        sensor_depth,
        normal,
        albedo,
        views: shot.views.clone(),
        metadata: shot.metadata.clone(),
    }
}

/// Reads and checks a header.
pub(super) fn header(bytes: &[u8]) -> Result<RecordHeader, MemberError> {
    /// Field that every version has.
    #[derive(serde::Deserialize)]
    struct Version {
        format_version: u32,
    }
    let wrong = |reason: &dyn ToString| MemberError::new(HEADER, "header", reason.to_string());
    let version: Version = serde_json::from_slice(bytes).map_err(|e| wrong(&e))?;
    if version.format_version != FORMAT_VERSION {
        let reason =
            format!("version {} is not supported; this program reads version {FORMAT_VERSION}", version.format_version);
        return Err(MemberError::new(HEADER, "format_version", reason));
    }
    let header: RecordHeader = serde_json::from_slice(bytes).map_err(|e| wrong(&e))?;
    if header.shots.is_empty() {
        return Err(MemberError::new(HEADER, "shots", "the list is empty"));
    }
    for (i, shot) in header.shots.iter().enumerate() {
        if let Some(view) = shot.views.iter().find(|&&view| view >= header.views.len()) {
            let reason = format!("view {view} does not exist; the record has {}", header.views.len());
            return Err(MemberError::new(HEADER, format!("shots[{i}].views"), reason));
        }
        let camera = shot.camera;
        Camera::new(camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height)
            .map_err(|error| MemberError::new(HEADER, format!("shots[{i}].camera"), error))?;
    }
    Ok(header)
}

/// Builds a record with one photo, its views and the points. `read` returns the bytes of a file.
pub(super) fn unpack(
    key: &str,
    header: &RecordHeader,
    shot: usize,
    read: &dyn Fn(&str) -> Result<Vec<u8>, MemberError>,
) -> Result<Record, MemberError> {
    let points = header.points.as_ref().map(|points| unpack_points(points, read)).transpose()?.unwrap_or_default();
    let point_area_m2 = header.points.as_ref().and_then(|points| points.area_m2);
    if let Some(area_m2) = point_area_m2.filter(|area| !(*area > 0.0 && area.is_finite())) {
        return Err(MemberError::new(HEADER, "points.area_m2", format!("{area_m2} is not positive")));
    }
    let taken = &header.shots[shot];
    let mut views = Vec::with_capacity(taken.views.len());
    for &i in &taken.views {
        let view = &header.views[i];
        let radiance = unpack_radiance(&view.radiance, read)?;
        let size = (radiance.width(), radiance.height());
        if size.0 != 2 * size.1 {
            let reason = format!("{} × {} pixels; a panorama is twice as wide as high", size.0, size.1);
            return Err(MemberError::new(&view.radiance.file, "size", reason));
        }
        let depth_m = view.depth.as_ref().map(|file| unpack_depth(file, Some(size), read)).transpose()?;
        let name = format!("views[{i}]");
        views.push(NovelView {
            position_m: position(view.position_m, &name)?,
            rotation: rotation(view.rotation_xyzw, &name)?,
            radiance,
            depth_m,
        });
    }
    let up = header.up.map(|up| {
        let up = Vec3::from_array(up);
        let unit = up.is_finite() && (up.length() - 1.0).abs() < 1e-3;
        if unit { Ok(up) } else { Err(MemberError::new(HEADER, "up", format!("{up} is not a unit vector"))) }
    });
    let mut shot = unpack_shot(taken, &format!("shots[{shot}]"), read)?;
    shot.views = (0..views.len()).collect();
    Ok(Record {
        key: key.to_owned(),
        scene_id: header.scene_id.clone(),
        up: up.transpose()?,
        points,
        point_area_m2,
        views,
        shots: vec![shot],
        metadata: header.metadata.clone(),
    })
}

type Read<'a> = &'a dyn Fn(&str) -> Result<Vec<u8>, MemberError>;

fn position(position_m: [f32; 3], name: &str) -> Result<Vec3, MemberError> {
    let position = Vec3::from_array(position_m);
    if position.is_finite() {
        Ok(position)
    } else {
        Err(MemberError::new(HEADER, format!("{name}.position_m"), format!("{position} is not finite")))
    }
}

fn rotation(xyzw: [f32; 4], name: &str) -> Result<Quat, MemberError> {
    let rotation = Quat::from_array(xyzw);
    if rotation.is_finite() && (rotation.length() - 1.0).abs() < 1e-3 {
        Ok(rotation)
    } else {
        Err(MemberError::new(HEADER, format!("{name}.rotation_xyzw"), format!("{xyzw:?} is not a unit quaternion")))
    }
}

fn unpack_points(header: &PointsHeader, read: Read) -> Result<Vec<RadiancePoint>, MemberError> {
    let origin = position(header.origin_m, "points")?;
    if !(header.step_m > 0.0 && header.step_m.is_finite()) {
        return Err(MemberError::new(HEADER, "points.step_m", format!("{} is not positive", header.step_m)));
    }
    let (shape, codes) = decode::<u16>(&read(&header.position)?, 2)
        .map_err(|reason| MemberError::new(&header.position, "array", reason))?;
    let radiance = unpack_halves(&header.radiance, 2, read)?;
    if shape != radiance.0 || shape[1] != 3 {
        let reason = format!("{:?}, but positions have {shape:?}; both must be [n, 3]", radiance.0);
        return Err(MemberError::new(&header.radiance.file, "shape", reason));
    }
    let points = codes.as_chunks::<3>().0.iter().zip(radiance.1.as_chunks::<3>().0);
    Ok(points
        .map(|(code, &radiance)| RadiancePoint {
            position_m: origin + Vec3::from_array(code.map(f32::from)) * header.step_m,
            radiance,
            provenance: Provenance::Inferred,
        })
        .collect())
}

/// Returns the shape and the values. NaN, infinite and negative radiance is an error.
fn unpack_halves(header: &HalfFloats, axes: usize, read: Read) -> Result<(Vec<usize>, Vec<f32>), MemberError> {
    let (shape, codes) =
        decode::<f16>(&read(&header.file)?, axes).map_err(|reason| MemberError::new(&header.file, "array", reason))?;
    let scale = (header.exponent as f32).exp2();
    let values: Vec<f32> = codes.into_iter().map(|code| code.to_f32() * scale).collect();
    match values.iter().position(|v| !(v.is_finite() && *v >= 0.0)) {
        Some(i) => Err(MemberError::new(&header.file, format!("value {i}"), format!("radiance {}", values[i]))),
        None => Ok((shape, values)),
    }
}

fn unpack_radiance(header: &HalfFloats, read: Read) -> Result<RadianceImage, MemberError> {
    let (shape, values) = unpack_halves(header, 3, read)?;
    image(&header.file, &shape, &values)
}

fn image<T: Copy>(file: &str, shape: &[usize], values: &[T]) -> Result<Image<[T; 3]>, MemberError> {
    match shape {
        &[height, width, 3] if height > 0 && width > 0 => {
            Ok(Image::new(width, height, values.as_chunks::<3>().0.to_vec()))
        }
        _ => Err(MemberError::new(file, "shape", format!("{shape:?}; a colour image is [height, width, 3]"))),
    }
}

/// Reads a depth map; `size` is the required size.
fn unpack_depth(file: &str, size: Option<(usize, usize)>, read: Read) -> Result<DepthMap, MemberError> {
    let (shape, codes) = decode::<u16>(&read(file)?, 2).map_err(|reason| MemberError::new(file, "array", reason))?;
    let found = (shape[1], shape[0]);
    if found.0 == 0 || found.1 == 0 || size.is_some_and(|size| size != found) {
        return Err(MemberError::new(file, "shape", format!("{shape:?}; it must match the image")));
    }
    Ok(Image::new(found.0, found.1, codes.into_iter().map(|mm| f32::from(mm) * 0.001).collect()))
}

fn unpack_photo(file: &str, size: (usize, usize), read: Read) -> Result<Image<[u8; 3]>, MemberError> {
    let decoded = photo_from_bytes(&read(file)?, file).map_err(|error| MemberError::new(file, "picture", error))?;
    let photo = match decoded.photo {
        Photo::Linear(_) => return Err(MemberError::new(file, "picture", "8-bit sRGB is expected")),
        photo => photo.into_srgb8(),
    };
    if (photo.width(), photo.height()) != size {
        let reason =
            format!("{} × {} pixels, but the camera has {} × {}", photo.width(), photo.height(), size.0, size.1);
        return Err(MemberError::new(file, "size", reason));
    }
    Ok(photo)
}

fn unpack_shot(header: &ShotHeader, name: &str, read: Read) -> Result<Shot, MemberError> {
    let size = (header.camera.width as usize, header.camera.height as usize);
    let same = |file: &str, width: usize, height: usize| {
        if (width, height) == size {
            Ok(())
        } else {
            let reason = format!("{width} × {height} pixels, but the camera has {} × {}", size.0, size.1);
            Err(MemberError::new(file, "size", reason))
        }
    };
    if !header.gains.iter().all(|gain| gain.is_finite() && *gain > 0.0) {
        return Err(MemberError::new(
            HEADER,
            format!("{name}.gains"),
            format!("{:?} are not all positive", header.gains),
        ));
    }
    let photo = unpack_photo(&header.photo, size, read)?;
    let radiance = header.radiance.as_ref().map(|halves| unpack_radiance(halves, read)).transpose()?;
    if let (Some(image), Some(halves)) = (&radiance, &header.radiance) {
        same(&halves.file, image.width(), image.height())?;
    }
    let normal = header.normal.as_ref().map(|file| {
        let (shape, codes) = decode::<i8>(&read(file)?, 3).map_err(|reason| MemberError::new(file, "array", reason))?;
        let normal = image(file, &shape, &codes)?;
        same(file, normal.width(), normal.height())?;
        Ok(normal.map(|code| Vec3::from_array(code.map(f32::from)).normalize_or_zero().to_array()))
    });
    let albedo =
        header.albedo.as_ref().map(|file| Ok(unpack_photo(file, size, read)?.map(|rgb| rgb.map(linear_from_srgb8))));
    let depth = |file: &Option<String>, size| file.as_ref().map(|file| unpack_depth(file, size, read)).transpose();
    Ok(Shot {
        position_m: position(header.position_m, name)?,
        rotation: rotation(header.rotation_xyzw, name)?,
        gains: header.gains,
        camera: header.camera,
        photo,
        jpeg: None,
        radiance,
        depth_m: depth(&header.depth, Some(size))?,
        sensor_depth_m: depth(&header.sensor_depth, None)?,
        normal: normal.transpose()?,
        albedo: albedo.transpose()?,
        views: Vec::new(),
        metadata: header.metadata.clone(),
    })
}
