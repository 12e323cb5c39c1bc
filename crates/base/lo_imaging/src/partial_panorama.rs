use crate::xmp::Xmp;

/// Namespace of Google's panorama properties.
const GPANO: &str = "http://ns.google.com/photos/1.0/panorama/";

/// Place of a picture on the full sphere, by GPano metadata, in pixels of the full equirectangular panorama.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartialPanorama {
    /// Width and height of the full panorama.
    pub full: [u32; 2],
    /// Left and top border of the picture.
    pub offset: [u32; 2],
    /// Width and height of the picture.
    pub size: [u32; 2],
}

impl PartialPanorama {
    /// Reads the properties of an equirectangular panorama. `None` if there are none; the error says what is wrong.
    pub(crate) fn from_xmp(packet: &[u8]) -> Option<Result<Self, &'static str>> {
        let xmp = Xmp::parse(packet)?;
        xmp.value(GPANO, "FullPanoWidthPixels")?;
        if xmp.value(GPANO, "ProjectionType").is_some_and(|p| !p.eq_ignore_ascii_case("equirectangular")) {
            return Some(Err("its projection is not equirectangular"));
        }
        Some(Self::from_properties(&xmp).ok_or("its sizes and offsets contradict one another"))
    }

    fn from_properties(xmp: &Xmp<'_>) -> Option<Self> {
        let pixels = |name: &str| {
            let value = xmp.number(GPANO, name)?;
            (0.0..=1e6).contains(&value).then_some(value.round() as u32)
        };
        let full = [pixels("FullPanoWidthPixels")?, pixels("FullPanoHeightPixels")?];
        let size = [
            pixels("CroppedAreaImageWidthPixels").unwrap_or(full[0]),
            pixels("CroppedAreaImageHeightPixels").unwrap_or(full[1]),
        ];
        let offset = [pixels("CroppedAreaLeftPixels").unwrap_or(0), pixels("CroppedAreaTopPixels").unwrap_or(0)];
        let fits = (0..2).all(|i| size[i] > 0 && offset[i].checked_add(size[i]).is_some_and(|end| end <= full[i]));
        // programs round the height of odd widths
        let shape = full[0].abs_diff(2 * full[1]) <= 2;
        (fits && shape).then_some(Self { full, offset, size })
    }

    /// Whether the picture is the whole panorama.
    pub fn is_full(&self) -> bool {
        self.size == self.full
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn properties_are_checked() {
        let packet = |left: u32, projection: &str| {
            format!(
                r#"<x:xmpmeta xmlns:x="adobe:ns:meta/"><r:RDF xmlns:r="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
                <r:Description xmlns:GPano="{GPANO}" GPano:ProjectionType="{projection}"
                GPano:FullPanoWidthPixels="1024" GPano:FullPanoHeightPixels="512" GPano:CroppedAreaLeftPixels="{left}"
                GPano:CroppedAreaTopPixels="160" GPano:CroppedAreaImageWidthPixels="400"
                GPano:CroppedAreaImageHeightPixels="192"/></r:RDF></x:xmpmeta>"#
            )
        };
        let read = |left, projection| PartialPanorama::from_xmp(packet(left, projection).as_bytes());
        let expected = PartialPanorama { full: [1024, 512], offset: [100, 160], size: [400, 192] };
        assert_eq!(read(100, "equirectangular"), Some(Ok(expected)));
        assert!(read(700, "equirectangular").unwrap().unwrap_err().contains("contradict"));
        assert!(read(100, "cylindrical").unwrap().unwrap_err().contains("projection"));
        assert_eq!(PartialPanorama::from_xmp(br#"<x:xmpmeta xmlns:x="adobe:ns:meta/"/>"#), None);
        assert!(!expected.is_full());
    }
}
