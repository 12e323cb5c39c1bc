//! Objects on the command line: `--layout`, or each `--mesh` with its options.

use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::{ArgMatches, Args, Command, FromArgMatches};
use lo_geometry::Vec3;
use lo_imaging as imaging;
use lo_insert::{Align, Layout, LayoutObject, PathSource, Unit};
use lo_mesh::MaterialSpec;

use crate::choice::{Choice, choice};
use crate::commands::{MAX_TEXT_BYTES, parse, read_text};
use crate::usage::Usage;

/// The options without their order, as clap parses them.
#[derive(Debug, Args)]
struct Flags {
    /// Object: glTF, GLB, OBJ, PLY, STL or a built-in one; may be repeated [default: the objects that the viewer saved
    /// in the scene]
    ///
    /// Built-in are builtin:sphere, builtin:suzanne, builtin:tea-set, builtin:glass-sphere, builtin:wine-glass and
    /// builtin:bottle.
    ///
    /// For several objects, each --mesh is followed by its own --at, --pixel or --path, --scale, --unit or --height,
    /// --yaw-deg, --align, --animation and --material.
    #[arg(long, value_name = "FILE")]
    mesh: Vec<PathBuf>,

    /// File with objects and their positions, instead of --mesh: {"objects": [{"mesh": …, "pixel": …}, …]}; see
    /// docs/layout.md
    #[arg(
        long,
        value_name = "FILE.json",
        conflicts_with_all = ["mesh", "at", "pixel", "path", "scale", "unit", "height", "yaw_deg", "align", "animation", "material"]
    )]
    layout: Option<PathBuf>,

    /// Position of the centre of the object's base, in metres: +X right, +Y up, the camera at 0,0,0 looks along -Z
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::point, allow_hyphen_values = true, requires = "mesh")]
    at: Vec<Vec3>,

    /// Place the object on the surface at this pixel of the photo; see --align
    #[arg(long, value_name = "U,V", value_parser = parse::pixel, allow_hyphen_values = true, requires = "mesh")]
    pixel: Vec<[f64; 2]>,

    /// Move the object along keyframes; requires --frames, and %04d in the output's name or a video
    #[arg(long, value_name = "FILE.json", requires = "mesh")]
    path: Vec<PathBuf>,

    /// Metres per unit of the mesh [default: 1]
    #[arg(long, value_name = "S", value_parser = parse::positive, allow_hyphen_values = true, requires = "mesh")]
    scale: Vec<f64>,

    /// Unit of length of the mesh, instead of --scale [default: m]
    #[arg(long, value_name = "UNIT", requires = "mesh", value_parser = choice(&UNITS))]
    unit: Vec<Unit>,

    /// Height of the object in metres, instead of --scale
    #[arg(long, value_name = "METRES", value_parser = parse::positive, allow_hyphen_values = true, requires = "mesh")]
    height: Vec<f64>,

    /// Rotation about the vertical in degrees, counter-clockwise seen from above [default: 0]
    #[arg(long, value_name = "A", allow_hyphen_values = true, requires = "mesh")]
    yaw_deg: Vec<f32>,

    /// Up direction of the object [default: gravity]
    #[arg(long, value_name = "UP", requires = "mesh", value_parser = choice(&ALIGNMENTS))]
    align: Vec<Align>,

    /// Animation of a glTF mesh, by its name, that plays and repeats in a sequence; requires --frames or --plate
    #[arg(long, value_name = "NAME", requires = "mesh")]
    animation: Vec<String>,

    /// Material of the whole object: a name or a JSON object [default: the mesh's materials]
    #[arg(long, value_name = "NAME|JSON", requires = "mesh")]
    material: Vec<String>,
}

/// Up directions of an object.
static ALIGNMENTS: [Choice<Align>; 3] = [
    ("gravity", Align::Gravity, "Up direction of the room, if known"),
    ("surface", Align::Surface, "Normal of the surface at the pixel, if tilted by more than 10°; also on walls"),
    ("none", Align::None, "Up in the photo"),
];

/// Units of length of a mesh.
static UNITS: [Choice<Unit>; 5] = [
    ("m", Unit::Metre, "Metres"),
    ("cm", Unit::Centimetre, "Centimetres"),
    ("mm", Unit::Millimetre, "Millimetres"),
    ("in", Unit::Inch, "Inches"),
    ("ft", Unit::Foot, "Feet"),
];

/// Values of an option with their indices on the command line.
type IndexedValues<T> = Vec<(usize, T)>;

/// The options with their order on the command line.
#[derive(Debug)]
pub struct ObjectArgs {
    layout: Option<PathBuf>,
    mesh: IndexedValues<PathBuf>,
    at: IndexedValues<Vec3>,
    pixel: IndexedValues<[f64; 2]>,
    path: IndexedValues<PathBuf>,
    scale: IndexedValues<f64>,
    unit: IndexedValues<Unit>,
    height: IndexedValues<f64>,
    yaw_deg: IndexedValues<f32>,
    align: IndexedValues<Align>,
    animation: IndexedValues<String>,
    material: IndexedValues<String>,
}

impl Args for ObjectArgs {
    fn augment_args(command: Command) -> Command {
        Flags::augment_args(command)
    }

    fn augment_args_for_update(command: Command) -> Command {
        Flags::augment_args_for_update(command)
    }
}

impl FromArgMatches for ObjectArgs {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        fn indexed<T>(matches: &ArgMatches, option: &str, values: Vec<T>) -> IndexedValues<T> {
            matches.indices_of(option).into_iter().flatten().zip(values).collect()
        }
        let flags = Flags::from_arg_matches(matches)?;
        Ok(Self {
            layout: flags.layout,
            mesh: indexed(matches, "mesh", flags.mesh),
            at: indexed(matches, "at", flags.at),
            pixel: indexed(matches, "pixel", flags.pixel),
            path: indexed(matches, "path", flags.path),
            scale: indexed(matches, "scale", flags.scale),
            unit: indexed(matches, "unit", flags.unit),
            height: indexed(matches, "height", flags.height),
            yaw_deg: indexed(matches, "yaw_deg", flags.yaw_deg),
            align: indexed(matches, "align", flags.align),
            animation: indexed(matches, "animation", flags.animation),
            material: indexed(matches, "material", flags.material),
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl ObjectArgs {
    /// Reads the layout with the keyframes of all paths, and returns the folder that its paths are relative to.
    ///
    /// `None` if the command line specifies no objects.
    pub fn layout(&self) -> anyhow::Result<Option<(Layout, PathBuf)>> {
        if self.layout.is_none() && self.mesh.is_empty() {
            return Ok(None);
        }
        let (layout, folder) = match &self.layout {
            Some(file) => {
                let text = read_text(file)?;
                let layout = Layout::from_json(&text).with_context(|| format!("{}", file.display()))?;
                (layout, file.parent().map(Path::to_owned).unwrap_or_default())
            }
            None => (Layout::new(self.objects()?)?, PathBuf::new()),
        };
        let layout = layout.with_paths(|path| imaging::read_regular_text(folder.join(path), MAX_TEXT_BYTES))?;
        Ok(Some((layout, folder)))
    }

    /// Assigns the options to the objects: those after each `--mesh`, or all if there is one `--mesh`.
    fn objects(&self) -> Result<Vec<LayoutObject>, Usage> {
        if let [_, _, ..] = self.mesh[..]
            && let Some(option) = self.first_option(0..self.mesh[0].0)
        {
            return Err(Usage(format!(
                "{option} precedes the first --mesh: with several objects, give the options of each after its --mesh"
            )));
        }
        let next = self.mesh.iter().skip(1).map(|&(index, _)| index).chain([usize::MAX]);
        let is_single = self.mesh.len() == 1;
        let ranges = self.mesh.iter().zip(next).map(|(&(own, _), next)| if is_single { 0..next } else { own..next });
        self.mesh.iter().zip(ranges).map(|((_, mesh), range)| self.object(mesh, &range)).collect()
    }

    fn object(&self, mesh: &Path, range: &Range<usize>) -> Result<LayoutObject, Usage> {
        let name = mesh.display();
        let (at, pixel) =
            (single_value("--at", &self.at, mesh, range)?, single_value("--pixel", &self.pixel, mesh, range)?);
        let path = single_value("--path", &self.path, mesh, range)?;
        match [at.is_some(), pixel.is_some(), path.is_some()].into_iter().filter(|&is_given| is_given).count() {
            0 => {
                return Err(Usage(format!(
                    "{name} has no position; give --at X,Y,Z, --pixel U,V, or --path FILE.json with --frames N"
                )));
            }
            1 => {}
            _ => return Err(Usage(format!("{name} has more than one position; give one of --at, --pixel and --path"))),
        }
        let (scale, height_m) =
            (single_value("--scale", &self.scale, mesh, range)?, single_value("--height", &self.height, mesh, range)?);
        let unit = single_value("--unit", &self.unit, mesh, range)?;
        let sizes = [("--scale", scale.is_some()), ("--height", height_m.is_some()), ("--unit", unit.is_some())];
        let given: Vec<&str> = sizes.into_iter().filter(|&(_, given)| given).map(|(option, _)| option).collect();
        if let [first, second, ..] = given[..] {
            return Err(Usage(format!("{first} and {second} cannot both be given for {name}")));
        }
        let yaw_deg = single_value("--yaw-deg", &self.yaw_deg, mesh, range)?;
        if path.is_some() && yaw_deg.is_some() {
            return Err(Usage(format!(
                "--yaw-deg cannot be given for {name}: the keyframes of --path define its rotation"
            )));
        }
        let material = single_value("--material", &self.material, mesh, range)?;
        let material = material.map(|text| MaterialSpec::parse(&text)).transpose();
        Ok(LayoutObject {
            mesh: mesh.to_owned(),
            name: None,
            pixel,
            position_m: at.map(|at| at.to_array().map(f64::from)),
            path: path.map(PathSource::File),
            on: None,
            scale,
            unit,
            height_m,
            yaw_deg: yaw_deg.map(f64::from),
            align: single_value("--align", &self.align, mesh, range)?,
            animation: single_value("--animation", &self.animation, mesh, range)?,
            material: material.map_err(|error| Usage(format!("--material: {error}")))?,
            hidden: false,
            locked: false,
        })
    }

    /// Returns the first option of any object within a range of the command line.
    fn first_option(&self, range: Range<usize>) -> Option<&'static str> {
        fn first<T>(values: &IndexedValues<T>) -> Option<usize> {
            values.first().map(|&(index, _)| index)
        }
        let options = [
            ("--at", first(&self.at)),
            ("--pixel", first(&self.pixel)),
            ("--path", first(&self.path)),
            ("--scale", first(&self.scale)),
            ("--unit", first(&self.unit)),
            ("--height", first(&self.height)),
            ("--yaw-deg", first(&self.yaw_deg)),
            ("--align", first(&self.align)),
            ("--animation", first(&self.animation)),
            ("--material", first(&self.material)),
        ];
        let within = options.into_iter().filter(|(_, index)| index.is_some_and(|index| range.contains(&index)));
        within.min_by_key(|&(_, index)| index).map(|(option, _)| option)
    }
}

/// Returns the value of an option within an object's range of the command line.
///
/// # Errors
/// The option is given twice.
fn single_value<T: Clone>(
    option: &str,
    values: &IndexedValues<T>,
    mesh: &Path,
    range: &Range<usize>,
) -> Result<Option<T>, Usage> {
    let mut within = values.iter().filter(|(index, _)| range.contains(index)).map(|(_, value)| value);
    let value = within.next().cloned();
    match within.next() {
        None => Ok(value),
        Some(_) => Err(Usage(format!("{option} is given twice for {}", mesh.display()))),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct TestCli {
        #[command(flatten)]
        objects: ObjectArgs,
        #[arg(long)]
        list_materials: bool,
    }

    fn objects(line: &str) -> Result<Vec<LayoutObject>, Usage> {
        TestCli::try_parse_from(std::iter::once("insert").chain(line.split(' '))).unwrap().objects.objects()
    }

    #[test]
    fn each_mesh_has_the_options_after_it() {
        let line = "--mesh a.glb --pixel 1,2 --height 0.5 --mesh b.glb --at 0,-1,-2 --scale 2 --yaw-deg -30 --material gold \
                    --mesh c.glb --align none --pixel 3,4 --unit mm";
        let [a, b, c] = &objects(line).unwrap()[..] else { panic!() };
        assert_eq!(
            (a.mesh.as_path(), a.pixel, a.height_m, a.scale),
            (Path::new("a.glb"), Some([1.0, 2.0]), Some(0.5), None)
        );
        assert_eq!(
            (b.position_m, b.pixel, b.scale, b.yaw_deg),
            (Some([0.0, -1.0, -2.0]), None, Some(2.0), Some(-30.0))
        );
        assert_eq!(b.material.as_ref().unwrap().preset.as_deref(), Some("gold"));
        assert_eq!((c.pixel, c.align, a.align), (Some([3.0, 4.0]), Some(Align::None), None));
        assert_eq!((c.unit, a.unit), (Some(Unit::Millimetre), None));
        assert!(a.material.is_none() && c.material.is_none());
        // The options of a single object may precede its --mesh.
        let one = objects("--pixel 1,2 --height 0.5 --mesh a.glb --material gold").unwrap();
        assert_eq!((one[0].pixel, one[0].height_m), (Some([1.0, 2.0]), Some(0.5)));
    }

    #[test]
    fn options_without_an_object_and_duplicate_options_are_rejected() {
        for (line, words) in [
            ("--pixel 1,2 --mesh a.glb --mesh b.glb --pixel 1,2", "--pixel precedes the first --mesh"),
            ("--mesh a.glb --pixel 1,2 --mesh b.glb", "b.glb has no position"),
            ("--mesh a.glb", "a.glb has no position"),
            ("--mesh a.glb --pixel 1,2 --pixel 3,4", "--pixel is given twice for a.glb"),
            ("--mesh a.glb --pixel 1,2 --at 0,0,-1", "a.glb has more than one position"),
            ("--mesh a.glb --pixel 1,2 --scale 1 --height 1", "--scale and --height"),
            ("--mesh a.glb --pixel 1,2 --unit cm --height 1", "--height and --unit cannot both be given for a.glb"),
            ("--unit cm --mesh a.glb --mesh b.glb --pixel 1,2", "--unit precedes the first --mesh"),
            ("--mesh a.glb --path p.json --yaw-deg 3", "--yaw-deg"),
            ("--mesh a.glb --pixel 1,2 --material golf", "golf"),
        ] {
            let Usage(message) = objects(line).unwrap_err();
            assert!(message.contains(words), "{line}: {message}");
        }
        for line in ["--layout a.json --mesh b.glb", "--layout a.json --pixel 1,2", "--pixel 1,2"] {
            let parsed = TestCli::try_parse_from(std::iter::once("insert").chain(line.split(' ')));
            assert!(parsed.is_err(), "{line}");
        }
    }
}
