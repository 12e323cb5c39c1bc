//! Named random streams: every random decision has its own stream, derived from one seed.
//!
//! A stream depends only on the seed, its name and an index, never on what was drawn elsewhere. Work can thus be split
//! among threads and machines, and adding a stream does not change the others.

pub use rand::{Rng, RngExt, seq};

use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;

/// A reproducible random number generator (ChaCha with 8 rounds), identical on every machine.
pub type Stream = ChaCha8Rng;

/// Creates the stream of a seed, a name and an index (a scene, a sample, a pixel row).
pub fn stream(seed: u64, name: &str, index: u64) -> Stream {
    let mut key = [0; 32];
    key[..8].copy_from_slice(&seed.to_le_bytes());
    key[8..16].copy_from_slice(&index.to_le_bytes());
    key[16..24].copy_from_slice(&hash(name.as_bytes()).to_le_bytes());
    Stream::from_seed(key)
}

/// Derives a named substream with the key of a given stream.
///
/// It does not depend on how much was drawn from `stream`, and does not advance it.
pub fn substream(stream: &Stream, name: &str) -> Stream {
    let mut derived = Stream::from_seed(stream.get_seed());
    // ChaCha stream 0 is the given stream itself.
    derived.set_stream(hash(name.as_bytes()).max(1));
    derived
}

/// A stable 64-bit hash (FNV-1a, Fowler, Noll & Vo) for stream names and for splits by scene id.
///
/// Not collision-resistant: not for untrusted input.
pub fn hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hash_is_fnv_1a() {
        // Test vectors of draft-eastlake-fnv, 64 bits.
        assert_eq!(hash(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(hash(b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(hash(b"foobar"), 0x8594_4171_f739_67e8);
    }

    #[test]
    fn streams_differ_by_seed_name_and_index() {
        let first = |seed, name, index| stream(seed, name, index).random::<u64>();
        assert_eq!(first(1, "layout", 2), first(1, "layout", 2));
        let others = [first(2, "layout", 2), first(1, "lamps", 2), first(1, "layout", 3)];
        assert!(others.iter().all(|&other| other != first(1, "layout", 2)));
    }

    #[test]
    fn substreams_do_not_depend_on_the_streams_position() {
        let (fresh, mut used) = (stream(7, "photo", 3), stream(7, "photo", 3));
        used.random::<[u64; 5]>();
        let first = |stream: &Stream, name| substream(stream, name).random::<u64>();
        assert_eq!(first(&fresh, "phone"), first(&used, "phone"));
        assert_ne!(first(&fresh, "phone"), first(&fresh, "flash"));
        assert_ne!(first(&fresh, "phone"), first(&stream(7, "photo", 4), "phone"));
        assert_ne!(first(&fresh, "phone"), stream(7, "photo", 3).random::<u64>());
        let mut again = stream(7, "photo", 3);
        again.random::<[u64; 5]>();
        assert_eq!(used.random::<u64>(), again.random::<u64>());
    }

    #[test]
    fn streams_never_change() {
        // A change here changes every generated scene and needs a new version of the data.
        assert_eq!(stream(7, "layout", 3).random::<u64>(), 6_423_306_748_962_940_993);
    }
}
