//! Named random streams: every use of chance has a stream of its own, derived from one seed.
//!
//! A stream depends on the seed, its name and an index alone, never on what was drawn elsewhere. Work can thus be split
//! among threads and machines, and a new use of chance leaves all others as they were.

pub use rand::{Rng, RngExt, seq};

use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;

/// A reproducible stream of random numbers (ChaCha with 8 rounds): the same on every machine.
pub type Stream = ChaCha8Rng;

/// The stream `name`, number `index` (a scene, a sample, a pixel row), of `seed`.
pub fn stream(seed: u64, name: &str, index: u64) -> Stream {
    let mut key = [0; 32];
    key[..8].copy_from_slice(&seed.to_le_bytes());
    key[8..16].copy_from_slice(&index.to_le_bytes());
    key[16..24].copy_from_slice(&hash(name.as_bytes()).to_le_bytes());
    Stream::from_seed(key)
}

/// The stream `name` beside a given one, of the same key: the same wherever that one stands, which goes on as if nothing had been asked.
pub fn beside(stream: &Stream, name: &str) -> Stream {
    let mut own = Stream::from_seed(stream.get_seed());
    // 0 is the stream itself.
    own.set_stream(hash(name.as_bytes()).max(1));
    own
}

/// A 64-bit hash that never changes (FNV-1a, Fowler, Noll & Vo): for names of streams and for splitting by a scene's id.
/// Not for hostile input.
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
    fn streams_beside_one_do_not_depend_on_where_it_stands() {
        let (fresh, mut used) = (stream(7, "photo", 3), stream(7, "photo", 3));
        used.random::<[u64; 5]>();
        let first = |stream: &Stream, name| beside(stream, name).random::<u64>();
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
        // Whoever changes this changes every generated scene: that needs a new version of the data.
        assert_eq!(stream(7, "layout", 3).random::<u64>(), 6_423_306_748_962_940_993);
    }
}
