use std::f64::consts::{PI, TAU};

use lo_geometry::{DVec3, Mat3, Vec2, direction_from_uv, pixel_solid_angle_sr};
use rayon::prelude::*;

use super::fill::fill_unobserved;
use super::{BallError, BallView, MergedPhotos};
use lo_imaging::{Image, RadianceImage, sample_clamped, view_rotation};

/// Options of [`unwrap_ball`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnwrapOptions {
    /// Width and height of the panorama in pixels; `None` for [`UnwrappedBall::natural_size`].
    pub size: Option<[usize; 2]>,
    /// Reflectance of the ball by channel, above 0 and at most 1.
    pub reflectance: [f32; 3],
    /// Yaw of the panorama's centre to the right of the camera's viewing direction, in radians.
    pub yaw_rad: f32,
    /// Upward pitch of the camera in radians; the panorama is levelled by it.
    pub pitch_rad: f32,
    /// Half-angle, in radians, of a cone around the direction back to the camera that is cut out and filled, to remove
    /// camera and photographer.
    pub cut_out_camera_rad: f32,
}

impl Default for UnwrapOptions {
    fn default() -> Self {
        Self { size: None, reflectance: [1.0; 3], yaw_rad: 0.0, pitch_rad: 0.0, cut_out_camera_rad: 0.0 }
    }
}

/// A panorama unwrapped from a mirror ball.
#[derive(Clone, Debug, PartialEq)]
pub struct UnwrappedBall {
    /// Equirectangular radiance in our orientation. The centre is the camera's viewing direction, which the ball hides.
    pub radiance: RadianceImage,
    /// Observed share of each pixel; pixels with 0 are filled from their surroundings.
    pub observed: Image<f32>,
    /// Share of the sphere that is filled.
    pub filled_share: f64,
    /// Share of the sphere observed at less than half of the ball's mean resolution in one direction, near the outline.
    pub coarse_share: f64,
    /// Share of the ball's pixels that are clipped in every photo.
    pub clipped_share: f64,
}

/// Width of the border, in pixels, whose pixels are mixed with the background.
const RIM_PX: f64 = 1.5;
/// Largest number of samples along a pixel's side.
const MAX_SAMPLES: f64 = 64.0;

impl UnwrappedBall {
    /// Returns the panorama size, width and height, that preserves the ball's number of pixels per solid angle.
    ///
    /// An orthographic view is equal-area: π r² pixels for 4π sr, which is a map of π r × π r / 2.
    pub fn natural_size(view: &BallView) -> [usize; 2] {
        let width = (PI * view.circle().radius_px).clamp(16.0, 16_384.0);
        let quarter = (width / 4.0).ceil() as usize;
        [4 * quarter, 2 * quarter]
    }
}

/// Unwraps a ball: each pixel is the mean of its observed radiance, divided by the ball's reflectance.
///
/// # Errors
/// [`BallError::InvalidOption`] for a size that is not 2 : 1 or too large, or an option out of range.
pub fn unwrap_ball(
    photos: &MergedPhotos,
    view: &BallView,
    options: &UnwrapOptions,
) -> Result<UnwrappedBall, BallError> {
    let [width, height] = options.size.unwrap_or_else(|| UnwrappedBall::natural_size(view));
    check(options, [width, height])?;
    let photo = &photos.radiance;
    let camera_from_map =
        view_rotation(0.0, options.pitch_rad, 0.0).transpose() * Mat3::from_rotation_y(-options.yaw_rad);
    let back = -view.axis();
    let cut_out = if options.cut_out_camera_rad > 0.0 { options.cut_out_camera_rad.cos() } else { f32::INFINITY };
    let usable = 1.0 - RIM_PX / view.circle().radius_px;
    let photo_point = |x: f64, y: f64| {
        let uv = Vec2::new((x / width as f64) as f32, (y / height as f64) as f32);
        let direction = camera_from_map * direction_from_uv(uv);
        let point = view.photo_point(DVec3::from(direction).normalize(), usable)?;
        let [u, v] = point.position;
        let inside = u >= 0.0 && v >= 0.0 && u <= photo.width() as f64 && v <= photo.height() as f64;
        (inside && direction.dot(back) < cut_out).then_some(point)
    };
    let scale = options.reflectance.map(f32::recip);
    let texel = |index: usize| {
        let (x, y) = ((index % width) as f64, (index / width) as f64);
        let sin = ((y + 0.5) / height as f64 * PI).sin();
        let finest = photo_point(x + 0.5, y + 0.5).map_or(view.circle().radius_px, |point| point.pixels_per_rad[0]);
        let samples = |angle: f64| (angle * finest).ceil().clamp(1.0, MAX_SAMPLES);
        let (columns, rows) = (samples(TAU / width as f64 * sin), samples(PI / height as f64));
        let (mut sum, mut count, mut coarse) = ([0.0f64; 3], 0.0, 0.0);
        for j in 0..rows as usize {
            for i in 0..columns as usize {
                let at = [x + (i as f64 + 0.5) / columns, y + (j as f64 + 0.5) / rows];
                let Some(point) = photo_point(at[0], at[1]) else { continue };
                let rgb = sample_clamped(photo, point.position[0] as f32, point.position[1] as f32);
                (0..3).for_each(|c| sum[c] += f64::from(rgb[c]));
                count += 1.0;
                // the mean resolution of an orthographic view is r / 2 pixels per radian
                coarse += f64::from(u8::from(point.pixels_per_rad[1] < 0.25 * view.circle().radius_px));
            }
        }
        let observed = count / (rows * columns);
        let mean = [0, 1, 2].map(|c| if count > 0.0 { (sum[c] / count) as f32 * scale[c] } else { 0.0 });
        (mean, (observed as f32, (coarse / (rows * columns)) as f32))
    };
    let (pixels, shares): (Vec<_>, Vec<_>) = (0..width * height).into_par_iter().map(texel).unzip();
    let (observed, coarse): (Vec<f32>, Vec<f32>) = shares.into_iter().unzip();
    let share = |of: &dyn Fn(usize) -> f64| {
        let weigh = |index: usize| f64::from(pixel_solid_angle_sr(index / width, width, height)) * of(index);
        (0..width * height).map(weigh).sum::<f64>() / (4.0 * PI)
    };
    let filled_share = share(&|index| f64::from(u8::from(observed[index] <= 0.0)));
    let coarse_share = share(&|index| f64::from(coarse[index]));
    let observed = Image::new(width, height, observed);
    let mut radiance = RadianceImage::new(width, height, pixels);
    fill_unobserved(&mut radiance, &observed);
    Ok(UnwrappedBall { radiance, observed, filled_share, coarse_share, clipped_share: clipped_share(photos, view) })
}

fn check(options: &UnwrapOptions, [width, height]: [usize; 2]) -> Result<(), BallError> {
    let bad = |what, range, value| Err(BallError::InvalidOption { what, range, value });
    if width == 0 || width != 2 * height || width > 32_768 {
        return bad("the panorama's width", "twice its height, and at most 32768", width as f64);
    }
    if let Some(&value) = options.reflectance.iter().find(|&&v| !(v > 0.0 && v <= 1.0)) {
        return bad("the reflectance", "above 0 and at most 1", value.into());
    }
    let angles = [
        ("the yaw", options.yaw_rad),
        ("the pitch", options.pitch_rad),
        ("the half-angle of the camera cut-out", options.cut_out_camera_rad),
    ];
    if let Some((what, value)) = angles.into_iter().find(|(_, value)| !value.is_finite()) {
        return bad(what, "a finite number", value.into());
    }
    if !(0.0..=1.6).contains(&options.cut_out_camera_rad) {
        return bad(
            "the half-angle of the camera cut-out",
            "between 0 and 90 degrees",
            options.cut_out_camera_rad.to_degrees().into(),
        );
    }
    Ok(())
}

/// Share of clipped pixels within the outline.
fn clipped_share(photos: &MergedPhotos, view: &BallView) -> f64 {
    let circle = view.circle();
    let (width, height) = (photos.clipped.width(), photos.clipped.height());
    let range = |middle: f64, count: usize| {
        let end = |v: f64| v.clamp(0.0, count as f64) as usize;
        end((middle - circle.radius_px).floor())..end((middle + circle.radius_px).ceil())
    };
    let [mut inside, mut clipped] = [0usize; 2];
    for y in range(circle.y, height) {
        for x in range(circle.x, width) {
            if (x as f64 + 0.5 - circle.x).hypot(y as f64 + 0.5 - circle.y) < circle.radius_px - RIM_PX {
                inside += 1;
                clipped += usize::from(photos.clipped[(x, y)]);
            }
        }
    }
    clipped as f64 / inside.max(1) as f64
}
