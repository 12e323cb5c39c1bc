//! The `lightoctree insert` command line equivalent to a session's state.

use lightoctree::{InferredLight, LightTuning};
use lo_insert::{Align, LayoutObject};

use crate::{Object, State};

/// Returns the command line that writes a state's final image from the scene file, or the video if it is animated.
/// Quoted for a POSIX shell. `None` without objects.
pub fn insert_command(scene_file: &str, state: &State) -> Option<String> {
    let words = insert_argv(scene_file, state)?;
    Some(words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" "))
}

/// Returns the unquoted words of [`insert_command`], `lightoctree` first.
pub fn insert_argv(scene_file: &str, state: &State) -> Option<Vec<String>> {
    if state.objects.is_empty() {
        return None;
    }
    let mut words = vec!["lightoctree".to_owned(), "insert".into(), file_argument(scene_file)];
    if state.span_s().is_some() {
        let (frames, fps) = (state.sequence_frames().to_string(), state.fps.to_string());
        words.extend(["--layout", "objects.json", "--frames", &frames, "--fps", &fps].map(str::to_owned));
        words.extend(scene_options(state));
        words.extend(["-o", "video.y4m"].map(str::to_owned));
        return Some(words);
    }
    state.objects.iter().map(Object::to_layout).for_each(|object| words.extend(object_options(&object)));
    words.extend(scene_options(state));
    words.extend(["--quality", "high", "-o", "picture.png"].map(str::to_owned));
    Some(words)
}

/// Returns the options that affect all objects: scale of the room, floor gloss and light.
fn scene_options(state: &State) -> Vec<String> {
    let known = state.known_length.map(|known| {
        let [from, to] = known.ends;
        ["--known-length".to_owned(), list([from[0], from[1], to[0], to[1], known.length_m])]
    });
    let gloss = (state.floor_gloss > 0.0).then(|| ["--floor-gloss".to_owned(), state.floor_gloss.to_string()]);
    known.into_iter().flatten().chain(gloss.into_iter().flatten()).chain(light_options(state)).collect()
}

/// Returns the chosen light with all options that differ from their defaults. A single option makes `insert` ignore the
/// choice in the scene file.
fn light_options(state: &State) -> Vec<String> {
    if state.lights.inferred.is_none() {
        return Vec::new();
    }
    let InferredLight { light, tuning: LightTuning { contrast, warmth_ev, white } } = state.inferred_light();
    let usual = LightTuning::default();
    let changed = |value: f32, usual: f32| (value != usual).then(|| value.to_string());
    let options = [
        ("--light", Some(light.name().to_owned())),
        ("--contrast", changed(contrast, usual.contrast)),
        ("--warmth", changed(warmth_ev, usual.warmth_ev)),
        ("--white", white.map(list)),
    ];
    options.into_iter().filter_map(|(option, value)| Some([option.to_owned(), value?])).flatten().collect()
}

fn list<const N: usize>(numbers: [f64; N]) -> String {
    numbers.map(|number| number.to_string()).join(",")
}

fn object_options(object: &LayoutObject) -> Vec<String> {
    let align = object.align.map(|align| match align {
        Align::Gravity => "gravity",
        Align::Surface => "surface",
        Align::None => "none",
    });
    // Positions and rotations are read in single precision and rounded to it here.
    let single = |numbers: [f64; 3]| numbers.map(|number| (number as f32).to_string()).join(",");
    let options = [
        ("--mesh", Some(file_argument(&object.mesh.to_string_lossy()))),
        ("--pixel", object.pixel.map(list)),
        ("--at", object.position_m.map(single)),
        ("--scale", object.scale.filter(|scale| *scale != 1.0).map(|scale| scale.to_string())),
        ("--height", object.height_m.map(|height_m| height_m.to_string())),
        ("--yaw-deg", object.yaw_deg.map(|yaw_deg| (yaw_deg as f32).to_string())),
        ("--align", align.map(str::to_owned)),
        ("--material", object.material.as_ref().map(|material| material.to_text())),
    ];
    options.into_iter().filter_map(|(option, value)| Some([option.to_owned(), value?])).flatten().collect()
}

/// Returns a file name that is not taken for an option.
fn file_argument(file: &str) -> String {
    if file.starts_with('-') { format!("./{file}") } else { file.to_owned() }
}

fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./:,+=@".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_names_are_not_options() {
        assert_eq!(file_argument("-o.obj"), "./-o.obj");
        assert_eq!(file_argument("a-b.obj"), "a-b.obj");
        assert_eq!(file_argument("/rooms/-1.scene"), "/rooms/-1.scene");
    }

    #[test]
    fn words_are_quoted_for_a_shell() {
        assert_eq!(quoted("room.scene"), "room.scene");
        assert_eq!(quoted("my room.scene"), "'my room.scene'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
        assert_eq!(quoted(r#"{"preset":"gold"}"#), r#"'{"preset":"gold"}'"#);
    }
}
