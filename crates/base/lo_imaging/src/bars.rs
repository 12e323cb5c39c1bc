//! Black bars around a picture: letterbox, pillarbox, and screenshots with rounded corners.

use lo_geometry::Camera;

use crate::{EncodedPhoto, GainMap, Image, Photo, srgb8_from_linear};

/// Largest sRGB value of black: video black is 16, and compression adds noise.
pub(crate) const BLACK: u8 = 28;

/// Smallest share of black pixels in a row of a bar. The others may be a clock or buttons.
const BAR_SHARE: f32 = 0.85;

/// Smallest share of pixels near the median of a bar. Dark photos have more noise.
const EVEN_SHARE: f32 = 0.95;

/// Largest difference from that median, of one bar and of two opposite ones, which noise and compression change.
const SPREADS: [usize; 2] = [2, 6];

/// Rows of a block of JPEG's.
const BLOCK: usize = 8;

/// Smallest share of pixels at the picture's edge that are brighter than the bar, of one bar and of two opposite ones.
const EDGE_SHARE: [f32; 2] = [0.97, 0.4];

/// Most rows after a bar in which its edge must be, a block of JPEG's, and share of all rows.
const EDGE_ROWS: usize = 9;
const EDGE_ROWS_SHARE: usize = 50;

/// Smallest share of the image's area that the picture has.
const MIN_AREA: f64 = 0.2;

/// Largest size of rounded corners along the diagonal, as a share of the picture's shorter side.
const MAX_CORNER: f64 = 0.08;

/// Widths of the black bars around a picture, in pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BlackBars {
    /// Columns at the left.
    pub left: usize,
    /// Rows at the top.
    pub top: usize,
    /// Columns at the right.
    pub right: usize,
    /// Rows at the bottom.
    pub bottom: usize,
}

impl BlackBars {
    /// Finds the black bars of a photo; `None` if there are none.
    ///
    /// A bar is evenly black and ends at a straight edge. Rounded corners of the picture count as bars, so that the
    /// picture is a rectangle.
    pub fn of(photo: &Photo) -> Option<Self> {
        let (width, height) = (photo.width(), photo.height());
        let value = |x: usize, y: usize| brightest(photo, (x, y));
        let rows = [false, true].map(|from_end| bar(value, [width, height], from_end));
        // A row of letterbox has no column of pillarbox.
        let turned = |x: usize, y: usize| value(y, x);
        let columns = [false, true].map(|from_end| bar(turned, [height, width], from_end));
        let [top, bottom] = kept(rows);
        let [left, right] = kept(columns);
        let bars = Self { left, top, right, bottom }.without_corners(value, [width, height]);
        let area = bars.inner_width(width)? as f64 * bars.inner_height(height)? as f64;
        (bars != Self::default() && area >= MIN_AREA * (width * height) as f64).then_some(bars)
    }

    /// Width of the picture in an image of this width.
    fn inner_width(&self, width: usize) -> Option<usize> {
        width.checked_sub(self.left + self.right).filter(|width| *width > 0)
    }

    /// Height of the picture in an image of this height.
    fn inner_height(&self, height: usize) -> Option<usize> {
        height.checked_sub(self.top + self.bottom).filter(|height| *height > 0)
    }

    /// Returns the camera of the picture from that of the photo; `None` if its principal point is in a bar.
    pub fn camera_of_picture(&self, photo: &Camera) -> Option<Camera> {
        let inner = |size: u32, bars: usize| size.checked_sub(bars as u32);
        let width = inner(photo.width, self.left + self.right)?;
        let height = inner(photo.height, self.top + self.bottom)?;
        Camera::new(photo.fx, photo.fy, photo.cx - self.left as f64, photo.cy - self.top as f64, width, height).ok()
    }

    /// Returns the camera of the photo from that of the picture.
    pub fn camera_of_photo(&self, picture: &Camera) -> Camera {
        let (cx, cy) = (picture.cx + self.left as f64, picture.cy + self.top as f64);
        let width = picture.width + (self.left + self.right) as u32;
        let height = picture.height + (self.top + self.bottom) as u32;
        Camera { cx, cy, width, height, ..*picture }
    }

    /// Returns the picture without the bars.
    ///
    /// # Panics
    /// If the photo is not larger than the bars.
    pub fn cropped(&self, photo: &Photo) -> Photo {
        match photo {
            Photo::Srgb8(image) => Photo::Srgb8(self.crop(image)),
            Photo::Encoded8(EncodedPhoto { image, encoding }) => {
                let size = [image.width(), image.height()];
                let gain_map = encoding.gain_map.as_ref();
                let gain_map = gain_map.map(|map| GainMap { image: self.cropped_map(&map.image, size), ..*map });
                Photo::encoded8(self.crop(image), encoding.with_gain_map(gain_map))
            }
            Photo::Linear(image) => Photo::Linear(self.crop(image)),
        }
    }

    /// Returns whether a pixel of an image of `size`, width and height, is in a bar.
    pub fn contains(&self, (x, y): (usize, usize), [width, height]: [usize; 2]) -> bool {
        let columns = self.left..width.saturating_sub(self.right);
        let rows = self.top..height.saturating_sub(self.bottom);
        !(columns.contains(&x) && rows.contains(&y))
    }

    /// Returns the bars of the same photo at another size.
    pub fn resized(&self, from: [usize; 2], to: [usize; 2]) -> Self {
        let scaled = |pixels: usize, axis: usize| (pixels * to[axis] + from[axis] / 2) / from[axis].max(1);
        Self {
            left: scaled(self.left, 0),
            top: scaled(self.top, 1),
            right: scaled(self.right, 0),
            bottom: scaled(self.bottom, 1),
        }
    }

    /// Crops a map with the view of a photo of `size`, width and height, to the picture, at the map's own resolution.
    pub fn cropped_map<T: Copy>(&self, map: &Image<T>, [width, height]: [usize; 2]) -> Image<T> {
        let axis = |count: usize, size: usize, start: usize, end: usize| {
            let inner = size - start - end;
            let cropped = ((count * inner) as f64 / size as f64).round().max(1.0) as usize;
            let index = move |at: usize| {
                let place = start as f64 + (at as f64 + 0.5) * inner as f64 / cropped as f64;
                ((place * count as f64 / size as f64) as usize).min(count - 1)
            };
            (cropped, index)
        };
        let (columns, column) = axis(map.width(), width, self.left, self.right);
        let (rows, row) = axis(map.height(), height, self.top, self.bottom);
        Image::from_fn(columns, rows, |x, y| map[(column(x), row(y))])
    }

    /// Returns a map of the picture as one of the photo of `size`, width and height, with `fill` in the bars. It has
    /// the map's own resolution, so that [`BlackBars::cropped_map`] returns a map of the same size.
    pub fn framed_map<T: Copy>(&self, map: &Image<T>, [width, height]: [usize; 2], fill: T) -> Image<T> {
        let axis = |count: usize, size: usize, start: usize, end: usize| {
            let inner = size - start - end;
            let framed = ((count * size) as f64 / inner as f64).round().max(1.0) as usize;
            // Index in the picture's map of the centre of a pixel.
            let index = move |at: usize| {
                let place = (at as f64 + 0.5) * size as f64 / framed as f64 - start as f64;
                let index = (place * count as f64 / inner as f64).floor();
                (0.0..count as f64).contains(&index).then_some(index as usize)
            };
            (framed, index)
        };
        let (columns, column) = axis(map.width(), width, self.left, self.right);
        let (rows, row) = axis(map.height(), height, self.top, self.bottom);
        Image::from_fn(columns, rows, |x, y| column(x).zip(row(y)).map_or(fill, |at| map[at]))
    }

    fn crop<T: Copy>(&self, image: &Image<T>) -> Image<T> {
        let (width, height) = (self.inner_width(image.width()), self.inner_height(image.height()));
        let (width, height) = width.zip(height).expect("bars of an image are smaller than the image");
        Image::from_fn(width, height, |x, y| image[(self.left + x, self.top + y)])
    }

    /// Widens the bars until they contain rounded corners.
    fn without_corners(self, value: impl Fn(usize, usize) -> u8, [width, height]: [usize; 2]) -> Self {
        let (Some(inner_width), Some(inner_height)) = (self.inner_width(width), self.inner_height(height)) else {
            return self;
        };
        let limit = (MAX_CORNER * inner_width.min(inner_height) as f64) as usize;
        let corners = [false, true].into_iter().flat_map(|right| [false, true].map(|bottom| (right, bottom)));
        let is_black = |(right, bottom): (bool, bool), x: usize, y: usize| {
            let at = |from_end: bool, start: usize, size: usize, index: usize| {
                if from_end { start + size - 1 - index } else { start + index }
            };
            value(at(right, self.left, inner_width, x), at(bottom, self.top, inner_height, y)) <= BLACK
        };
        let mut sizes = Vec::with_capacity(4);
        for corner in corners {
            let diagonal = (0..=limit).take_while(|&d| is_black(corner, d, d)).count();
            // On an arc, black ends after 3.4 times that along the border.
            let along = (0..(6 * diagonal).min(inner_width)).take_while(|&x| is_black(corner, x, 0)).count();
            if diagonal < 2 || diagonal > limit || !(2 * diagonal..5 * diagonal + 4).contains(&along) {
                return self;
            }
            sizes.push(diagonal);
        }
        let (least, most) = sizes.iter().fold((usize::MAX, 0), |(a, b), &size| (a.min(size), b.max(size)));
        if most > least + least / 2 + 2 {
            return self;
        }
        let size = most + 1;
        Self { left: self.left + size, top: self.top + size, right: self.right + size, bottom: self.bottom + size }
    }
}

/// The sRGB value of the brightest channel of a pixel.
fn brightest(photo: &Photo, at: (usize, usize)) -> u8 {
    let [r, g, b] = match photo {
        Photo::Srgb8(image) | Photo::Encoded8(EncodedPhoto { image, .. }) => image[at],
        Photo::Linear(image) => image[at].map(srgb8_from_linear),
    };
    r.max(g).max(b)
}

/// A black bar at the top or bottom.
#[derive(Clone, Copy, Default)]
struct Bar {
    rows: usize,
    /// Shares of pixels that are as black as the bar, within each of [`SPREADS`].
    even_shares: [f32; 2],
    /// Share of pixels at its edge that are brighter.
    edge_share: f32,
}

/// Measures the bar at the first rows, or the last ones. Without a bar one row is read.
fn bar(value: impl Fn(usize, usize) -> u8, [width, height]: [usize; 2], from_end: bool) -> Bar {
    let row = |index: usize| {
        let y = if from_end { height - 1 - index } else { index };
        let value = &value;
        (0..width).map(move |x| value(x, y))
    };
    let share = |index: usize, holds: &dyn Fn(u8) -> bool| {
        row(index).filter(|&value| holds(value)).count() as f32 / width.max(1) as f32
    };
    let rows = (0..height).take_while(|&index| share(index, &|value| value <= BLACK) >= BAR_SHARE).count();
    if rows < (height / 100).max(3) || rows == height {
        return Bar::default();
    }
    let mut counts = [0usize; 256];
    (0..rows).flat_map(row).for_each(|value| counts[usize::from(value)] += 1);
    let mut below = 0;
    let median = (0..256).find(|&value| {
        below += counts[value];
        2 * below >= rows * width
    });
    let median = median.unwrap_or(0);
    // Compression blurs the picture into the last block of the bar.
    let clean = if rows > 2 * BLOCK { rows - BLOCK } else { rows };
    let even_share = |spread: usize, rows: usize| {
        let is_even = |value: u8| usize::from(value).abs_diff(median) <= spread;
        (0..rows).map(|index| share(index, &is_even)).sum::<f32>() / rows as f32
    };
    let even_shares = [even_share(SPREADS[0], rows), even_share(SPREADS[1], clean)];
    let brighter = |value: u8| usize::from(value) > median + 16;
    let edge_rows = (height / EDGE_ROWS_SHARE).clamp(1, EDGE_ROWS);
    let edge: Vec<f32> = (rows..height.min(rows + edge_rows)).map(|index| share(index, &brighter)).collect();
    let edge_share = edge.iter().copied().fold(0.0, f32::max);
    let before_edge = edge.iter().take_while(|&&share| 2.0 * share < edge_share).count();
    Bar { rows: rows + before_edge, even_shares, edge_share }
}

/// Rows of two opposite bars, 0 where a bar is not even or its edge not straight.
fn kept(bars: [Bar; 2]) -> [usize; 2] {
    let is_bar = |bar: &Bar, kind: usize| bar.even_shares[kind] >= EVEN_SHARE && bar.edge_share >= EDGE_SHARE[kind];
    if bars.iter().all(|bar| is_bar(bar, 1)) {
        return bars.map(|bar| bar.rows);
    }
    bars.map(|bar| if is_bar(&bar, 0) { bar.rows } else { 0 })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use ::image::ImageEncoder;
    use ::image::codecs::jpeg::JpegEncoder;

    use crate::{perspective_from_equirectangular, read_photo, read_radiance, view_rotation};
    use lo_testdata::{real_panoramas, real_photos, shared_data};

    /// A picture of 120 × 80 with a bright and a dark half.
    fn picture(x: usize, y: usize) -> [u8; 3] {
        if x < 60 { [180, 120, (y + 40) as u8] } else { [60, 20 + (x % 7) as u8, 5] }
    }

    fn framed(bars: BlackBars, black: impl Fn(usize, usize) -> [u8; 3]) -> Photo {
        let BlackBars { left, top, right, bottom } = bars;
        Photo::Srgb8(Image::from_fn(left + 120 + right, top + 80 + bottom, |x, y| {
            let is_inside = (left..left + 120).contains(&x) && (top..top + 80).contains(&y);
            if is_inside { picture(x - left, y - top) } else { black(x, y) }
        }))
    }

    #[test]
    fn framed_maps_are_cropped_to_what_they_were() {
        let bars = BlackBars { left: 13, top: 80, right: 0, bottom: 41 };
        let size = [640, 480];
        let [inner_width, inner_height] = [627, 359];
        for (width, height) in [(inner_width, inner_height), (37, 28), (1254, 718), (5, 3)] {
            let map = Image::from_fn(width, height, |x, y| (1 + x + 10_000 * y) as u32);
            let framed = bars.framed_map(&map, size, 0);
            let cropped = bars.cropped_map(&framed, size);
            assert_eq!((cropped.width(), cropped.height()), (width, height));
            let is_near = |(at, &value): (usize, &u32)| {
                let (x, y) = (at % width, at / width);
                let (column, row) = ((value as usize - 1) % 10_000, (value as usize - 1) / 10_000);
                column.abs_diff(x) <= 1 && row.abs_diff(y) <= 1
            };
            assert!(cropped.pixels().iter().all(|&value| value > 0), "the bars are left out");
            assert!(cropped.pixels().iter().enumerate().all(is_near));
            assert!((width, height) != (inner_width, inner_height) || cropped == map, "to the pixel");
            // A bar of less than half a row may have none.
            assert!(framed[(0, 0)] == 0 && (height < 10 || framed[(0, framed.height() - 1)] == 0));
        }
    }

    #[test]
    fn bars_are_found_to_the_pixel() {
        let at = |left, top, right, bottom| BlackBars { left, top, right, bottom };
        for bars in [at(0, 20, 0, 20), at(40, 0, 40, 0), at(0, 0, 0, 15), at(30, 0, 0, 0), at(20, 21, 22, 23)] {
            // black, video black, and black with the noise of compression
            for level in [0u8, 16] {
                let noise = |x: usize, y: usize| [level + ((x * 7 + y * 3) % 3) as u8; 3];
                let photo = framed(bars, noise);
                assert_eq!(BlackBars::of(&photo), Some(bars));
                let Photo::Srgb8(inner) = bars.cropped(&photo) else { panic!() };
                assert_eq!((inner.width(), inner.height()), (120, 80));
                assert_eq!((inner[(0, 0)], inner[(119, 79)]), (picture(0, 0), picture(119, 79)));
                let size = [photo.width(), photo.height()];
                assert!(!bars.contains((bars.left, bars.top), size));
                assert_eq!(bars.contains((0, 0), size), bars.left + bars.top > 0);
                assert_eq!(bars.contains((size[0] - 1, size[1] - 1), size), bars.right + bars.bottom > 0);
                assert_eq!(bars.resized(size, size.map(|side| 2 * side)).left, 2 * bars.left);
            }
        }
        // a clock in the upper bar
        let clock = |x: usize, y: usize| if (50..58).contains(&x) && (5..12).contains(&y) { [230; 3] } else { [0; 3] };
        assert_eq!(BlackBars::of(&framed(at(0, 20, 0, 20), clock)), Some(at(0, 20, 0, 20)));
        assert_eq!(BlackBars::of(&framed(BlackBars::default(), clock)), None);
    }

    #[test]
    fn bars_of_compressed_photos_are_found() {
        let Photo::Srgb8(photo) = read_photo(lo_testdata::asset("library_color.jpg")).unwrap().photo else { panic!() };
        let photo = Image::from_fn(480, 360, |x, y| photo[(4 * x, 4 * y)]);
        let at = |left, top, right, bottom| BlackBars { left, top, right, bottom };
        let framed = |bars: BlackBars, noise: u32| {
            let (width, height) = (480 + bars.left + bars.right, 360 + bars.top + bars.bottom);
            let mut state = 1u32;
            Image::from_fn(width, height, |x, y| {
                let inner = x.checked_sub(bars.left).zip(y.checked_sub(bars.top)).filter(|&(x, y)| x < 480 && y < 360);
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                inner.map_or([(8 + (state >> 16) % (2 * noise + 1)) as u8; 3], |at| photo[at])
            })
        };
        for bars in [at(0, 60, 0, 60), at(80, 0, 80, 0), at(40, 40, 40, 40), at(21, 33, 27, 35), at(0, 0, 0, 40)] {
            // one bar with noise is taken for a dark part of the photo
            let most_noise = if bars.top + bars.left > 0 { 4 } else { 2 };
            for (quality, noise) in [(90, 0), (75, 0), (50, 0), (30, 0), (75, most_noise)] {
                let image = framed(bars, noise);
                let size = [image.width(), image.height()].map(|side| side as u32);
                let mut bytes = Vec::new();
                let encoder = JpegEncoder::new_with_quality(&mut bytes, quality);
                let samples = image.pixels().as_flattened();
                encoder.write_image(samples, size[0], size[1], ::image::ExtendedColorType::Rgb8).unwrap();
                let found = BlackBars::of(&crate::photo_from_bytes(&bytes, "a.jpg").unwrap().photo);
                let sides = |bars: BlackBars| [bars.left, bars.top, bars.right, bars.bottom];
                let (found, expected) = (sides(found.unwrap_or_default()), sides(bars));
                let agree = found.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 1);
                assert!(agree, "{found:?} instead of {expected:?}, quality {quality}, noise {noise}");
            }
        }
    }

    #[test]
    fn rounded_corners_are_left_out() {
        let rounded = |photo: &Photo, bars: BlackBars, radius: f64| {
            let Photo::Srgb8(image) = photo else { panic!() };
            let (width, height) = (image.width() - bars.left - bars.right, image.height() - bars.top - bars.bottom);
            Photo::Srgb8(Image::from_fn(image.width(), image.height(), |x, y| {
                let beyond = |at: usize, start: usize, size: usize| {
                    let at = at as f64 - start as f64 + 0.5;
                    (radius - at).max(at - (size as f64 - radius)).max(0.0)
                };
                let is_outside = beyond(x, bars.left, width).hypot(beyond(y, bars.top, height)) > radius;
                if is_outside { [0; 3] } else { image[(x, y)] }
            }))
        };
        let bars = BlackBars { top: 20, bottom: 20, ..BlackBars::default() };
        for bars in [bars, BlackBars::default()] {
            let found = BlackBars::of(&rounded(&framed(bars, |_, _| [0; 3]), bars, 12.0)).unwrap();
            // 12 (1 − √½) = 3.5 pixels along the diagonal
            let expected = BlackBars { left: 5, right: 5, top: bars.top + 5, bottom: bars.bottom + 5 };
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn real_photos_have_no_bars_and_framed_ones_do() {
        for file in real_photos("bars of real photos") {
            let photo = read_photo(&file).unwrap().photo;
            // also underexposed by five stops
            let dark = Photo::Linear(photo.radiance().map(|rgb| rgb.map(|c| c / 32.0)));
            for photo in [&photo, &dark] {
                assert_eq!(BlackBars::of(photo), None, "{}", file.display());
            }
        }
        let Some(folder) = shared_data("inputs", "bars of framed photos") else { return };
        let found = |name: &str| BlackBars::of(&read_photo(folder.join(name)).unwrap().photo).unwrap();
        assert_eq!(found("letterbox.png"), BlackBars { top: 80, bottom: 80, ..BlackBars::default() });
        assert_eq!(found("pillarbox.png"), BlackBars { left: 220, right: 220, ..BlackBars::default() });
    }

    /// Views of panoramas, among them black studios.
    #[test]
    fn dark_rooms_have_no_bars() {
        let files = real_panoramas(&["hdr", "hdr_more"], "bars in views of dark rooms");
        let (mut found, mut views) = (Vec::new(), 0);
        for file in files {
            let panorama = read_radiance(&file).unwrap();
            for turn in 0..6u8 {
                let rotation = view_rotation(f32::from(turn) * 1.047, 0.2 * f32::from(turn % 3) - 0.2, 0.0);
                let camera = lo_geometry::Camera::from_hfov_deg(70.0, 96, 64).unwrap();
                let view = perspective_from_equirectangular(&panorama, &camera, rotation);
                for exposure in [1.0, 0.3, 0.1] {
                    let photo = Photo::Linear(view.map(|rgb| rgb.map(|c| exposure * c)));
                    views += 1;
                    let bars = BlackBars::of(&photo);
                    found.extend(bars.map(|bars| format!("{}, {turn}, × {exposure}: {bars:?}", file.display())));
                }
            }
        }
        assert!(found.is_empty(), "{} of {views} views: {found:#?}", found.len());
    }
}
