//! Shuffled keys (Morton codes): the bits of x, y and z interleaved, x highest, three bits a level.
//!
//! The order is that of `ocnn` (`ocnn.octree.xyz2key`): within a parent, child `4·x + 2·y + z`.

/// Greatest depth of an octree: keys of 30 bits, node indices below 2³⁰.
pub const MAX_DEPTH: u32 = 10;

/// Returns the shuffled key of the node at integer coordinates `(x, y, z)`, each below 1024.
#[inline]
pub fn key_from_xyz([x, y, z]: [u32; 3]) -> u32 {
    spread(x) << 2 | spread(y) << 1 | spread(z)
}

/// Returns the integer coordinates `(x, y, z)` of the node with shuffled key `key`: inverse of [`key_from_xyz`].
#[inline]
pub fn xyz_from_key(key: u32) -> [u32; 3] {
    [compact(key >> 2), compact(key >> 1), compact(key)]
}

/// Puts two zeros between the lowest ten bits, halving the shift in each line.
#[inline]
pub(crate) fn spread(x: u32) -> u32 {
    let x = (x | x << 16) & 0x0300_00FF;
    let x = (x | x << 8) & 0x0300_F00F;
    let x = (x | x << 4) & 0x030C_30C3;
    (x | x << 2) & 0x0924_9249
}

/// Inverts [`spread`]; ignores the bits of the other two coordinates.
#[inline]
fn compact(x: u32) -> u32 {
    let x = x & 0x0924_9249;
    let x = (x | x >> 2) & 0x030C_30C3;
    let x = (x | x >> 4) & 0x0300_F00F;
    let x = (x | x >> 8) & 0x0300_00FF;
    (x | x >> 16) & 0x3FF
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Interleaves one bit at a time, following the definition.
    fn interleaved(xyz: [u32; 3]) -> u32 {
        (0..MAX_DEPTH).fold(0, |key, bit| {
            let child = xyz.iter().fold(0, |child, c| child << 1 | (c >> bit & 1));
            key | child << (3 * bit)
        })
    }

    #[test]
    fn keys_interleave_every_coordinate() {
        for c in 0..1024 {
            for xyz in [[c, 0, 0], [0, c, 0], [0, 0, c], [c, 1023 - c, c ^ 0x155]] {
                assert_eq!(key_from_xyz(xyz), interleaved(xyz));
                assert_eq!(xyz_from_key(interleaved(xyz)), xyz);
            }
        }
    }

    #[test]
    fn order_is_that_of_ocnn() {
        // `ocnn.octree.xyz2key(x, y, z, depth=10)` of ocnn 2.3.3
        let expected = [([1, 0, 0], 4), ([5, 3, 6], 350), ([127, 64, 1], 1_722_661), ([1023, 512, 77], 882_264_933)];
        for (xyz, key) in expected {
            assert_eq!(key_from_xyz(xyz), key, "{xyz:?}");
        }
    }
}
