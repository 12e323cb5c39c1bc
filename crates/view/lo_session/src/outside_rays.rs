//! Colours along rays of the view from outside.

use lightoctree::LitScene;
use lo_geometry::{Ray, Vec3};
use lo_imaging as imaging;
use lo_imaging::ToneCurve;
use lo_mesh::{Hit, PlacedModel, PreparedModel};
use lo_octree::LeafNode;

use crate::Overlay;
use crate::overlay::{DepthRange, RadianceOrigin, level_color, normal_color, origin_color, origin_of_leaf};

/// Background colour, equal to the page's.
const BACKGROUND: [u8; 3] = [48; 3];

/// Brightness of flat-coloured faces by axis, so that corners are visible.
const FLAT_SHADES: [f32; 3] = [0.84, 1.0, 0.7];

/// Radiance of an object's white surface facing the viewer, and the share of it at grazing angles.
const OBJECT_WHITE: f32 = 0.7;
const OBJECT_AMBIENT: f32 = 0.3;

/// Opacity of inferred surfaces in front of what is observed, and the number that a ray passes at most.
const INFERRED_OPACITY: f32 = 0.3;
const MAX_INFERRED: usize = 6;

/// Distance between a passed surface and the next search, metres.
const STEP_M: f32 = 1e-4;

/// Everything that a ray can hit.
pub(crate) struct RayCaster<'a> {
    pub scene: &'a LitScene,
    /// Faces of the room, two triangles each, and their leaves.
    pub faces: &'a PreparedModel,
    pub leaves: &'a [LeafNode],
    pub depth_range_m: DepthRange,
    pub objects: &'a [PlacedModel<'a>],
    /// Overlay to show instead of radiance.
    pub show: Option<Overlay>,
    /// Exposure, stops.
    pub exposure_ev: f32,
    /// Distance between the rays of neighbouring pixels at one metre, metres.
    pub pitch: f32,
}

impl RayCaster<'_> {
    /// Returns the colour seen along a ray. Inferred surfaces in front of observed ones and of objects are transparent.
    pub fn color(&self, ray: &Ray) -> [u8; 3] {
        let (inferred, observed) = self.hits(ray);
        // The surface lies anywhere within its leaf, so an object counts as hidden only behind the far side of the
        // leaf.
        let leaf_end_m = |hit: Hit| hit.distance_m + self.scene.light.cube.node_edge_m(self.leaf(hit).depth);
        let mut nearest_m = observed.map_or(f32::INFINITY, leaf_end_m);
        let mut object = None;
        for placed in self.objects {
            if let Some(hit) = placed.intersect(ray, nearest_m) {
                nearest_m = hit.distance_m;
                object = Some((placed, hit));
            }
        }
        let behind = match (object, observed) {
            (Some((placed, hit)), _) => self.object_color(placed, ray, &hit),
            (None, Some(hit)) => self.face_color(ray, hit),
            (None, None) => return inferred.first().map_or(BACKGROUND, |&hit| self.face_color(ray, hit)),
        };
        let in_front = inferred.into_iter().rev().filter(|&hit| object.is_none() || leaf_end_m(hit) < nearest_m);
        in_front.fold(behind, |behind, hit| mixed(behind, self.face_color(ray, hit), INFERRED_OPACITY))
    }

    /// Returns the inferred faces that a ray meets, nearest first, and the observed one behind them.
    fn hits(&self, ray: &Ray) -> (Vec<Hit>, Option<Hit>) {
        let (mut inferred, mut from_m) = (Vec::new(), 0.0);
        while inferred.len() < MAX_INFERRED {
            let rest = Ray { origin: ray.at(from_m), direction: ray.direction };
            let Some(hit) = self.faces.intersect(&rest, f32::INFINITY) else { return (inferred, None) };
            let hit = Hit { distance_m: hit.distance_m + from_m, ..hit };
            let LeafNode { depth, row, .. } = *self.leaf(hit);
            if origin_of_leaf(self.scene, depth, row) != RadianceOrigin::Inferred {
                return (inferred, Some(hit));
            }
            from_m = hit.distance_m + STEP_M;
            inferred.push(hit);
        }
        (inferred, None)
    }

    fn leaf(&self, hit: Hit) -> &LeafNode {
        &self.leaves[hit.triangle as usize / 2]
    }

    fn object_color(&self, placed: &PlacedModel, ray: &Ray, hit: &Hit) -> [u8; 3] {
        let surface = placed.surface(hit, ray.direction, self.pitch * hit.distance_m);
        match self.show {
            Some(Overlay::Normals) => normal_color(surface.shading_normal),
            Some(Overlay::Depth) => self.depth_color(ray, hit.distance_m),
            _ => {
                let facing = surface.shading_normal.dot(-ray.direction).max(0.0);
                let light = OBJECT_WHITE * (OBJECT_AMBIENT + (1.0 - OBJECT_AMBIENT) * facing);
                let lit = Vec3::from(surface.base_color) * light + Vec3::from(surface.emissive);
                self.developed(lit.to_array())
            }
        }
    }

    fn face_color(&self, ray: &Ray, hit: Hit) -> [u8; 3] {
        let LeafNode { depth, row, .. } = *self.leaf(hit);
        match self.show {
            None => {
                let [r, g, b, _] = self.scene.light.rgba[depth as usize][row];
                self.developed([r, g, b])
            }
            Some(Overlay::Normals) => normal_color(self.normal(hit.triangle)),
            Some(Overlay::Depth) => self.depth_color(ray, hit.distance_m),
            Some(Overlay::Levels) => self.flat(level_color(depth), hit.triangle),
            Some(Overlay::Provenance) => self.flat(origin_color(origin_of_leaf(self.scene, depth, row)), hit.triangle),
        }
    }

    fn developed(&self, radiance: [f32; 3]) -> [u8; 3] {
        let gain = self.exposure_ev.exp2();
        ToneCurve::Clip.apply(radiance.map(|value| value * gain)).map(imaging::srgb8_from_linear)
    }

    fn depth_color(&self, ray: &Ray, distance_m: f32) -> [u8; 3] {
        self.depth_range_m.color(-ray.at(distance_m).z)
    }

    fn normal(&self, triangle: u32) -> Vec3 {
        let model = self.faces.model();
        let [a, b, c] = model.triangles[triangle as usize].map(|corner| model.positions[corner as usize]);
        (b - a).cross(c - a).normalize_or_zero()
    }

    fn flat(&self, color: [u8; 3], triangle: u32) -> [u8; 3] {
        let normal = self.normal(triangle).abs();
        let shade = normal.dot(Vec3::from(FLAT_SHADES));
        color.map(|code| (f32::from(code) * shade) as u8)
    }
}

/// Blends a colour over another one.
fn mixed(behind: [u8; 3], before: [u8; 3], opacity: f32) -> [u8; 3] {
    std::array::from_fn(|c| (f32::from(before[c]) * opacity + f32::from(behind[c]) * (1.0 - opacity)).round() as u8)
}
