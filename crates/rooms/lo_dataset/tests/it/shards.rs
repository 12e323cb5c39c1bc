//! Shards: round trips, errors of damaged archives, and reading with Python's own tools.

#[path = "../../src/fixture.rs"]
mod fixture;

use std::path::Path;
use std::process::Command;

use lo_dataset::{Dataset, DatasetError, Metadata, NovelView, Record, Shards, Shot, shard_name, write_shard};
use lo_geometry::Vec3;
use lo_imaging::Image;
use proptest::prelude::*;

use fixture::record;

fn write(path: &Path, records: &[Record]) {
    write_shard::<DatasetError>(path, records.iter().cloned().map(Ok), "tests").unwrap();
}

#[test]
fn samples_come_back_within_the_formats_precision() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder.path().join(shard_name("rooms", 0)), &[record("a"), record("b")]);
    write(&folder.path().join(shard_name("rooms", 1)), &[record("c")]);
    let shards = Shards::open(folder.path()).unwrap();
    assert_eq!(shards.len(), 6);
    assert_eq!((shards.scene_id(0), shards.scene_id(3)), ("room of a".into(), "room of b".into()));
    let (got, expected) = (shards.get(5).unwrap(), record("c").sample(1));
    assert_eq!((&got.id, &got.scene_id, &got.camera), (&expected.id, &expected.scene_id, &expected.camera));
    assert_eq!((&got.photo, &got.up, &got.metadata), (&expected.photo, &expected.up, &expected.metadata));
    let near = |a: f32, b: f32, relative: f32| (a - b).abs() <= relative * b.abs() + 1e-6;
    // Half floats have a precision of 2⁻¹¹; the image's exponent loses nothing at values this bright.
    let light = |a: &Image<[f32; 3]>, b: &Image<[f32; 3]>| {
        a.pixels().iter().flatten().zip(b.pixels().iter().flatten()).all(|(a, b)| near(*a, *b, 5e-4))
    };
    assert!(light(got.radiance.as_ref().unwrap(), expected.radiance.as_ref().unwrap()));
    assert_eq!(got.views.len(), 1);
    assert!(light(&got.views[0].radiance, &expected.views[0].radiance));
    assert_eq!(
        (got.views[0].position_m, got.views[0].rotation),
        (expected.views[0].position_m, expected.views[0].rotation)
    );
    let depth = |a: &Option<Image<f32>>, b: &Option<Image<f32>>| {
        let (a, b) = (a.as_ref().unwrap(), b.as_ref().unwrap());
        a.pixels().iter().zip(b.pixels()).all(|(a, b)| (a - b).abs() <= 0.5001e-3)
    };
    assert!(depth(&got.depth_m, &expected.depth_m) && depth(&got.sensor_depth_m, &expected.sensor_depth_m));
    assert!(depth(&got.views[0].depth_m, &expected.views[0].depth_m));
    for (a, b) in got.normal.unwrap().pixels().iter().zip(expected.normal.unwrap().pixels()) {
        assert!((Vec3::from_array(*a) - Vec3::from_array(*b)).length() < 0.01);
    }
    for (a, b) in got.albedo.unwrap().pixels().iter().zip(expected.albedo.unwrap().pixels()) {
        assert!((a[0] - b[0]).abs() < 0.005);
    }
    for (a, b) in got.points.iter().zip(&expected.points) {
        // Steps of 1.9 m / 65535.
        assert!((a.position_m - b.position_m).length() < 1e-4 && a.provenance == b.provenance);
        assert!(a.radiance.iter().zip(b.radiance).all(|(a, b)| near(*a, b, 1e-3)));
    }
}

#[test]
fn the_same_records_give_the_same_bytes_and_an_error_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a.tar"), folder.path().join("b.tar"));
    write(&a, &[record("x")]);
    write(&b, &[record("x")]);
    assert_eq!(std::fs::read(&a).unwrap(), std::fs::read(&b).unwrap());
    let broken = folder.path().join("c.tar");
    let records = [Ok(record("x")), Err(DatasetError::Index { index: 1, len: 1 })];
    assert!(write_shard(&broken, records.into_iter(), "tests").is_err());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[test]
fn a_jpeg_is_kept_as_the_camera_wrote_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tar");
    let mut first = record("x");
    let settings = lo_sensor::PhotoModel::default().draw(&mut lo_random::stream(1, "test", 0));
    let camera = first.shots[0].camera;
    let radiance = Image::new(12, 8, vec![[0.3; 3]; 96]);
    let taken = settings.photograph(&radiance, &camera, &mut lo_random::stream(1, "noise", 0));
    first.shots[0].photo = taken.photo.clone();
    first.shots[0].jpeg = Some(taken.jpeg);
    write(&path, &[first]);
    assert_eq!(Shards::open(&path).unwrap().get(0).unwrap().photo, taken.photo);
}

#[test]
fn errors_name_archive_member_and_field() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rooms-000000.tar");
    let message = |mutate: &dyn Fn(&str, &mut Vec<u8>) -> bool| {
        rewrite(&path, mutate);
        let error = match Shards::open(&path) {
            Err(error) => error,
            Ok(shards) => shards.get(0).unwrap_err(),
        };
        let text = error.to_string();
        assert!(text.starts_with(&path.display().to_string()), "{text}");
        text[path.display().to_string().len() + 2..].to_owned()
    };
    let json = |from: &'static str, to: &'static str| {
        move |name: &str, bytes: &mut Vec<u8>| {
            if name == "a.json" {
                let text = String::from_utf8(bytes.clone()).unwrap();
                assert!(text.contains(from), "{text}");
                *bytes = text.replacen(from, to, 1).into_bytes();
            }
            true
        }
    };
    assert_eq!(
        message(&json("\"format_version\":1", "\"format_version\":7")),
        "member a.json: format_version: version 7 is not supported; this program reads version 1"
    );
    assert_eq!(
        message(&json("\"views\":[0]", "\"views\":[9]")),
        "member a.json: shots[0].views: view 9 does not exist; the record has 2"
    );
    assert!(message(&json("\"fx\":", "\"fx\":-")).starts_with("member a.json: shots[0].camera: focal lengths"));
    assert!(message(&json("\"step_m\":", "\"step_m\":-")).starts_with("member a.json: points.step_m: -"));
    assert!(message(&json("\"gains\":[0.5", "\"gains\":[-0.5")).starts_with("member a.json: shots[0].gains: [-0.5"));
    assert!(
        message(&json("\"rotation_xyzw\":[0.0", "\"rotation_xyzw\":[5.0")).contains("views[0].rotation_xyzw: [5.0")
    );
    assert!(message(&json("{", "")).starts_with("member a.json: header: "));
    assert_eq!(
        message(&|name, _| name != "a.shot0.depth.npy"),
        "member a.shot0.depth.npy: file: missing from the archive"
    );
    let cut = |name: &str, bytes: &mut Vec<u8>| {
        if name == "a.shot0.radiance.npy" {
            bytes.pop();
        }
        true
    };
    assert_eq!(message(&cut), "member a.shot0.radiance.npy: array: 575 bytes of data do not fill the shape [8, 12, 3]");
    let nan = |name: &str, bytes: &mut Vec<u8>| {
        if name == "a.view0.radiance.npy" {
            let end = bytes.len();
            bytes[end - 2..].copy_from_slice(&[0xff, 0x7f]);
        }
        true
    };
    assert_eq!(message(&nan), "member a.view0.radiance.npy: value 383: radiance NaN");
}

/// Writes record `a` with its members changed, or omitted where `mutate` returns false.
fn rewrite(path: &Path, mutate: &dyn Fn(&str, &mut Vec<u8>) -> bool) {
    use std::io::Read;
    write(path, &[record("a")]);
    let bytes = std::fs::read(path).unwrap();
    let mut archive = tar::Builder::new(Vec::new());
    for entry in tar::Archive::new(&bytes[..]).entries().unwrap() {
        let mut entry = entry.unwrap();
        let name = entry.path().unwrap().to_str().unwrap().to_owned();
        let mut content = Vec::new();
        entry.read_to_end(&mut content).unwrap();
        if mutate(&name, &mut content) {
            let mut header = tar::Header::new_ustar();
            header.set_size(content.len() as u64);
            header.set_mode(0o644);
            archive.append_data(&mut header, name, &content[..]).unwrap();
        }
    }
    std::fs::write(path, archive.into_inner().unwrap()).unwrap();
}

#[test]
fn truncated_archives_give_errors_at_every_length() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tar");
    write(&path, &[record("a")]);
    let bytes = std::fs::read(&path).unwrap();
    // The archive's two empty blocks and the padding of its last member are not needed.
    for length in (0..bytes.len() - 3 * 512).step_by(97) {
        std::fs::write(&path, &bytes[..length]).unwrap();
        let opened = Shards::open(&path);
        let whole = opened.and_then(|shards| (0..2).try_for_each(|i| shards.get(i).map(drop)));
        assert!(whole.is_err() || length == 0, "{length} of {}", bytes.len());
    }
    std::fs::write(&path, b"not a tar at all").unwrap();
    assert!(Shards::open(&path).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn damaged_archives_never_panic(at in 0usize..1 << 20, value: u8) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tar");
        write(&path, &[record("a")]);
        let mut bytes = std::fs::read(&path).unwrap();
        let at = at % bytes.len();
        bytes[at] = value;
        std::fs::write(&path, bytes).unwrap();
        if let Ok(shards) = Shards::open(&path) {
            for index in 0..shards.len() {
                let _ = shards.get(index);
            }
        }
    }
}

/// Runs the snippet of `docs/data.md`.
#[test]
#[ignore = "needs python3 with numpy and Pillow; run with: cargo test -p lo_dataset --test it shards:: -- --ignored"]
fn python_reads_a_shard_with_tarfile_and_numpy() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder.path().join(shard_name("rooms", 0)), &[record("a")]);
    let docs = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../docs/data.md")).unwrap();
    let snippet = docs.split("```python\n").nth(1).unwrap().split("```").next().unwrap();
    let script = format!("{snippet}\nprint(photo.size, radiance.shape, depth_m.max(), len(xyz_m))\n");
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let output = Command::new(python)
        .args(["-c", &script, folder.path().join(shard_name("rooms", 0)).to_str().unwrap()])
        .output()
        .unwrap();
    let (out, error) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    // The farthest reading: 1 + 0.1234 · 18 m.
    assert!(out.ends_with("(12, 8) (8, 12, 3) 3.221 20\n"), "{out}{error}");
}
