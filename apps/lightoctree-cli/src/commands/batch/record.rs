//! The report of a part: a line of JSON for each photo.

use std::collections::HashMap;
use std::fs::File;
use std::io::Write;
use std::path::Path;

use anyhow::Context;
use lo_imaging::{MainLight, Sh9};
use lo_scene::SceneFile;
use serde::{Deserialize, Serialize};

use super::args::Args;
use super::photo_list::ListedPhoto;

/// Longest report that is read, bytes.
const MAX_REPORT_BYTES: u64 = 1 << 32;

/// The result of a photo.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Record {
    /// Name of the photo in its root folder.
    pub photo: String,
    /// Scene file, relative to the output folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene: Option<String>,
    /// Environment map, relative to the output folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub envmap: Option<String>,
    /// Duration of reading, estimating and writing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
    /// Horizontal field of view of the camera, without distortion.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hfov_deg: Option<f64>,
    /// Light at the environment map's position.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light: Option<Light>,
    /// Warnings about the photo.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// Error because of which the photo has no result.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// Light at a position, as of `envmap --sh9` and `--main-light`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Light {
    /// Nine spherical-harmonics coefficients per channel.
    pub sh9: Sh9,
    /// The main light, if there is one.
    pub main_light: Option<MainLight>,
}

impl Record {
    /// Returns the record of a photo whose results exist, but not their record.
    pub fn kept(args: &Args, photo: &ListedPhoto) -> Self {
        let name = |extension: &str| photo.result_name(extension).to_string_lossy().into_owned();
        Self {
            photo: photo.name_text(),
            scene: (!args.no_scenes).then(|| name("scene")),
            envmap: args.envmap_at.map(|_| name("exr")),
            ..Self::default()
        }
    }

    /// Returns the record of a photo without results.
    pub fn failed(photo: &ListedPhoto, error: String) -> Self {
        Self { photo: photo.name_text(), error: Some(error), ..Self::default() }
    }

    /// Whether the photo has no result.
    pub fn has_failed(&self) -> bool {
        self.error.is_some()
    }
}

/// Reads the records of an earlier run by the photos' names. Damaged lines, as a killed run leaves one, are ignored.
///
/// # Errors
/// A report that exists but cannot be read.
pub fn read(path: &Path) -> anyhow::Result<HashMap<String, Record>> {
    let bytes = match lo_imaging::read_regular_file(path, MAX_REPORT_BYTES) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(HashMap::new()),
        read => read.with_context(|| format!("cannot read {}", path.display()))?,
    };
    let records = bytes.split(|byte| *byte == b'\n').filter_map(|line| serde_json::from_slice::<Record>(line).ok());
    Ok(records.filter(|record| !record.has_failed()).map(|record| (record.photo.clone(), record)).collect())
}

/// Whether a scene file exists and was not cut off.
pub fn is_complete_scene(path: &Path) -> anyhow::Result<bool> {
    SceneFile::is_complete(path).with_context(|| format!("cannot read the existing {}", path.display()))
}

/// A report that grows by a line per photo.
pub struct Report {
    file: File,
}

impl Report {
    /// Replaces the report of an earlier run by the records of the photos that are kept.
    ///
    /// # Errors
    /// The report cannot be written.
    pub fn begin(path: &Path, kept: &[Record]) -> anyhow::Result<Self> {
        let failed = || format!("cannot write {}", path.display());
        lo_imaging::write_atomically(path, |out| -> std::io::Result<()> {
            kept.iter().try_for_each(|record| out.write_all(&line(record)))
        })
        .with_context(failed)?;
        let file = File::options().append(true).open(path).with_context(failed)?;
        Ok(Self { file })
    }

    /// Appends a record.
    ///
    /// # Errors
    /// The report cannot be written.
    pub fn add(&mut self, record: &Record) -> anyhow::Result<()> {
        self.file.write_all(&line(record)).context("cannot write the report")
    }
}

fn line(record: &Record) -> Vec<u8> {
    let mut line = serde_json::to_vec(record).expect("a record has only texts and numbers");
    line.push(b'\n');
    line
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_cut_off_report_is_continued() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("report.jsonl");
        assert!(read(&path).unwrap().is_empty());
        let record = |photo: &str, error: Option<&str>| Record {
            photo: photo.to_owned(),
            seconds: Some(0.5),
            error: error.map(str::to_owned),
            ..Record::default()
        };
        let mut report = Report::begin(&path, &[]).unwrap();
        for record in [record("a.jpg", None), record("b.jpg", Some("no image")), record("c.jpg", None)] {
            report.add(&record).unwrap();
        }
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.lines().next(), Some(r#"{"photo":"a.jpg","seconds":0.5}"#));
        std::fs::write(&path, &text[..text.len() - 9]).unwrap();
        let earlier = read(&path).unwrap();
        assert_eq!(earlier.keys().collect::<Vec<_>>(), ["a.jpg"], "one failed, the last is cut off");
        let kept: Vec<_> = earlier.into_values().collect();
        Report::begin(&path, &kept).unwrap().add(&record("c.jpg", None)).unwrap();
        assert_eq!(read(&path).unwrap().len(), 2);
    }
}
