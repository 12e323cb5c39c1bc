//! Cryptomatte (Friedman and Jones 2015, specification 1.2): which objects and materials each pixel shows.

use lo_imaging::{ChannelGroup, Image};

/// Names per pixel: three layers of two. More share a pixel so seldom that the rest is dropped.
const RANKS: usize = 6;

/// Coverage of the pixels by each name.
#[derive(Clone, Debug, PartialEq)]
pub struct Cryptomatte {
    /// Name of the layers, such as `CryptoObject`.
    pub layer: &'static str,
    /// Each name with its share of each pixel, in [0, 1].
    pub coverage: Vec<(String, Image<f32>)>,
}

impl Cryptomatte {
    /// Returns the layers `CryptoObject00` to `CryptoObject02`: pairs of name and coverage, the largest coverage first.
    pub(crate) fn channels(&self, [width, height]: [usize; 2]) -> Vec<ChannelGroup> {
        let ids: Vec<f32> = self.coverage.iter().map(|(name, _)| float_id(hash(name))).collect();
        let ranks = |pixel: usize| {
            let shares = ids.iter().zip(&self.coverage).map(|(&id, (_, image))| (id, image.pixels()[pixel]));
            let mut shown: Vec<(f32, f32)> = shares.filter(|&(_, share)| share > 0.0).collect();
            shown.sort_by(|a, b| b.1.total_cmp(&a.1));
            let mut ranks = [0.0; 2 * RANKS];
            for (rank, (id, share)) in ranks.chunks_exact_mut(2).zip(shown) {
                rank.copy_from_slice(&[id, share.min(1.0)]);
            }
            ranks
        };
        let pixels: Vec<[f32; 2 * RANKS]> = (0..width * height).map(ranks).collect();
        let mut planes = (0..2 * RANKS).map(|plane| pixels.iter().map(|ranks| ranks[plane]).collect());
        (0..RANKS / 2)
            .map(|layer| ChannelGroup {
                name: format!("{}{layer:02}", self.layer),
                channels: ["R", "G", "B", "A"].map(str::to_owned).into_iter().zip(planes.by_ref().take(4)).collect(),
            })
            .collect()
    }

    /// Returns the attributes of the file: how names are hashed, and the manifest.
    pub(crate) fn metadata(&self) -> Vec<(String, String)> {
        let key = format!("{:08x}", hash(self.layer));
        let manifest: serde_json::Map<String, serde_json::Value> = (self.coverage.iter())
            .map(|(name, _)| (name.clone(), format!("{:08x}", float_id(hash(name)).to_bits()).into()))
            .collect();
        let attributes = [
            ("name", self.layer.to_owned()),
            ("hash", "MurmurHash3_32".to_owned()),
            ("conversion", "uint32_to_float32".to_owned()),
            ("manifest", ascii(&serde_json::Value::from(manifest).to_string())),
        ];
        attributes.into_iter().map(|(what, value)| (format!("cryptomatte/{}/{what}", &key[..7]), value)).collect()
    }
}

/// Returns the hash of a name.
fn hash(name: &str) -> u32 {
    murmur3::murmur3_32(&mut name.as_bytes(), 0).expect("a slice can be read")
}

/// Converts a hash to a number that is neither denormal nor infinite nor NaN (specification, section 3.4).
fn float_id(hash: u32) -> f32 {
    let exponent = hash >> 23 & 0xff;
    f32::from_bits(if exponent == 0 || exponent == 0xff { hash ^ 1 << 23 } else { hash })
}

/// Escapes characters of JSON that are not ASCII, because attributes are Latin-1.
fn ascii(json: &str) -> String {
    let mut text = String::with_capacity(json.len());
    for c in json.chars() {
        if c.is_ascii() {
            text.push(c);
        } else {
            c.encode_utf16(&mut [0; 2]).iter().for_each(|unit| text.push_str(&format!("\\u{unit:04x}")));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn names_are_hashed_as_other_programs_do() {
        // Test vectors of MurmurHash3_x86_32 with seed 0 (Wikipedia, MurmurHash).
        assert_eq!((hash(""), hash("test")), (0, 0xba6b_d213));
        assert_eq!(hash("Hello, world!"), 0xc036_3e43);
        assert_eq!(hash("The quick brown fox jumps over the lazy dog"), 0x2e4f_f723);
        for hash in [0, 0x7f80_0000, 0xff80_0001, 0x0000_0001, 0x1234_5678] {
            assert!(float_id(hash).is_normal(), "{hash:x}");
        }
        assert_eq!(float_id(0x1234_5678).to_bits(), 0x1234_5678);
    }

    #[test]
    fn ranks_are_ordered_by_coverage() {
        let image = |shares: [f32; 2]| Image::new(2, 1, shares.to_vec());
        let matte = Cryptomatte {
            layer: "CryptoObject",
            coverage: vec![("a".to_owned(), image([0.25, 0.0])), ("Bälle".to_owned(), image([0.5, 1.0]))],
        };
        let layers = matte.channels([2, 1]);
        assert_eq!(layers.len(), 3);
        assert_eq!(layers[0].name, "CryptoObject00");
        let plane = |index: usize| &layers[0].channels[index].1;
        let (a, b) = (float_id(hash("a")), float_id(hash("Bälle")));
        assert_eq!((plane(0), plane(1)), (&vec![b, b], &vec![0.5, 1.0]));
        assert_eq!((plane(2), plane(3)), (&vec![a, 0.0], &vec![0.25, 0.0]));
        let metadata = matte.metadata();
        let manifest = &metadata.iter().find(|(key, _)| key.ends_with("/manifest")).unwrap().1;
        assert!(manifest.is_ascii());
        let manifest: serde_json::Value = serde_json::from_str(manifest).unwrap();
        assert_eq!(manifest["Bälle"], format!("{:08x}", b.to_bits()));
    }
}
