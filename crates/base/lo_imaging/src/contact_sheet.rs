use crate::{Image, Photo, ToneCurve, resize};

/// Background colour of a [`contact_sheet`]: dark grey, as around a projected slide.
pub const CONTACT_SHEET_BACKGROUND: [u8; 3] = [28, 28, 28];

/// Arranges images in rows and columns, with `gap` pixels between them and around the sheet.
///
/// A row is as high as its tallest image, a column as wide as its widest. Images are aligned to the upper left of their
/// cell. Without rows the sheet is only its border.
pub fn contact_sheet(rows: &[&[Image<[u8; 3]>]], gap: usize) -> Image<[u8; 3]> {
    let columns = rows.iter().map(|row| row.len()).max().unwrap_or(0);
    let widths = (0..columns).map(|column| rows.iter().filter_map(|row| row.get(column)).map(Image::width).max());
    let widths: Vec<usize> = widths.map(Option::unwrap_or_default).collect();
    let heights: Vec<usize> = rows.iter().map(|row| row.iter().map(Image::height).max().unwrap_or(0)).collect();
    let all = |sizes: &[usize]| gap + sizes.iter().map(|size| size + gap).sum::<usize>();
    let (width, height) = (all(&widths), all(&heights));
    let mut sheet = Image::new(width, height, vec![CONTACT_SHEET_BACKGROUND; width * height]);
    for (number, row) in rows.iter().enumerate() {
        let top = all(&heights[..number]);
        for (column, tile) in row.iter().enumerate() {
            let left = all(&widths[..column]);
            for (y, line) in tile.pixels().chunks(tile.width().max(1)).enumerate() {
                let begin = (top + y) * width + left;
                sheet.pixels_mut()[begin..begin + line.len()].copy_from_slice(line);
            }
        }
    }
    sheet
}

/// Resizes a photo for a [`contact_sheet`].
///
/// # Panics
/// If the photo or the size has no pixels.
pub fn photo_tile(photo: &Image<[u8; 3]>, width: usize, height: usize) -> Image<[u8; 3]> {
    let linear = Photo::Srgb8(photo.clone()).into_radiance();
    ToneCurve::Clip.map(&resize(&linear, width, height), 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tile(width: usize, height: usize, value: u8) -> Image<[u8; 3]> {
        Image::new(width, height, vec![[value; 3]; width * height])
    }

    #[test]
    fn every_picture_has_its_place() {
        let rows = [vec![tile(5, 4, 1), tile(2, 3, 2)], vec![tile(3, 2, 3), tile(4, 1, 4), tile(1, 1, 5)], vec![]];
        let rows: Vec<&[Image<[u8; 3]>]> = rows.iter().map(|row| &row[..]).collect();
        let sheet = contact_sheet(&rows, 2);
        // columns of 5, 4 and 1, rows of 4, 2 and 0
        assert_eq!((sheet.width(), sheet.height()), (2 + 7 + 6 + 3, 2 + 6 + 4 + 2));
        for (value, places) in [
            (1, [(2, 2), (6, 5)]),
            (2, [(9, 2), (10, 4)]),
            (3, [(2, 8), (4, 9)]),
            (4, [(9, 8), (12, 8)]),
            (5, [(15, 8), (15, 8)]),
        ] {
            assert!(places.into_iter().all(|place| sheet[place] == [value; 3]), "{value}");
        }
        let background = sheet.pixels().iter().filter(|rgb| **rgb == CONTACT_SHEET_BACKGROUND).count();
        assert_eq!(background, 18 * 14 - (20 + 6 + 6 + 4 + 1), "all else is background");
        assert_eq!(contact_sheet(&[], 6).pixels().len(), 36);
    }

    #[test]
    fn a_photo_keeps_its_colours() {
        let photo = Image::from_fn(8, 4, |x, _| if x < 4 { [10, 128, 255] } else { [0; 3] });
        let small = photo_tile(&photo, 2, 1);
        assert_eq!(small.pixels(), [[10, 128, 255], [0; 3]]);
    }
}
