//! Contact sheets: many photos and panoramas in one picture, to be looked at.

use imaging::{Image, Photo, RadianceImage, ToneCurve, resize, resize_equirectangular};

use crate::Sample;

/// Width of a picture on the sheet in pixels.
const TILE: usize = 240;
/// Between pictures, and around the sheet.
const GAP: usize = 6;
/// Dark grey, as around a projected slide.
const GROUND: [u8; 3] = [28, 28, 28];

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
        let linear = Photo::Srgb8(sample.photo.clone()).into_radiance();
        let height = (TILE * linear.height()).div_ceil(linear.width()).max(1);
        self.photos.push(ToneCurve::Clip.map(&resize(&linear, TILE, height), 0.0));
    }

    /// Adds a panorama in units of a photo's white, tone-mapped ([`ToneCurve::Aces`]).
    pub fn add_panorama(&mut self, radiance: &RadianceImage) {
        let small = resize_equirectangular(radiance, TILE, TILE / 2);
        self.panoramas.push(ToneCurve::Aces.map(&small, 0.0));
    }

    /// The sheet; nothing but its margin where nothing was added.
    pub fn picture(&self) -> Image<[u8; 3]> {
        let rows: Vec<&[Image<[u8; 3]>]> =
            self.photos.chunks(self.columns).chain(self.panoramas.chunks(self.columns)).collect();
        let tallest = |row: &&[Image<[u8; 3]>]| row.iter().map(Image::height).max().unwrap_or(0);
        let widest = rows.iter().map(|row| row.len()).max().unwrap_or(0);
        let width = GAP + widest * (TILE + GAP);
        let height = GAP + rows.iter().map(|row| tallest(row) + GAP).sum::<usize>();
        let mut sheet = Image::new(width, height, vec![GROUND; width * height]);
        let mut top = GAP;
        for row in &rows {
            for (column, tile) in row.iter().enumerate() {
                let left = GAP + column * (TILE + GAP);
                for y in 0..tile.height() {
                    for x in 0..tile.width() {
                        sheet[(left + x, top + y)] = tile[(x, y)];
                    }
                }
            }
            top += tallest(row) + GAP;
        }
        sheet
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::record;

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
