//! A picture to be looked at: photos, true panoramas and what methods make of them, side by side.

use lo_dataset::Sample;
use lo_imaging::{Image, RadianceImage, ToneCurve, contact_sheet, photo_tile, resize_equirectangular};

/// Size of a panorama on the sheet in pixels; photos are as high.
const TILE: [usize; 2] = [256, 128];
const GAP: usize = 4;
/// Where a method gave nothing.
pub(crate) const NOTHING: [u8; 3] = [60, 28, 28];

/// One row a sample.
#[derive(Clone, Debug, Default)]
pub struct Sheet {
    rows: Vec<Vec<Image<[u8; 3]>>>,
}

impl Sheet {
    /// Adds the first panorama of a sample: its photo, the truth, and each method's panorama or nothing.
    ///
    /// All panoramas of a row are tone-mapped alike ([`ToneCurve::Aces`], the photo's white staying white).
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

    /// Adds pictures as they are.
    pub fn add_row(&mut self, pictures: Vec<Image<[u8; 3]>>) {
        self.rows.push(pictures);
    }

    /// Rows so far.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there is nothing to see.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The sheet.
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
