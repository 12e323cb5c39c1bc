//! The first camera of a USD file in text form (`.usda`), as Blender and others export it.
//!
//! Its world transform is composed of the `xformOp`s of the camera and its ancestors. Cameras look along −Z with +Y up
//! (UsdGeomCamera); scales of ancestors do not change the camera. `metersPerUnit` (USD's default is 0.01) gives metres,
//! `upAxis` (Y by default) the up direction. Time codes are frame numbers. Between samples, values are interpolated
//! linearly as by USD, because exporters omit samples that repeat.
//!
//! The lens is `focalLength` and `horizontalAperture` with their offsets; square pixels are assumed, and the horizontal
//! aperture is the image's width. References to other files are not followed, so a camera must be in the file itself.

use std::collections::HashMap;

use lo_geometry::{DMat3, DQuat, DVec3, Vec3};

use super::pose::Axes;
use super::usda_text::{self, Attribute, Layer, Prim, Value};
use super::values::content;
use super::{Lens, Pose, PoseError, PoseFile, PoseFormat, euler};

/// Most frames of a shot: over an hour.
const MAX_FRAMES: f64 = 100_000.0;

/// Largest frame number, so that it is exact as a floating-point number.
const MAX_FRAME: f64 = 1e9;

pub(super) fn read(text: &str, name: &str) -> Result<PoseFile, PoseError> {
    let layer = usda_text::read(text, name)?;
    let Some(camera) = layer.camera.first() else {
        return Err(content(name, "it has no camera (`def Camera`); references to other files are not followed"));
    };
    let number = |key: &str| match layer.metadata.get(key) {
        None => Ok(None),
        Some(value) => value.number().map(Some).ok_or_else(|| content(name, format!("`{key}` is not a number"))),
    };
    let metres_per_unit = number("metersPerUnit")?.unwrap_or(0.01);
    if metres_per_unit <= 0.0 {
        return Err(content(name, format!("`metersPerUnit` is {metres_per_unit}, not a positive number")));
    }
    let up = match layer.metadata.get("upAxis") {
        None => Vec3::Y,
        Some(Value::Texts(texts)) if texts[..] == ["Y"] => Vec3::Y,
        Some(Value::Texts(texts)) if texts[..] == ["Z"] => Vec3::Z,
        Some(_) => return Err(content(name, "`upAxis` is neither \"Y\" nor \"Z\"")),
    };
    let lens = LensOfPrim::new(camera, name)?;
    let transforms = transforms(&layer, name)?;
    let sampled = transforms.iter().map(|op| op.attribute).chain(lens.attributes());
    let frames = frames(sampled, [number("startTimeCode")?, number("endTimeCode")?], name)?;
    let mut poses = Vec::new();
    for frame in frames {
        let label = frame.map_or("the camera".to_owned(), |frame| format!("frame {frame}"));
        let time = frame.unwrap_or(0) as f64;
        let mut world = Affine::IDENTITY;
        for op in &transforms {
            world = world.after(op.at(time, name)?);
        }
        // Scales of ancestors are removed from the axes.
        let [x, y, z] = [world.linear.x_axis, world.linear.y_axis, world.linear.z_axis];
        let [x, y, z] = [x, y, z].map(|axis| axis / axis.length());
        let position_m = world.shift * metres_per_unit;
        let pose = Pose::from_matrix(DMat3::from_cols(x, y, z), position_m, Axes::OpenGl, name, &label)?;
        poses.push(Pose { frame, lens: Some(lens.at(time)), ..pose });
    }
    Ok(PoseFile { name: name.to_owned(), format: PoseFormat::Usd, poses, world_up: Some(up) })
}

/// Returns all frames of the samples and of the layer's range; a single `None` if nothing moves.
fn frames<'a>(
    attributes: impl Iterator<Item = &'a Attribute<'a>>,
    range: [Option<f64>; 2],
    name: &str,
) -> Result<Vec<Option<i64>>, PoseError> {
    let ends = attributes.filter_map(|attribute| Some((attribute.samples.first()?.0, attribute.samples.last()?.0)));
    let Some((first, last)) = ends.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))) else { return Ok(vec![None]) };
    let first = range[0].map_or(first, |start| start.min(first)).ceil();
    let last = range[1].map_or(last, |end| end.max(last)).floor();
    if first < -MAX_FRAME || last > MAX_FRAME || last - first >= MAX_FRAMES {
        return Err(content(name, format!("time codes from {first} to {last} are more than {MAX_FRAMES} frames")));
    }
    Ok((first as i64..=last as i64).map(Some).collect())
}

/// Returns the transforms of the camera and its ancestors, outermost first.
fn transforms<'a>(layer: &'a Layer<'a>, name: &str) -> Result<Vec<Transform<'a>>, PoseError> {
    let mut innermost_first = Vec::new();
    for prim in &layer.camera {
        let order = match prim.attributes.get("xformOpOrder") {
            // Without an order, a prim has no transform.
            None => continue,
            Some(Attribute { value: Some(Value::Texts(order)), .. }) => &order[..],
            Some(Attribute { value: Some(Value::Numbers(none)), .. }) if none.is_empty() => &[],
            Some(order) => {
                return Err(content(name, format!("line {}: `xformOpOrder` is not a list of names", order.line)));
            }
        };
        for op in order.iter().rev() {
            if *op == "!resetXformStack!" {
                innermost_first.reverse();
                return Ok(innermost_first);
            }
            innermost_first.push(Transform::new(op, prim, name)?);
        }
    }
    innermost_first.reverse();
    Ok(innermost_first)
}

/// A transform `xformOp:…` of a prim.
struct Transform<'a> {
    kind: Kind,
    attribute: &'a Attribute<'a>,
    is_inverse: bool,
}

#[derive(Clone, Copy)]
enum Kind {
    Translate,
    Scale,
    /// Euler angles about fixed axes, in this order.
    Rotate([char; 3]),
    /// An angle about one axis: the index of the axis.
    RotateAbout(usize),
    Orient,
    Matrix,
}

impl<'a> Transform<'a> {
    fn new(op: &str, prim: &'a Prim<'a>, name: &str) -> Result<Self, PoseError> {
        let base = op.strip_prefix("!invert!");
        let (key, is_inverse) = (base.unwrap_or(op), base.is_some());
        let missing = || content(name, format!("`{key}` in `xformOpOrder` of {} has no value", prim.name));
        let attribute = prim.attributes.get(key).ok_or_else(missing)?;
        let kind = key.split(':').nth(1).unwrap_or_default();
        let (kind, count) = match kind {
            "translate" => (Kind::Translate, 3),
            "scale" => (Kind::Scale, 3),
            "rotateX" => (Kind::RotateAbout(0), 1),
            "rotateY" => (Kind::RotateAbout(1), 1),
            "rotateZ" => (Kind::RotateAbout(2), 1),
            "orient" => (Kind::Orient, 4),
            "transform" => (Kind::Matrix, 16),
            _ => match kind.strip_prefix("rotate").and_then(euler::order_named) {
                Some(order) => (Kind::Rotate(order), 3),
                None => return Err(content(name, format!("line {}: `{key}` is not supported", attribute.line))),
            },
        };
        check(attribute, key, count, name)?;
        Ok(Self { kind, attribute, is_inverse })
    }

    fn at(&self, time: f64, name: &str) -> Result<Affine, PoseError> {
        let wrong = |what: &str| content(name, format!("line {}: {what} at time code {time}", self.attribute.line));
        let mut v = [0.0; 16];
        interpolate(self.attribute, time, matches!(self.kind, Kind::Orient), &mut v);
        let three = DVec3::new(v[0], v[1], v[2]);
        let affine = match self.kind {
            Kind::Translate => Affine { shift: three, ..Affine::IDENTITY },
            Kind::Scale => Affine { linear: DMat3::from_diagonal(three), ..Affine::IDENTITY },
            Kind::Rotate(order) => Affine { linear: euler::rotation(order, three.to_array()), ..Affine::IDENTITY },
            Kind::RotateAbout(axis) => {
                let mut degrees = [0.0; 3];
                degrees[axis] = v[0];
                Affine { linear: euler::rotation(['X', 'Y', 'Z'], degrees), ..Affine::IDENTITY }
            }
            Kind::Orient => {
                // The real part is first.
                let length = v[..4].iter().map(|value| value * value).sum::<f64>().sqrt();
                let quaternion = DQuat::from_xyzw(v[1] / length, v[2] / length, v[3] / length, v[0] / length);
                if !quaternion.is_finite() {
                    return Err(wrong("the quaternion has no direction"));
                }
                Affine { linear: DMat3::from_quat(quaternion), ..Affine::IDENTITY }
            }
            Kind::Matrix => {
                // Rows are the images of the axes and the origin, for row vectors.
                let row = |i: usize| DVec3::new(v[4 * i], v[4 * i + 1], v[4 * i + 2]);
                if [v[3], v[7], v[11], v[15] - 1.0].iter().any(|value| value.abs() > 1e-6) {
                    return Err(wrong("the last column of the matrix is not 0 0 0 1"));
                }
                Affine { linear: DMat3::from_cols(row(0), row(1), row(2)), shift: row(3) }
            }
        };
        match self.is_inverse {
            true => affine.inverse().ok_or_else(|| wrong("the transform has no inverse")),
            false => Ok(affine),
        }
    }
}

/// An affine transform of column vectors.
#[derive(Clone, Copy)]
struct Affine {
    linear: DMat3,
    shift: DVec3,
}

impl Affine {
    const IDENTITY: Self = Self { linear: DMat3::IDENTITY, shift: DVec3::ZERO };

    /// Returns this transform after another one of the coordinates.
    fn after(self, inner: Self) -> Self {
        Self { linear: self.linear * inner.linear, shift: self.linear * inner.shift + self.shift }
    }

    fn inverse(self) -> Option<Self> {
        let determinant = self.linear.determinant();
        if determinant == 0.0 || !determinant.is_finite() {
            return None;
        }
        let linear = self.linear.inverse();
        Some(Self { linear, shift: -(linear * self.shift) })
    }
}

/// Lens of the camera.
struct LensOfPrim<'a> {
    attributes: &'a HashMap<&'a str, Attribute<'a>>,
}

impl<'a> LensOfPrim<'a> {
    /// Attributes with USD's default values.
    const DEFAULTS: [(&'static str, f64); 4] = [
        ("focalLength", 50.0),
        ("horizontalAperture", 20.955),
        ("horizontalApertureOffset", 0.0),
        ("verticalApertureOffset", 0.0),
    ];

    fn new(camera: &'a Prim<'a>, name: &str) -> Result<Self, PoseError> {
        if let Some(Value::Texts(texts)) = camera.attributes.get("projection").and_then(|a| a.value.as_ref())
            && texts[..] != ["perspective"]
        {
            return Err(PoseError::CameraModel {
                file: name.to_owned(),
                model: texts.join(" ").chars().take(60).collect(),
            });
        }
        let lens = Self { attributes: &camera.attributes };
        for (key, _) in Self::DEFAULTS {
            if let Some(attribute) = lens.attributes.get(key) {
                check(attribute, key, 1, name)?;
            }
        }
        Ok(lens)
    }

    fn attributes(&self) -> impl Iterator<Item = &'a Attribute<'a>> {
        Self::DEFAULTS.iter().filter_map(|(key, _)| self.attributes.get(key))
    }

    fn at(&self, time: f64) -> Lens {
        let [focal, width, right, up] = Self::DEFAULTS.map(|(key, default)| {
            let mut value = [default];
            if let Some(attribute) = self.attributes.get(key) {
                interpolate(attribute, time, false, &mut value);
            }
            value[0]
        });
        Lens::FilmBack { focal, width, offset: [right, up] }
    }
}

/// Checks that all values of an attribute have this many numbers, and that there is one.
fn check(attribute: &Attribute<'_>, key: &str, count: usize, name: &str) -> Result<(), PoseError> {
    let of_value = match &attribute.value {
        None => !attribute.samples.is_empty(),
        Some(Value::Numbers(numbers)) => numbers.len() == count,
        Some(Value::Texts(_)) => false,
    };
    if of_value && attribute.samples.iter().all(|(_, numbers)| numbers.len() == count) {
        return Ok(());
    }
    let numbers = if count == 1 { "a number" } else { &format!("{count} numbers") };
    Err(content(name, format!("line {}: `{key}` is not {numbers}", attribute.line)))
}

/// Writes the value at a time: that of the samples if there are any, constant before the first and after the last.
/// Quaternions are interpolated along the shorter arc.
fn interpolate(attribute: &Attribute<'_>, time: f64, is_quaternion: bool, out: &mut [f64]) {
    let samples = &attribute.samples;
    let after = samples.partition_point(|(sample, _)| *sample <= time);
    let (a, b, t) = match (after.checked_sub(1).map(|before| &samples[before]), samples.get(after), &attribute.value) {
        (Some(a), Some(b), _) => (&a.1, &b.1, (time - a.0) / (b.0 - a.0)),
        (Some(only), None, _) | (None, Some(only), _) => (&only.1, &only.1, 0.0),
        (None, None, Some(Value::Numbers(value))) => (value, value, 0.0),
        (None, None, _) => return,
    };
    if let (true, &[aw, ax, ay, az], &[bw, bx, by, bz]) = (is_quaternion && t > 0.0, &a[..], &b[..]) {
        let [from, to] = [DQuat::from_xyzw(ax, ay, az, aw), DQuat::from_xyzw(bx, by, bz, bw)];
        let between = from.normalize().slerp(to.normalize(), t);
        out[..4].copy_from_slice(&[between.w, between.x, between.y, between.z]);
        return;
    }
    for (out, (a, b)) in out.iter_mut().zip(a.iter().zip(b)) {
        *out = a + (b - a) * t;
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::PhotoPoses;
    use super::*;

    /// Exports of one animated camera by Blender (bpy 4.5.0). Its parent is scaled by 2. It rests on frames 1 to 3.
    const EULER: &str = include_str!("testdata/blender_euler.usda");
    const QUATERNION: &str = include_str!("testdata/blender_quaternion.usda");
    const MATRIX: &str = include_str!("testdata/blender_matrix.usda");

    /// Frames with the rows of Blender's `matrix_world` divided by its scale of 2, the position and `lens`.
    type Truth = (usize, [[f64; 3]; 3], [f64; 3], f64);
    const BLENDER: [Truth; 4] = [
        (
            1,
            [[0.629462, -0.166465, 0.758991], [0.766609, -0.026406, -0.641571], [0.126841, 0.985694, 0.110992]],
            [5.408604, -6.509939, 3.232154],
            35.0,
        ),
        (
            2,
            [[0.629462, -0.166465, 0.758991], [0.766609, -0.026406, -0.641571], [0.126841, 0.985694, 0.110992]],
            [5.408604, -6.509939, 3.232154],
            36.56,
        ),
        (
            4,
            [[0.474031, -0.314797, 0.822312], [0.851683, -0.073079, -0.518938], [0.223454, 0.946341, 0.233466]],
            [5.475066, -5.752331, 3.183644],
            44.72,
        ),
        (
            5,
            [[0.141674, -0.515026, 0.845385], [0.914696, -0.258422, -0.310725], [0.378497, 0.817292, 0.434481]],
            [5.598497, -4.345344, 3.093553],
            48.44,
        ),
    ];

    fn rotation(rows: [[f64; 3]; 3]) -> DMat3 {
        DMat3::from_cols_array_2d(&rows).transpose()
    }

    fn refusal(text: &str) -> String {
        PoseFile::from_bytes(text.as_bytes(), "cam.usda").unwrap_err().to_string()
    }

    #[test]
    fn cameras_are_those_of_blender() {
        let upright = DMat3::from_rotation_x(-90f64.to_radians());
        for (text, up, turned) in
            [(EULER, Vec3::Z, DMat3::IDENTITY), (QUATERNION, Vec3::Y, upright), (MATRIX, Vec3::Y, upright)]
        {
            let file = PoseFile::from_bytes(text.as_bytes(), "cam.usda").unwrap();
            assert_eq!((file.format, file.world_up, file.poses.len()), (PoseFormat::Usd, Some(up), 6));
            for (frame, rows, position_m, lens_mm) in BLENDER {
                let pose = &file.poses[frame - 1];
                assert_eq!(pose.frame, Some(frame as i64));
                // single precision of Blender, and six decimals above
                assert!(pose.rotation.abs_diff_eq(turned * rotation(rows), 5e-6), "{frame}: {}", pose.rotation);
                let error = (pose.position_m - turned * DVec3::from_array(position_m)).length();
                assert!(error < 5e-6, "{frame}: {}", pose.position_m);
                // Blender's sensor of 36 mm is the width of the image.
                let camera = pose.lens.unwrap().camera(1920, 1080, "file", "photo").unwrap();
                assert!((camera.fx - lens_mm / 36.0 * 1920.0).abs() < 1e-3, "{frame}: {camera:?}");
                assert_eq!((camera.fy, camera.cx, camera.cy), (camera.fx, 960.0, 540.0));
            }
        }
        let file = PoseFile::from_bytes(EULER.as_bytes(), "cam.usda").unwrap();
        let poses = PhotoPoses::of(&[file], &["shot_0002.png", "shot_0006.png"]).unwrap();
        assert!((poses.up.unwrap() - Vec3::new(0.126841, 0.985694, 0.110992)).length() < 1e-5);
    }

    #[test]
    fn pivots_inverses_and_all_kinds_of_rotation() {
        let text = r#"#usda 1.0
(
    metersPerUnit = 0.01
    upAxis = "Y"
)
def Xform "a"
{
    float3 xformOp:rotateZXY = (10, 20, 30)
    double3 xformOp:translate = (100, 200, 300)
    float3 xformOp:translate:pivot = (10, 20, 30)
    float xformOp:rotateY = 15
    float3 xformOp:scale = (3, 3, 3)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:translate:pivot", "xformOp:rotateZXY",
        "xformOp:rotateY", "xformOp:scale", "!invert!xformOp:translate:pivot"]
    def Camera "b"
    {
        float3 xformOp:rotateYZX = (40, 50, 60)
        quatd xformOp:orient = (0.5, 0.5, -0.5, 0.5)
        float xformOp:rotateX = 25
        double3 xformOp:translate.timeSamples = { 1: (1, 2, 3), 5: (5, -2, 3) }
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateYZX", "xformOp:orient",
            "!invert!xformOp:rotateX"]
    }
}
"#;
        let file = PoseFile::from_bytes(text.as_bytes(), "cam.usda").unwrap();
        // `ComputeLocalToWorldTransform` of OpenUSD (bpy 4.5.0) at time codes 1, 2 and 5, divided by the scale of 3.
        let rows = [
            [2.2153537360558584, -0.03251593688882004, 2.022659273825327],
            [0.730255639991067, -2.784492202030051, -0.8445885845161991],
            [1.886513854813845, 1.1160402728764234, -2.048296752161008],
        ];
        let positions = [
            (1, [68.91331752334295, 163.15304262903655, 257.29299923166803]),
            (2, [72.35127998696329, 162.15614426360816, 255.01558672012257]),
            (5, [82.66516737782433, 159.16544916732298, 248.1833491854862]),
        ];
        for (frame, position_cm) in positions {
            let pose = &file.poses[frame - 1];
            assert!(pose.rotation.abs_diff_eq(rotation(rows) * (1.0 / 3.0), 1e-6), "{}", pose.rotation);
            assert!((pose.position_m - DVec3::from_array(position_cm) / 100.0).length() < 1e-6, "{}", pose.position_m);
        }
        let reset = text.replace("[\"xformOp:translate\", \"xformOp:rotateYZX\"", "[\"!resetXformStack!\"");
        let reset = PoseFile::from_bytes(reset.as_bytes(), "cam.usda").unwrap();
        assert_eq!(reset.poses[0].position_m, DVec3::ZERO, "the parent is ignored");
    }

    #[test]
    fn quaternions_take_the_shorter_arc() {
        // 0° and 90° about z, the latter with the opposite sign: 45° halfway.
        let half = 0.5f64.sqrt();
        let text = format!(
            "#usda 1.0\ndef Camera \"c\" {{
                quatf xformOp:orient.timeSamples = {{ 0: (1, 0, 0, 0), 2: (-{half}, 0, 0, -{half}) }}
                uniform token[] xformOpOrder = [\"xformOp:orient\"]\n}}"
        );
        let file = PoseFile::from_bytes(text.as_bytes(), "cam.usda").unwrap();
        assert!(file.poses[1].rotation.abs_diff_eq(DMat3::from_rotation_z(45f64.to_radians()), 1e-9));
    }

    #[test]
    fn shifted_lens_of_a_camera_at_rest() {
        let text = "#usda 1.0\ndef Camera \"c\" {
            float focalLength = 0.35
            float horizontalAperture = 0.36
            float horizontalApertureOffset = 0.036
            float verticalApertureOffset = -0.018\n}";
        let file = PoseFile::from_bytes(text.as_bytes(), "cam.usda").unwrap();
        let poses = PhotoPoses::of(&[file], &["a_0001.jpg", "a_0100.jpg", "b.jpg"]).unwrap();
        let camera = poses.camera(2, 1920, 1080).unwrap().unwrap();
        // `calc_matrix_camera` of Blender for shifts of 0.1 and −0.05: the axis is at −0.2 and 0.17778 in the image of
        // side 2, and the scale is 1.94444 and 3.45679.
        assert!((camera.cx - 960.0 * (1.0 - 0.2)).abs() < 1e-3, "{camera:?}");
        assert!((camera.cy - 540.0 * (1.0 - 0.1777778)).abs() < 1e-3, "{camera:?}");
        assert!((camera.fx - 960.0 * 1.9444444).abs() < 1e-3 && (camera.fy - 540.0 * 3.4567897).abs() < 1e-3);
        assert_eq!(poses.up, Some(Vec3::Y));
        assert!(file_of("float focalLength = -1").poses[0].lens.unwrap().camera(9, 9, "", "").is_err());
        assert!(file_of("float horizontalAperture = 0").poses[0].lens.unwrap().camera(9, 9, "", "").is_err());
    }

    fn file_of(camera: &str) -> PoseFile {
        let text = format!("#usda 1.0\ndef Camera \"c\" {{\n{camera}\n}}");
        PoseFile::from_bytes(text.as_bytes(), "cam.usda").unwrap()
    }

    #[test]
    fn invalid_cameras_are_named() {
        let camera = |body: &str| refusal(&format!("#usda 1.0\ndef Camera \"c\" {{\n{body}\n}}"));
        let op = |values: &str, op: &str| camera(&format!("{values}\nuniform token[] xformOpOrder = [\"{op}\"]"));
        let binary = |bytes: &[u8], name: &str| PoseFile::from_bytes(bytes, name).unwrap_err().to_string();
        for (message, expected) in [
            (binary(b"PXR-USDC\0\x09\xff", "cam.usd"), "cam.usd is binary USD; export it as text"),
            (binary(b"PK\x03\x04\xff", "cam.usdz"), "cam.usdz is binary USD"),
            (refusal("#usda 1.0\ndef Xform \"a\" {}"), "cam.usda: it has no camera (`def Camera`)"),
            (refusal("#usda 1.0\n( metersPerUnit = 0 )\ndef Camera \"c\" {}"), "`metersPerUnit` is 0"),
            (refusal("#usda 1.0\n( upAxis = \"X\" )\ndef Camera \"c\" {}"), "`upAxis` is neither"),
            (refusal("#usda 1.0\n( startTimeCode = \"\" )\ndef Camera \"c\" {}"), "`startTimeCode` is not a number"),
            (camera("token projection = \"orthographic\""), "camera model is orthographic"),
            (camera("float focalLength = (1, 2)"), "line 3: `focalLength` is not a number"),
            (camera("float focalLength.timeSamples = {}"), "line 3: `focalLength` is not a number"),
            (camera("float focalLength.timeSamples = { 0: 1, 1e6: 2 }"), "more than 100000 frames"),
            (camera("float focalLength.timeSamples = { 1e300: 2 }"), "more than 100000 frames"),
            (camera("float focalLength.timeSamples = { 0.5: 2 }"), "it has no poses"),
            (op("", "xformOp:translate"), "`xformOp:translate` in `xformOpOrder` of c has no value"),
            (
                op("double3 xformOp:translate = (1, 2)", "xformOp:translate"),
                "line 3: `xformOp:translate` is not 3 numbers",
            ),
            (
                op("double3 xformOp:rotateXXY = (1, 2)", "xformOp:rotateXXY"),
                "line 3: `xformOp:rotateXXY` is not supported",
            ),
            (op("quatf xformOp:orient = (0, 0, 0, 0)", "xformOp:orient"), "line 3: the quaternion has no direction"),
            (op("float3 xformOp:scale = (0, 1, 1)", "!invert!xformOp:scale"), "line 3: the transform has no inverse"),
            (op("float3 xformOp:scale = (-1, 1, 1)", "xformOp:scale"), "the pose of the camera is mirrored"),
            (op("double3 xformOp:translate = (1e12, 0, 0)", "xformOp:translate"), "contains 10000000000"),
            (
                op("matrix4d xformOp:transform = ((1,0,0,1),(0,1,0,0),(0,0,1,0),(0,0,0,1))", "xformOp:transform"),
                "line 3: the last column of the matrix is not 0 0 0 1",
            ),
            (
                op("matrix4d xformOp:transform = ((1,0,0,0),(1,1,0,0),(0,0,1,0),(0,0,0,1))", "xformOp:transform"),
                "two of its axes meet at 45.0 degrees",
            ),
        ] {
            assert!(message.contains(expected), "{message:?} has no {expected:?}");
        }
    }
}
