//! Contact sheets: many photos and panoramas in one picture, to be looked at.

use lo_imaging::{Image, RadianceImage, ToneCurve, contact_sheet, photo_tile, resize_equirectangular};

use crate::Sample;

/// Width of a picture on the sheet in pixels.
const TILE: usize = 240;
/// Between pictures, and around the sheet.
const GAP: usize = 6;

/// Photos in rows, then panoramas in rows.
#[derive(Clone, Debug)]
pub struct ContactSheet {
    columns: usize,
    photos: Vec<Image<[u8; 3]>>,
    panoramas: Vec<Image<[u8; 3]>>,
}

impl ContactSheet {
    /// An empty sheet of `columns` pictures, at least 1, in a row.
    pub fn new(columns: usize) -> Self {
        Self { columns: columns.max(1), photos: Vec::new(), panoramas: Vec::new() }
    }

    /// Adds a sample's photo.
    pub fn add_photo(&mut self, sample: &Sample) {
        let height = (TILE * sample.photo.height()).div_ceil(sample.photo.width()).max(1);
        self.photos.push(photo_tile(&sample.photo, TILE, height));
    }

    /// Adds a panorama in units of a photo's white, tone-mapped ([`ToneCurve::Aces`]).
    pub fn add_panorama(&mut self, radiance: &RadianceImage) {
        let small = resize_equirectangular(radiance, TILE, TILE / 2);
        self.panoramas.push(ToneCurve::Aces.map(&small, 0.0));
    }

    /// The sheet; nothing but its margin where nothing was added.
    pub fn picture(&self) -> Image<[u8; 3]> {
        let rows = self.photos.chunks(self.columns).chain(self.panoramas.chunks(self.columns));
        contact_sheet(&rows.collect::<Vec<_>>(), GAP)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::record;
    use lo_imaging::CONTACT_SHEET_BACKGROUND as GROUND;

    #[test]
    fn every_picture_has_its_place() {
        let mut sheet = ContactSheet::new(2);
        let sample = record("a").sample(0);
        for _ in 0..3 {
            sheet.add_photo(&sample);
        }
        sheet.add_panorama(&RadianceImage::new(16, 8, vec![[1e6; 3]; 128]));
        let picture = sheet.picture();
        // two rows of photos 240 × 160 and one of panoramas 240 × 120
        assert_eq!((picture.width(), picture.height()), (6 + 2 * 246, 6 + 2 * 166 + 126));
        assert_eq!(picture[(0, 0)], GROUND);
        assert_eq!(picture[(6 + 246, 6 + 166)], GROUND, "the third photo's neighbour is empty");
        assert_eq!(picture[(100, 6 + 2 * 166 + 60)], [255; 3]);
        assert_eq!(ContactSheet::new(0).picture().pixels().len(), 36);
    }
}
