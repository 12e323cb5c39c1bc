use lo_geometry::{Camera, Mat3, Quat, Vec3, pixel_direction, uv_from_direction};
use lo_imaging::{
    DepthMap, Image, RadianceImage, perspective_from_equirectangular, resize_equirectangular, view_rotation,
};
use lo_random::{RngExt, Stream};
use lo_sensor::{Interval, PhotoModel};
use serde::{Deserialize, Serialize};

use lo_octree::{Provenance, RadiancePoint};

use super::files::photographed;
use crate::sample::Metadata;
use crate::{NovelView, Record};

/// Cropping of photos from panoramas: directions and cameras.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CropModel {
    /// Width of a photo in pixels.
    pub width: u32,
    /// Height of a photo in pixels.
    pub height: u32,
    /// Height of the returned panoramas.
    pub panorama_height: usize,
    /// Photos per panorama, in directions all around.
    pub crops: u32,
    /// Whether every epoch has other photos. Otherwise they repeat.
    pub anew_each_epoch: bool,
    /// Horizontal field of view, in degrees.
    pub hfov_deg: Interval,
    /// Pitch in degrees, positive upwards.
    pub pitch_deg: Interval,
    /// Roll, in degrees.
    pub roll_deg: Interval,
    /// Photo camera.
    pub photo: PhotoModel,
    /// Whether all photos get the same sharpness: that of the longest lens of `hfov_deg`, for which the panorama has
    /// the fewest pixels. Otherwise sharpness reveals the lens.
    pub even_sharpness: bool,
    /// Seed of all random choices.
    pub seed: u64,
}

impl Default for CropModel {
    fn default() -> Self {
        Self {
            width: 480,
            height: 320,
            panorama_height: 128,
            crops: 1,
            anew_each_epoch: false,
            hfov_deg: Interval::new(50.0, 90.0),
            pitch_deg: Interval::new(-15.0, 15.0),
            roll_deg: Interval::new(-2.0, 2.0),
            photo: PhotoModel::default(),
            even_sharpness: false,
            seed: 0,
        }
    }
}

/// Panorama with further maps of the same directions. All have the same size.
pub(super) struct PanoramaMaps<'a> {
    pub radiance: &'a RadianceImage,
    /// Distance in metres.
    pub depth_m: Option<&'a DepthMap>,
    /// Distance of the surfaces that light comes from, without holes. May differ from the distance of visible surfaces.
    pub enclosure_m: Option<&'a DepthMap>,
    pub albedo: Option<&'a RadianceImage>,
}

impl PanoramaMaps<'_> {
    /// Returns a surface point for each pixel with known distance.
    fn points(&self) -> Vec<RadiancePoint> {
        let Some(enclosure_m) = self.enclosure_m else { return Vec::new() };
        let (width, height) = (enclosure_m.width(), enclosure_m.height());
        let pixels = self.radiance.pixels().iter().zip(enclosure_m.pixels()).enumerate();
        let point = |(i, (&radiance, distance_m)): (usize, (&[f32; 3], &f32))| RadiancePoint {
            position_m: *distance_m * pixel_direction(i % width, i / width, width, height),
            radiance,
            provenance: Provenance::Inferred,
        };
        pixels.map(point).collect()
    }
}

impl CropModel {
    /// Makes crop number `crop` of the panorama `id` in an epoch: a record with that photo, and the panorama as ground
    /// truth at the camera.
    ///
    /// The random choices depend on the id, not on the panorama's index in the folder.
    pub(super) fn crop(&self, id: &str, scene_id: String, (crop, epoch): (usize, u64), maps: &PanoramaMaps) -> Record {
        let drawn_before = if self.anew_each_epoch { epoch * u64::from(self.crops.max(1)) } else { 0 };
        let number = crop as u64 + drawn_before;
        let mut stream = lo_random::stream(self.seed ^ lo_random::hash(id.as_bytes()), "crop", number);
        let camera = self.camera(&mut stream);
        // Crops are spread around the circle, so that a few of them cover the whole room.
        let yaw = std::f32::consts::TAU * (crop as f32 + stream.random::<f32>()) / self.crops.max(1) as f32;
        let [pitch, roll] = [self.pitch_deg, self.roll_deg].map(|angle| angle.draw(&mut stream).to_radians());
        let rotation = view_rotation(yaw, pitch, roll);
        let seen = perspective_from_equirectangular(maps.radiance, &camera, rotation);
        let mut settings = self.photo.draw(&mut stream);
        if self.even_sharpness {
            settings.blur_px = settings.blur_px.hypot(self.missing_blur_px(&camera, maps.radiance.width()));
        }
        let mut shot = photographed(&settings, &seen, camera, &mut stream);
        let depth_m =
            maps.depth_m.map(|depth| lookup(depth, &camera, rotation, |&distance, direction| distance * -direction.z));
        shot.rotation = Quat::from_mat3(&rotation);
        shot.depth_m = depth_m;
        shot.albedo = maps.albedo.map(|albedo| lookup(albedo, &camera, rotation, |&rgb, _| rgb));
        shot.views = vec![0];
        shot.metadata.insert("gains".to_owned(), serde_json::json!(shot.gains));
        let view = NovelView {
            position_m: Vec3::ZERO,
            rotation: Quat::IDENTITY,
            radiance: resize_equirectangular(maps.radiance, 2 * self.panorama_height, self.panorama_height),
            depth_m: maps.depth_m.map(|depth| {
                let (width, height) = (2 * self.panorama_height, self.panorama_height);
                // Nearest neighbour: depths of two surfaces must not be mixed.
                Image::from_fn(width, height, |x, y| {
                    depth[((2 * x + 1) * depth.width() / (2 * width), (2 * y + 1) * depth.height() / (2 * height))]
                })
            }),
        };
        Record {
            key: if self.crops > 1 { format!("{id}-{crop}") } else { id.to_owned() },
            scene_id,
            up: Some(Vec3::Y),
            points: maps.points(),
            point_area_m2: None,
            views: vec![view],
            shots: vec![shot],
            metadata: Metadata::new(),
        }
    }

    /// Returns the standard deviation of the blur, in pixels, that makes a photo as soft in its middle as one by the
    /// longest lens. A panorama's pixel is modelled as a box.
    fn missing_blur_px(&self, camera: &Camera, panorama_width: usize) -> f32 {
        let pixel_px = |camera: &Camera| camera.fx * std::f64::consts::TAU / panorama_width as f64;
        let (widest, own) = (pixel_px(&self.camera_of(self.hfov_deg.low().into())), pixel_px(camera));
        ((widest * widest - own * own).max(0.0) / 12.0).sqrt() as f32
    }

    fn camera(&self, stream: &mut Stream) -> Camera {
        self.camera_of(self.hfov_deg.draw(stream).into())
    }

    fn camera_of(&self, hfov_deg: f64) -> Camera {
        let hfov_deg = hfov_deg.clamp(5.0, 150.0);
        Camera::from_hfov_deg(hfov_deg, self.width.max(1), self.height.max(1))
            .expect("a field of view of 5° to 150° and at least one pixel make a valid camera")
    }
}

/// Resamples an equirectangular map to a photo, by nearest neighbour. `value` receives the map's value and the
/// direction in camera axes.
fn lookup<T, U>(map: &Image<T>, camera: &Camera, rotation: Mat3, value: impl Fn(&T, Vec3) -> U) -> Image<U> {
    Image::from_fn(camera.width as usize, camera.height as usize, |x, y| {
        let direction = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
        value(&map[pixel_at(map, rotation * direction)], direction)
    })
}

/// Returns the pixel of an equirectangular map in a direction.
pub(super) fn pixel_at<T>(map: &Image<T>, direction: Vec3) -> (usize, usize) {
    let uv = uv_from_direction(direction);
    let index = |t: f32, count: usize| ((t * count as f32) as usize).min(count - 1);
    (index(uv.x, map.width()), index(uv.y, map.height()))
}
