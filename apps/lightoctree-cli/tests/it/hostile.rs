//! Devices, numbers out of range, and scenes with extreme values.

use std::path::Path;
use std::sync::Arc;

use lightoctree::Document;
use lo_geometry::Cube;

use crate::cli::{room, room_with_scene};
use crate::support::{done, refused};

#[cfg(unix)]
#[test]
fn devices_and_pipes_are_refused() {
    let folder = room_with_scene();
    let made = std::process::Command::new("mkfifo").arg(folder.path().join("pipe")).status();
    assert!(made.unwrap().success());
    for file in ["/dev/zero", "pipe"] {
        for args in [
            &["inspect", file][..],
            &["view", file],
            &["lights", file],
            &["insert", "room.scene", "--mesh", file, "--pixel", "40,90", "-o", "a.png"],
            &["insert", "room.scene", "--layout", file, "-o", "a.png"],
            &["insert", "room.scene", "--mesh", "builtin:sphere", "--path", file, "--frames", "2", "-o", "a_%04d.png"],
            &["probes", "room.scene", "--points", file, "-o", "probes"],
            &["probes", "room.scene", "--path", file, "--frames", "2", "-o", "probes"],
            &[
                "estimate",
                "photo.png",
                "photo.png",
                "--depth",
                "depth.png",
                "depth.png",
                "--poses",
                file,
                "-o",
                "b.scene",
            ],
            #[cfg(feature = "depth-models")]
            &["estimate", "photo.png", "--depth-model", file, "--completion", "shell", "-o", "b.scene"],
        ] {
            let message = refused(folder.path(), 1, args);
            assert!(message.contains("only regular files are read"), "{args:?}: {message}");
        }
    }
}

/// Writes a colour PFM (<http://www.pauldebevec.com/Research/HDR/PFM/>).
fn write_pfm(path: &Path, [width, height]: [usize; 2], value: impl Fn(usize) -> f32) {
    let mut bytes = format!("PF\n{width} {height}\n-1.0\n").into_bytes();
    bytes.extend((0..3 * width * height).flat_map(|index| value(index).to_le_bytes()));
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn photos_and_panoramas_have_a_range() {
    let folder = room();
    let path = |name: &str| folder.path().join(name);
    write_pfm(&path("nan.pfm"), [144, 96], |_| f32::NAN);
    write_pfm(&path("bright.pfm"), [144, 96], |index| if index == 7 { 1e38 } else { 0.5 });
    write_pfm(&path("holes.pfm"), [144, 96], |index| if index % 100 == 7 { f32::NAN } else { 0.5 });
    write_pfm(&path("panorama.pfm"), [64, 32], |index| if index == 7 { 1e38 } else { 0.5 });
    let estimate = |photo: &'static str| {
        ["estimate", photo, "--depth", "depth.png", "--hfov-deg", "65", "--completion", "shell", "-o", "room.scene"]
    };
    let message = refused(folder.path(), 1, &estimate("nan.pfm"));
    assert!(message.contains("nan.pfm"), "{message}");
    let message = refused(folder.path(), 1, &estimate("bright.pfm"));
    assert!(message.contains("bright.pfm") && message.contains("must not exceed 1e12"), "{message}");
    let message = refused(folder.path(), 1, &[&estimate("photo.png")[..], &["--panorama", "panorama.pfm"]].concat());
    assert!(message.contains("panorama.pfm") && message.contains("1e38"), "{message}");
    // What is written can be read.
    done(folder.path(), &estimate("holes.pfm"));
    done(folder.path(), &["inspect", "room.scene"]);
    done(folder.path(), &["lights", "room.scene"]);
}

#[test]
fn positions_have_a_range() {
    let folder = room_with_scene();
    for args in [
        &["envmap", "room.scene", "--at", "0,1e30,0", "-o", "a.exr"][..],
        &["export", "room.scene", "--to", "glb", "--probe-at", "0,1e30,0", "-o", "a.glb"],
        &["insert", "room.scene", "--mesh", "builtin:sphere", "--at", "1e30,0,0", "-o", "a.png"],
        &["envmap", "room.scene", "--pixel", "70,80", "--lift", "1e9", "-o", "a.exr"],
    ] {
        let message = refused(folder.path(), 2, args);
        assert!(message.contains("10000") || message.contains("10 km"), "{args:?}: {message}");
    }
}

#[test]
fn scenes_at_the_ends_of_the_ranges_are_used_by_all_commands() {
    let folder = room_with_scene();
    let path = folder.path().join("room.scene");
    let plain = Document::read(&path).unwrap();
    for edge_m in [1e-3, 1e6] {
        let mut document = plain.clone();
        let estimate = Arc::make_mut(&mut document.estimate);
        estimate.light.cube = Cube::centred(Default::default(), edge_m);
        document.write(&path, "lightoctree estimate").unwrap();
        all_commands(folder.path());
    }
    // The smallest focal length of a 144 × 96 photo, 1.92 pixels.
    let mut document = plain;
    let estimate = Arc::make_mut(&mut document.estimate);
    (estimate.frame.camera.fx, estimate.frame.camera.fy) = (1.92, 1.92);
    document.write(&path, "lightoctree estimate").unwrap();
    all_commands(folder.path());
}

fn all_commands(folder: &Path) {
    done(folder, &["lights", "room.scene"]);
    done(folder, &["export", "room.scene", "--to", "glb", "-o", "room.glb", "--force"]);
    done(folder, &["envmap", "room.scene", "--at", "0,0,0", "--size", "64x32", "-o", "light.exr", "--force"]);
    let sphere = ["--mesh", "builtin:sphere", "--at", "0,-0.5,-2", "--quality", "draft", "-o", "a.png", "--force"];
    done(folder, &[&["insert", "room.scene"][..], &sphere].concat());
}
