/// An image of any pixel type, row by row from the top, without padding.
#[derive(Clone, Debug, PartialEq)]
pub struct Image<T> {
    width: usize,
    height: usize,
    pixels: Vec<T>,
}

/// Linear RGB radiance with Rec. 709 primaries; 1.0 is the photo's white, and values are not clipped there.
pub type RadianceImage = Image<[f32; 3]>;

/// Depth in metres, along the optical axis (photo) or from the probe (panorama); 0 means no reading.
pub type DepthMap = Image<f32>;

impl<T> Image<T> {
    /// Creates an image from its pixels, row by row.
    ///
    /// # Panics
    /// If `pixels` does not have `width · height` values.
    pub fn new(width: usize, height: usize, pixels: Vec<T>) -> Self {
        assert_eq!(pixels.len(), width * height, "number of pixels of an image of {width} × {height}");
        Self { width, height, pixels }
    }

    /// Creates an image by computing each pixel from its position `(x, y)`.
    pub fn from_fn(width: usize, height: usize, mut pixel: impl FnMut(usize, usize) -> T) -> Self {
        let mut pixels = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                pixels.push(pixel(x, y));
            }
        }
        Self { width, height, pixels }
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All pixels, row by row from the top.
    pub fn pixels(&self) -> &[T] {
        &self.pixels
    }

    /// All pixels, mutable.
    pub fn pixels_mut(&mut self) -> &mut [T] {
        &mut self.pixels
    }

    /// Consumes the image and returns its pixels.
    pub fn into_pixels(self) -> Vec<T> {
        self.pixels
    }

    /// Returns the image with left and right exchanged.
    pub fn mirrored(&self) -> Self
    where
        T: Copy,
    {
        Self::from_fn(self.width, self.height, |x, y| self[(self.width - 1 - x, y)])
    }

    /// Maps each pixel to a new image of the same size.
    pub fn map<U>(&self, f: impl FnMut(&T) -> U) -> Image<U> {
        Image { width: self.width, height: self.height, pixels: self.pixels.iter().map(f).collect() }
    }
}

impl<T> std::ops::Index<(usize, usize)> for Image<T> {
    type Output = T;

    fn index(&self, (x, y): (usize, usize)) -> &T {
        debug_assert!(x < self.width);
        &self.pixels[y * self.width + x]
    }
}

impl<T> std::ops::IndexMut<(usize, usize)> for Image<T> {
    fn index_mut(&mut self, (x, y): (usize, usize)) -> &mut T {
        debug_assert!(x < self.width);
        &mut self.pixels[y * self.width + x]
    }
}
