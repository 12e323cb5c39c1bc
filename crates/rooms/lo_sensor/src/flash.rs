use lo_geometry::Vec3;
use lo_imaging::RadianceImage;

use crate::{DepthView, UNIT_CD_M2};

/// Adds the light of a flash at the camera to radiance in units of 100 cd/m². The flash gives `intensity_cd` candela
/// straight ahead. Its light falls off with the squared cosine of the angle and the squared distance. Surfaces reflect
/// it diffusely by their base colour; panes and mirrors do not show it.
///
/// # Panics
/// If the images differ in size.
pub(crate) fn add_flash(radiance: &RadianceImage, view: &DepthView, intensity_cd: f32) -> RadianceImage {
    let size = (radiance.width(), radiance.height());
    assert_eq!(size, (view.depth_m.width(), view.depth_m.height()), "the view's size must match the image's");
    let per_unit = intensity_cd / (std::f32::consts::PI * UNIT_CD_M2);
    RadianceImage::from_fn(size.0, size.1, |x, y| {
        let ambient = radiance[(x, y)];
        let z = view.depth_m[(x, y)];
        if z <= 0.0 || view.specular[(x, y)] {
            return ambient;
        }
        let direction = view.camera.direction(x as f64 + 0.5, y as f64 + 0.5);
        let cosine = (-direction.dot(Vec3::from_array(view.normal[(x, y)]))).clamp(0.0, 1.0);
        let distance = -z / direction.z;
        let light = per_unit * direction.z * direction.z * cosine / (distance * distance);
        let albedo = view.albedo[(x, y)];
        std::array::from_fn(|c| ambient[c] + albedo[c] * light)
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::Camera;
    use lo_imaging::{DepthMap, Image};

    use super::*;

    #[test]
    fn light_of_the_flash_falls_by_the_inverse_square() {
        let camera = Camera::from_hfov_deg(60.0, 41, 31).unwrap();
        let at = |z: f32, specular: bool| {
            let depth_m = DepthMap::new(41, 31, vec![z; 41 * 31]);
            let normal = Image::new(41, 31, vec![[0.0, 0.0, 1.0]; 41 * 31]);
            let albedo = Image::new(41, 31, vec![[0.5, 0.25, 0.1]; 41 * 31]);
            let specular = Image::new(41, 31, vec![specular; 41 * 31]);
            let view =
                DepthView { camera: &camera, depth_m: &depth_m, normal: &normal, albedo: &albedo, specular: &specular };
            add_flash(&RadianceImage::new(41, 31, vec![[0.1; 3]; 41 * 31]), &view, 100.0)
        };
        // 100 lx on a sheet of albedo ½ at 1 m: 15.9 cd/m², 0.159 units.
        let light = at(1.0, false)[(20, 15)];
        assert!((light[0] - 0.1 - 0.159).abs() < 1e-3 && (light[1] - 0.1 - 0.0796).abs() < 1e-3, "{light:?}");
        assert!((at(2.0, false)[(20, 15)][0] - 0.1 - 0.159 / 4.0).abs() < 1e-3);
        assert!(at(1.0, false)[(0, 15)][0] < light[0]);
        assert_eq!(at(1.0, true)[(20, 15)], [0.1; 3]);
        assert_eq!(at(0.0, false)[(20, 15)], [0.1; 3]);
    }
}
