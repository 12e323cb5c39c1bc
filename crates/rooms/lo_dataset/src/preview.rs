//! Contact sheets: many photos and panoramas in one image.

use lo_imaging::{Image, RadianceImage, ToneCurve, contact_sheet, photo_tile, resize_equirectangular};

use crate::Sample;

/// Width of an image on the sheet, in pixels.
const TILE: usize = 240;
/// Gap between images and around the sheet, in pixels.
const GAP: usize = 6;

/// Sheet with rows of photos, then rows of panoramas.
#[derive(Clone, Debug)]
pub struct ContactSheet {
    columns: usize,
    photos: Vec<Image<[u8; 3]>>,
    panoramas: Vec<Image<[u8; 3]>>,
}

impl ContactSheet {
    /// Creates an empty sheet with `columns` (at least 1) images per row.
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

    /// Returns the sheet. An empty sheet is only its margin.
    pub fn image(&self) -> Image<[u8; 3]> {
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
        let image = sheet.image();
        // Two rows of photos 240 × 160 and one of panoramas 240 × 120.
        assert_eq!((image.width(), image.height()), (6 + 2 * 246, 6 + 2 * 166 + 126));
        assert_eq!(image[(0, 0)], GROUND);
        assert_eq!(image[(6 + 246, 6 + 166)], GROUND, "the third photo's neighbour is empty");
        assert_eq!(image[(100, 6 + 2 * 166 + 60)], [255; 3]);
        assert_eq!(ContactSheet::new(0).image().pixels().len(), 36);
    }
}
