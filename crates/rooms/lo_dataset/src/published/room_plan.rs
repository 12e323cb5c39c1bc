//! Room plans: hand-labelled geometry of a panorama's room. Floor corners, lower edges of furniture, and their heights.

use std::path::Path;

use lo_geometry::{Vec2, Vec3, direction_from_uv, pixel_direction};
use lo_imaging::DepthMap;
use serde::Deserialize;

use crate::DatasetError;

/// Allowed range of heights and distances, in metres.
const RANGE_M: std::ops::RangeInclusive<f32> = 0.01..=200.0;

/// Smallest |y| of a unit direction that can hit a horizontal face.
const GRAZING: f32 = 1e-3;

/// Minimum height above the camera of the lid that closes a room without a known ceiling, in metres.
const MIN_LID_M: f32 = 0.5;

/// Geometry of a room in one of its panoramas, labelled by hand like room layouts (Zou et al., "LayoutNet", CVPR 2018).
/// Labels are image points, whose distance follows from the camera's height above the floor. A `.json` file:
///
/// ```json
/// {
///   "width": 1536, "camera_height_m": 1.55, "height_from": "the door is 2.05 m",
///   "ceiling_m": 2.9, "wall_top_m": null, "place": "north_studio",
///   "floor": [[310, 470], [620, 452], [905, 480], [1290, 495]],
///   "uprights": [{"base": [[400, 500], [470, 498]], "height_m": 0.75, "from_m": 0.0}],
///   "tops": [{"outline": [[400, 470], [470, 468], [468, 455], [405, 456]], "height_m": 0.75}],
///   "unknown": [[[700, 300], [740, 300], [740, 420], [700, 420]]]
/// }
/// ```
///
/// Points are (column, row) in pixels of a panorama that is `width` wide and half as high. Columns may extend beyond
/// either end. `floor` lists in order the corners where walls meet the floor, all below the horizon. `uprights` are
/// vertical faces that stand on their `base` line. `tops` are horizontal faces as seen. Without a `ceiling_m`, walls
/// reach up to `wall_top_m`. Inside an `unknown` polygon there is no distance. Panoramas of one `place` share its
/// photos, and belong to the same split.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoomPlan {
    width: f32,
    camera_height_m: f32,
    /// For human readers of the file.
    #[serde(rename = "height_from")]
    _height_from: String,
    ceiling_m: Option<f32>,
    wall_top_m: Option<f32>,
    place: Option<String>,
    floor: Vec<Vec2>,
    #[serde(default)]
    uprights: Vec<Upright>,
    #[serde(default)]
    tops: Vec<Top>,
    #[serde(default)]
    unknown: Vec<Vec<Vec2>>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Upright {
    base: Vec<Vec2>,
    height_m: f32,
    #[serde(default)]
    from_m: f32,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Top {
    outline: Vec<Vec2>,
    height_m: f32,
}

/// Vertical face: a line on the floor, and its range of heights relative to the camera.
struct Face {
    ends: [Vec2; 2],
    low_m: f32,
    high_m: f32,
}

impl RoomPlan {
    /// Reads a plan.
    ///
    /// # Errors
    /// If the file cannot be read or is not a plan, or a height or point is invalid; the error names it.
    pub fn read(path: &Path) -> Result<Self, DatasetError> {
        Self::parse(&std::fs::read_to_string(path).map_err(DatasetError::io(path))?, path)
    }

    /// Parses the text of a plan. Errors name the file `path`.
    ///
    /// # Errors
    /// See [`RoomPlan::read`].
    pub fn parse(text: &str, path: &Path) -> Result<Self, DatasetError> {
        let plan: Self = serde_json::from_str(text).map_err(|error| DatasetError::field(path, "plan", error))?;
        plan.check().map_err(|(field, reason)| DatasetError::field(path, field, reason))?;
        Ok(plan)
    }

    /// Returns the name of its place, if other panoramas may show it too.
    pub fn place(&self) -> Option<&str> {
        self.place.as_deref()
    }

    fn check(&self) -> Result<(), (String, String)> {
        let height = |field: &str, value: f32| {
            let why = || format!("{value} m is not within {} to {} m", RANGE_M.start(), RANGE_M.end());
            if RANGE_M.contains(&value) { Ok(()) } else { Err((field.to_owned(), why())) }
        };
        if !(self.width.is_finite() && self.width >= 2.0) {
            return Err(("width".to_owned(), format!("{} is not a panorama's width in pixels", self.width)));
        }
        height("camera_height_m", self.camera_height_m)?;
        match (self.ceiling_m, self.wall_top_m) {
            (Some(ceiling), _) if ceiling <= self.camera_height_m => {
                return Err(("ceiling_m".to_owned(), format!("{ceiling} m is not above the camera")));
            }
            (Some(ceiling), _) => height("ceiling_m", ceiling)?,
            (None, Some(top)) => height("wall_top_m", top)?,
            (None, None) => return Err(("wall_top_m".to_owned(), "required without ceiling_m".to_owned())),
        }
        let on_floor = |field: String, points: &[Vec2], min: usize| {
            if points.len() < min {
                return Err((field, format!("{} points; at least {min} are required", points.len())));
            }
            let wrong = points.iter().find(|&&point| self.floor_point(point).is_none());
            wrong.map_or(Ok(()), |point| Err((field, format!("({}, {}) is not on the floor", point.x, point.y))))
        };
        on_floor("floor".to_owned(), &self.floor, 3)?;
        for (i, Upright { base, height_m, from_m }) in self.uprights.iter().enumerate() {
            on_floor(format!("uprights[{i}].base"), base, 2)?;
            height(&format!("uprights[{i}].height_m"), *height_m)?;
            if !(0.0..*height_m).contains(from_m) {
                return Err((format!("uprights[{i}].from_m"), format!("{from_m} m is not below {height_m} m")));
            }
        }
        let tops = self.tops.iter().map(|top| &top.outline).enumerate().map(|(i, outline)| ("tops", i, outline));
        let unknown = self.unknown.iter().enumerate().map(|(i, outline)| ("unknown", i, outline));
        for (field, i, outline) in tops.chain(unknown) {
            if outline.len() < 3 || !outline.iter().all(|point| point.is_finite()) {
                return Err((format!("{field}[{i}]"), "not a polygon of at least three points".to_owned()));
            }
        }
        self.tops.iter().enumerate().try_for_each(|(i, top)| height(&format!("tops[{i}].height_m"), top.height_m))
    }

    /// Returns the distance of visible surfaces in metres, as an equirectangular map. 0 where the plan does not define
    /// it.
    pub fn distance_m(&self, width: usize, height: usize) -> DepthMap {
        let faces = self.faces();
        DepthMap::from_fn(width, height, |x, y| {
            let at = self.point(x, y, width);
            let unknown = self.unknown.iter().any(|outline| self.outline_contains(outline, at));
            let found = if unknown { None } else { self.visible_m(at, pixel_direction(x, y, width, height), &faces) };
            found.unwrap_or(0.0)
        })
    }

    /// Returns the distance of the closed room's surfaces, from which light seems to come. Differs from
    /// [`RoomPlan::distance_m`] in two ways: unknown areas use the surfaces behind them, and walls without a ceiling
    /// are closed by a lid.
    pub fn enclosure_m(&self, width: usize, height: usize) -> DepthMap {
        let faces = self.faces();
        DepthMap::from_fn(width, height, |x, y| {
            let direction = pixel_direction(x, y, width, height);
            let lid = || level(direction, (self.top_m() - self.camera_height_m).max(MIN_LID_M));
            // Near the horizon, gaps between the floor's corners may have no surface.
            let none = *RANGE_M.end();
            self.visible_m(self.point(x, y, width), direction, &faces).or_else(lid).unwrap_or(none).min(none)
        })
    }

    /// Returns the centre of a pixel of a map of this width, as a point of the panorama.
    fn point(&self, x: usize, y: usize, width: usize) -> Vec2 {
        (Vec2::new(x as f32, y as f32) + 0.5) * (self.width / width as f32)
    }

    /// Returns the height of the walls.
    fn top_m(&self) -> f32 {
        self.ceiling_m.or(self.wall_top_m).unwrap_or_default()
    }

    /// Returns the distance of the top seen there, else of the nearest of floor, ceiling, walls and uprights.
    fn visible_m(&self, at: Vec2, direction: Vec3, faces: &[Face]) -> Option<f32> {
        let over = |height_m: f32| level(direction, height_m - self.camera_height_m);
        let top = self.tops.iter().rev().filter(|top| self.outline_contains(&top.outline, at));
        if let Some(top) = top.filter_map(|top| over(top.height_m)).next() {
            return Some(top);
        }
        let upright = faces.iter().filter_map(|face| face.distance_m(direction));
        upright.chain(over(0.0)).chain(self.ceiling_m.and_then(over)).min_by(f32::total_cmp)
    }

    fn faces(&self) -> Vec<Face> {
        let line = |a: Vec2, b: Vec2| Some([self.floor_point(a)?, self.floor_point(b)?]);
        let over = |height: f32| height - self.camera_height_m;
        let high_m = over(self.top_m());
        let next = self.floor.iter().cycle().skip(1);
        let walls = self.floor.iter().zip(next).filter_map(|(&a, &b)| line(a, b));
        let walls = walls.map(|ends| Face { ends, low_m: over(0.0), high_m });
        let uprights = self.uprights.iter().flat_map(|upright| {
            let lines = upright.base.windows(2).filter_map(|pair| line(pair[0], pair[1]));
            lines.map(|ends| Face { ends, low_m: over(upright.from_m), high_m: over(upright.height_m) })
        });
        walls.chain(uprights).collect()
    }

    /// Projects a point of the panorama onto the floor: to the right, and ahead. `None` if it is not on the floor.
    fn floor_point(&self, point: Vec2) -> Option<Vec2> {
        let direction =
            direction_from_uv(Vec2::new((point.x / self.width).rem_euclid(1.0), 2.0 * point.y / self.width));
        let below = direction.is_finite() && point.y <= 0.5 * self.width;
        let distance_m = level(direction, -self.camera_height_m).filter(|_| below)?;
        Some(Vec2::new(direction.x, -direction.z) * distance_m)
    }

    /// Whether a polygon of the panorama contains a point, including the part beyond the panorama's ends.
    fn outline_contains(&self, outline: &[Vec2], at: Vec2) -> bool {
        [-self.width, 0.0, self.width].into_iter().any(|aside| contains(outline, at + Vec2::new(aside, 0.0)))
    }
}

impl Face {
    fn distance_m(&self, direction: Vec3) -> Option<f32> {
        let [a, b] = self.ends;
        let (ray, along) = (Vec2::new(direction.x, -direction.z), b - a);
        let across = ray.perp_dot(along);
        let distance_m = a.perp_dot(along) / across;
        let share = a.perp_dot(ray) / across;
        let height_m = distance_m * direction.y;
        let met = distance_m > 0.0
            && distance_m.is_finite()
            && (0.0..=1.0).contains(&share)
            && (self.low_m..=self.high_m).contains(&height_m);
        met.then_some(distance_m)
    }
}

/// Returns the distance along a direction to a horizontal face at a height relative to the camera. `None` at grazing
/// angles and in the opposite direction.
fn level(direction: Vec3, height_m: f32) -> Option<f32> {
    (direction.y.abs() > GRAZING && direction.y * height_m > 0.0).then(|| height_m / direction.y)
}

/// Whether a polygon contains a point, by the even-odd rule.
fn contains(outline: &[Vec2], at: Vec2) -> bool {
    let next = outline.iter().cycle().skip(1);
    let crossings = outline
        .iter()
        .zip(next)
        .filter(|(a, b)| (a.y > at.y) != (b.y > at.y) && at.x < a.x + (at.y - a.y) / (b.y - a.y) * (b.x - a.x));
    crossings.count() % 2 == 1
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const WIDTH: f32 = 1536.0;

    /// Projects a point of the room, relative to the camera, into the panorama.
    fn seen(x: f32, y: f32, z: f32) -> Vec2 {
        let uv = lo_geometry::uv_from_direction(Vec3::new(x, y, z).normalize());
        Vec2::new(uv.x * WIDTH, uv.y * 0.5 * WIDTH)
    }

    fn list(points: &[Vec2]) -> serde_json::Value {
        points.iter().map(|point| vec![point.x, point.y]).collect()
    }

    /// A room of 6 m × 5 m × 2.7 m with a cupboard and a table.
    fn plan() -> serde_json::Value {
        let floor = |x: f32, z: f32| seen(x, -1.5, z);
        let table = [[0.5, -1.0], [1.5, -1.0], [1.5, -1.8], [0.5, -1.8]].map(|[x, z]| seen(x, -0.75, z));
        serde_json::json!({
            "width": WIDTH, "camera_height_m": 1.5, "height_from": "made up", "ceiling_m": 2.7, "wall_top_m": null,
            "floor": list(&[floor(-2.0, -3.0), floor(4.0, -3.0), floor(4.0, 2.0), floor(-2.0, 2.0)]),
            "uprights": [{"base": list(&[floor(-1.0, -2.0), floor(0.0, -2.0)]), "height_m": 1.9}],
            "tops": [{"outline": list(&table), "height_m": 0.75}],
            "unknown": [[[1500.0, 300.0], [1560.0, 300.0], [1560.0, 500.0], [1500.0, 500.0]]],
        })
    }

    fn read(plan: &serde_json::Value) -> Result<RoomPlan, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.json");
        std::fs::write(&path, plan.to_string()).unwrap();
        RoomPlan::read(&path).map_err(|error| error.to_string())
    }

    #[test]
    fn distances_are_those_of_the_room() {
        let (width, height) = (512, 256);
        let distance_m = read(&plan()).unwrap().distance_m(width, height);
        let at = |x: f32, y: f32, z: f32| {
            let point = seen(x, y, z) * (width as f32 / WIDTH);
            let pixel = (point.x as usize, point.y as usize);
            (distance_m[pixel], Vec3::new(x, y, z).length())
        };
        let places = [
            (3.0, -0.4, -3.0, "wall"),
            (4.0, 0.9, 1.0, "side wall"),
            (2.0, -1.5, 1.0, "floor"),
            (1.0, 1.2, -0.5, "ceiling"),
            (-0.5, 0.2, -2.0, "cupboard"),
            (1.0, -0.75, -1.3, "table"),
            (-0.6, 0.75, -3.0, "wall over the cupboard"),
        ];
        for (x, y, z, what) in places {
            let (found, true_m) = at(x, y, z);
            assert!((found / true_m - 1.0).abs() < 0.02, "{what}: {found} m, not {true_m} m");
        }
        // Across the panorama's seam, and on both sides of it.
        assert!([505, 511, 2, 6].iter().all(|&x| distance_m[(x, 128)] == 0.0));
        let known = distance_m.pixels().iter().filter(|z| **z > 0.0).count();
        assert!(known > 125_000 && known < 131_072, "{known}");
    }

    #[test]
    fn walls_end_at_their_top_without_a_ceiling() {
        let mut open = plan();
        (open["ceiling_m"], open["wall_top_m"]) = (serde_json::Value::Null, serde_json::json!(2.4));
        let distance_m = read(&open).unwrap().distance_m(512, 256);
        let row = |y: f32| (seen(2.0, y, -3.0) * (512.0 / WIDTH)).y as usize;
        let column = (seen(2.0, 0.0, -3.0) * (512.0 / WIDTH)).x as usize;
        assert!(distance_m[(column, row(0.8))] > 3.0 && distance_m[(column, row(1.0))] == 0.0);
        let enclosure_m = read(&open).unwrap().enclosure_m(512, 256);
        assert!((enclosure_m[(column, 0)] - 0.9).abs() < 1e-3, "a lid at the height of walls");
        assert!(enclosure_m.pixels().iter().all(|z| (0.7..6.0).contains(z)), "and no hole");
    }

    proptest::proptest! {
        /// As in `fuzz/fuzz_targets/plan.rs`, which uses arbitrary text.
        #[test]
        fn plans_with_arbitrary_numbers_are_rejected_or_have_distances(
            changes in proptest::collection::vec((0usize..60, 0usize..9, -2000f32..2000.0), 1..6),
        ) {
            let mut numbers = Vec::new();
            let mut other = plan();
            collect(&mut other, &mut numbers);
            for (index, kind, value) in changes {
                let index = index % numbers.len();
                *numbers[index] = serde_json::json!([0.0, -1.0, 1e-30, 1e30, 1e9, 768.0, 384.0, 0.01, value][kind]);
            }
            if let Ok(plan) = read(&other) {
                let (seen, closed) = (plan.distance_m(32, 16), plan.enclosure_m(32, 16));
                proptest::prop_assert!(seen.pixels().iter().all(|z| z.is_finite() && *z >= 0.0), "{other}");
                proptest::prop_assert!(closed.pixels().iter().all(|z| *z > 0.0 && *z <= 200.0), "{other}");
            }
        }
    }

    fn collect<'a>(value: &'a mut serde_json::Value, numbers: &mut Vec<&'a mut serde_json::Value>) {
        match value {
            serde_json::Value::Number(_) => numbers.push(value),
            serde_json::Value::Array(values) => values.iter_mut().for_each(|value| collect(value, numbers)),
            serde_json::Value::Object(fields) => fields.values_mut().for_each(|value| collect(value, numbers)),
            _ => {}
        }
    }

    #[test]
    fn errors_name_the_field() {
        type Change<'a> = &'a dyn Fn(&mut serde_json::Value);
        let with = |change: Change| {
            let mut other = plan();
            change(&mut other);
            read(&other).unwrap_err()
        };
        let cases: [(Change, &str); 8] = [
            (&|p| p["floor"][1] = serde_json::json!([700.0, 380.0]), "floor: (700, 380) is not on the floor"),
            (&|p| p["camera_height_m"] = serde_json::json!(-1.0), "camera_height_m: -1 m is not within"),
            (&|p| p["ceiling_m"] = serde_json::json!(1.2), "ceiling_m: 1.2 m is not above the camera"),
            (&|p| p["ceiling_m"] = serde_json::Value::Null, "wall_top_m: required"),
            (&|p| p["uprights"][0]["from_m"] = serde_json::json!(2.0), "uprights[0].from_m: 2 m is not below 1.9 m"),
            (&|p| p["tops"][0]["outline"] = serde_json::json!([[1, 2]]), "tops[0]: not a polygon"),
            (&|p| p["width"] = serde_json::json!(0), "width: 0 is not a panorama's width"),
            (&|p| p["flor"] = serde_json::json!([]), "flor"),
        ];
        for (change, expected) in cases {
            let error = with(change);
            assert!(error.contains("room.json") && error.contains(expected), "{error}");
        }
    }
}
