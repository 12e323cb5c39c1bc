//! Generated rooms stay bitwise identical for configurations without newer fields, since published figures depend on
//! such rooms.

use lo_dataset::{DatasetError, Generator, GeneratorConfig, write_shard};
use sha2::{Digest, Sha256};

/// Returns the SHA-256 of a shard with one room.
fn digest(config: &str, seed: u64, room: u64) -> String {
    let config: GeneratorConfig = serde_json::from_str(config).unwrap();
    let record = Generator::new(seed, config).unwrap().record(room).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.tar");
    write_shard::<DatasetError>(&path, [Ok(record)].into_iter(), "tests").unwrap();
    let digest = Sha256::digest(std::fs::read(path).unwrap());
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn shards_of_former_configurations_have_their_former_bytes() {
    let level =
        r#"{"shots": 2, "panoramas": 1, "panorama_height": 16, "octree_depth": 5, "room": {"crop_size": [96, 64]}}"#;
    let upright = r#"{"shots": 3, "panoramas": 1, "panorama_height": 8, "octree_depth": 4,
        "room": {"crop_size": [48, 72], "hfov_deg": [34.5, 67.4], "pitch_deg": 40, "roll_deg": 5, "cluttered_share": 0.8, "clean_share": 0}}"#;
    let former = [
        (level, 77, 0, "67abb2162ca32f829d4741016e3047ec91b44f9ce020012d4e09a4e53186f09d"),
        (level, 77, 1, "a6b53513447e8cb472bcf4cfb3af450edb1a6cbcfcfb38250fb70f3e2ed9b94c"),
        (level, 77, 2, "3e6dc122021aaeb70a157bf4fb59fab757271153b9c4953aad6ef9c21d686fb5"),
        (level, 5, 3, "ac0310acf4abd5d068301c0d0d7b0ae54c061c198712a322bb0abb3bdd7a1d5e"),
        (upright, 300, 4, "684ecb191c753d19d837eb4e32ba4b1cf6f5bdb285e2374a029eff27957ba63b"),
        (upright, 300, 5, "714125182a53a5a61c2d1a2ec681e5d1afea1a2f0bb1211f0aa236412a1f167c"),
    ];
    for (config, seed, room, expected) in former {
        assert_eq!(digest(config, seed, room), expected, "room {room} of seed {seed}");
    }
}
