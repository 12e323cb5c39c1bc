//! Runs `unwrap` as a user does.

use lo_imaging as imaging;
use lo_imaging::{Image, RadianceImage};

use crate::support::{done, json, refused};

/// Writes a photo of a disc on grey. Interpreted as a ball, its brightness gives the columns of a panorama.
fn photo(folder: &std::path::Path, name: &str, width: usize, gain: f32) {
    let picture = RadianceImage::from_fn(width, 120, |x, y| {
        let (dx, dy) = ((x as f32 - 79.5) / 50.0, (y as f32 - 59.5) / 50.0);
        if dx.hypot(dy) < 1.0 { [0.1 * gain + 0.3 * gain * (dx + 1.0); 3] } else { [0.05 * gain; 3] }
    });
    let picture: Image<[u8; 3]> = imaging::ToneCurve::Clip.map(&picture, 0.0);
    imaging::write_srgb8(folder.join(name), &picture, 95, imaging::GENERATOR).unwrap();
}

#[test]
fn a_given_ball_becomes_a_panorama() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    photo(at, "a.png", 160, 1.0);
    photo(at, "b.png", 160, 0.25);
    let summary = json(&done(
        at,
        &[
            "unwrap",
            "a.png",
            "b.png",
            "--circle",
            "80,60,50",
            "--size",
            "64x32",
            "--mask-out",
            "m.png",
            "--json",
            "-o",
            "p.exr",
        ],
    ));
    // A quarter of the light is two stops less, to 2 %.
    assert!((summary["exposures_ev"][1].as_f64().unwrap() + 2.0).abs() < 0.03, "{summary}");
    assert!(summary["filled_share"].as_f64().unwrap() < 0.1 && summary["clipped_share"] == 0.0, "{summary}");
    let map = imaging::read_radiance(at.join("p.exr")).unwrap();
    // In orthographic projection +X is at √½ of the radius to the right, −X to the left.
    let expected = |side: f32| 0.1 + 0.3 * (side * 0.5f32.sqrt() + 1.0);
    for (column, side) in [(48, 1.0), (16, -1.0)] {
        let got = map[(column, 16)][0];
        assert!((got / expected(side) - 1.0).abs() < 0.03, "{side}: {got} and {}", expected(side));
    }
    let mask = imaging::read_rgba8(at.join("m.png")).unwrap();
    assert_eq!((mask[(0, 16)][0], mask[(32, 16)][0]), (255, 0));
}

#[test]
fn errors_are_one_clear_line() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    photo(at, "a.png", 160, 1.0);
    photo(at, "wide.png", 161, 1.0);
    let flat = Image::new(160, 120, vec![[90u8; 3]; 160 * 120]);
    imaging::write_srgb8(at.join("flat.png"), &flat, 95, imaging::GENERATOR).unwrap();
    let linear = RadianceImage::new(160, 120, vec![[f32::NAN; 3]; 160 * 120]);
    imaging::write_radiance(at.join("nan.pfm"), &linear, &imaging::ExrOptions::default()).unwrap();
    for (code, args, part) in [
        (1, &["flat.png"][..], "no ball was found"),
        (2, &["a.png", "--circle", "500,60,50"], "is outside the photo"),
        (2, &["a.png", "--circle", "80,60,1"], "the radius must be at least 4 pixels"),
        (1, &["a.png", "wide.png", "--circle", "80,60,50"], "wide.png: 161 × 120 pixels, but a.png has 160 × 120"),
        (1, &["nan.pfm", "--circle", "80,60,50"], "nan.pfm: damaged or invalid PFM file: it has no finite value"),
        (2, &["a.png", "--exposures", "0,1"], "2 exposures for 1 photos"),
        (2, &["a.png", "--circle", "80,60,50", "--size", "64x64"], "must be twice its height"),
        (2, &["a.png", "--circle", "80,60,50", "--hfov-deg", "175"], "--hfov-deg"),
    ] {
        let message = refused(at, code, &[&["unwrap"], args, &["-o", "p.hdr"]].concat());
        assert!(message.contains(part) && message.lines().count() == 1, "{args:?}: {message}");
    }
    assert!(!at.join("p.hdr").exists());
}
