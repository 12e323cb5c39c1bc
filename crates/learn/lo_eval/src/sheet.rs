//! Contact sheet: photos, true panoramas and estimated panoramas side by side.

use lo_dataset::Sample;
use lo_imaging::{Image, RadianceImage, ToneCurve, contact_sheet, photo_tile, resize_equirectangular};

/// Size of a panorama on the sheet, pixels. Photos have the same height.
const TILE: [usize; 2] = [256, 128];
const GAP: usize = 4;
/// Colour of missing panoramas.
pub(crate) const NOTHING: [u8; 3] = [60, 28, 28];

/// A contact sheet with one row per sample.
#[derive(Clone, Debug, Default)]
pub struct Sheet {
    rows: Vec<Vec<Image<[u8; 3]>>>,
}

impl Sheet {
    /// Adds a row: the photo, its first true panorama, and each method's panorama.
    ///
    /// All panoramas are tone-mapped by [`ToneCurve::Aces`] at the photo's exposure.
    pub fn add(&mut self, sample: &Sample, panoramas: &[Option<RadianceImage>]) {
        let photo = &sample.photo;
        let width = (TILE[1] * photo.width()).div_ceil(photo.height().max(1)).clamp(1, 3 * TILE[1]);
        let mut row = vec![photo_tile(photo, width, TILE[1])];
        let truth = sample.views.first().map(|view| &view.radiance);
        let shown = std::iter::once(truth).chain(panoramas.iter().map(Option::as_ref));
        row.extend(shown.map(|map| match map {
            Some(map) => ToneCurve::Aces.map(&resize_equirectangular(map, TILE[0], TILE[1]), 0.0),
            None => Image::new(TILE[0], TILE[1], vec![NOTHING; TILE[0] * TILE[1]]),
        }));
        self.rows.push(row);
    }

    /// Adds a row of images as they are.
    pub fn add_row(&mut self, pictures: Vec<Image<[u8; 3]>>) {
        self.rows.push(pictures);
    }

    /// Returns the number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Returns whether the sheet has no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Lays out the sheet as one image.
    pub fn picture(&self) -> Image<[u8; 3]> {
        let rows: Vec<&[Image<[u8; 3]>]> = self.rows.iter().map(|row| &row[..]).collect();
        contact_sheet(&rows, GAP)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;
    use lo_imaging::CONTACT_SHEET_BACKGROUND as GROUND;

    #[test]
    fn every_picture_has_its_place() {
        let sample = testing::box_room();
        let mut sheet = Sheet::default();
        let white = RadianceImage::new(8, 4, vec![[1e6; 3]; 32]);
        sheet.add(&sample, &[Some(white), None]);
        sheet.add(&sample, &[None]);
        let picture = sheet.picture();
        assert_eq!((sheet.len(), picture.width(), picture.height()), (2, 4 + 192 + 4 + 3 * 260, 4 + 2 * 132));
        assert_eq!(picture[(200 + 260 + 100, 60)], [255; 3]);
        assert_eq!(picture[(200 + 2 * 260 + 100, 60)], NOTHING);
        assert_eq!((picture[(0, 0)], picture[(200 + 2 * 260 + 100, 200)]), (GROUND, GROUND));
    }
}
