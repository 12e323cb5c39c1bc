use std::io::{self, Write};

use y4m::{Colorspace, Encoder, Frame, Ratio};

use crate::{Photo, srgb8_from_linear};

/// Writes frames of one size as uncompressed YUV4MPEG2 video (4:4:4, BT.709), which video encoders read from a file or
/// pipe.
pub struct Y4mWriter<W: Write> {
    encoder: Encoder<W>,
}

impl<W: Write> Y4mWriter<W> {
    /// Writes the header of a video of `size` (width, height) pixels.
    ///
    /// # Errors
    /// I/O errors.
    pub fn new(target: W, size: (usize, usize), frames_per_second: u32) -> io::Result<Self> {
        let rate = Ratio::new(frames_per_second as usize, 1);
        let encoder = y4m::encode(size.0, size.1, rate).with_colorspace(Colorspace::C444).write_header(target);
        Ok(Self { encoder: encoder.map_err(io_error)? })
    }

    /// Appends a frame.
    ///
    /// # Errors
    /// I/O errors.
    pub fn add(&mut self, photo: &Photo) -> io::Result<()> {
        let mut planes = [(); 3].map(|()| Vec::with_capacity(photo.width() * photo.height()));
        let mut put = |rgb: [u8; 3]| {
            for (plane, value) in planes.iter_mut().zip(y_cb_cr(rgb)) {
                plane.push(value);
            }
        };
        match photo {
            Photo::Srgb8(image) => image.pixels().iter().for_each(|&rgb| put(rgb)),
            Photo::Encoded8(photo) => photo.srgb8().pixels().iter().for_each(|&rgb| put(rgb)),
            Photo::Linear(image) => image.pixels().iter().for_each(|pixel| put(pixel.map(srgb8_from_linear))),
        }
        let [y, cb, cr] = &planes;
        self.encoder.write_frame(&Frame::new([y, cb, cr], None)).map_err(io_error)
    }
}

fn io_error(error: y4m::Error) -> io::Error {
    match error {
        y4m::Error::IoError(error) => error,
        error => io::Error::other(error.to_string()),
    }
}

/// Converts R'G'B' to Y'CbCr of ITU-R BT.709 in narrow range: 16 to 235 and 16 to 240.
fn y_cb_cr(rgb: [u8; 3]) -> [u8; 3] {
    let [r, g, b] = rgb.map(|code| f32::from(code) / 255.0);
    let y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let (cb, cr) = ((b - y) / 1.8556, (r - y) / 1.5748);
    [16.0 + 219.0 * y, 128.0 + 224.0 * cb, 128.0 + 224.0 * cr].map(|value| value.round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_those_of_bt_709() {
        // 100 % colour bars from the 8-bit tables of ITU-R BT.709.
        let bars = [
            ([255, 255, 255], [235, 128, 128]),
            ([0, 0, 0], [16, 128, 128]),
            ([255, 0, 0], [63, 102, 240]),
            ([0, 255, 0], [173, 42, 26]),
            ([0, 0, 255], [32, 240, 118]),
            ([255, 255, 0], [219, 16, 138]),
        ];
        for (rgb, expected) in bars {
            assert_eq!(y_cb_cr(rgb), expected, "{rgb:?}");
        }
    }
}
