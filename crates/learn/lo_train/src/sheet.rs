//! Contact sheet of validation photos.

use lo_geometry::Vec3;
use lo_imaging::{
    DepthMap, Image, RadianceImage, ToneCurve, contact_sheet, photo_tile, resize, resize_equirectangular,
};
use lo_octree::LightOctree;

/// Height of a row in pixels. Panoramas are twice as wide, octree slices as wide.
const TILE: usize = 140;
const GAP: usize = 4;

/// Height of the octree slice below the camera, metres: through furniture and windows.
const SLICE_BELOW_M: f32 = 0.4;

/// Depths shown black and white, metres; logarithmic in between.
const DEPTHS_M: [f32; 2] = [12.0, 0.5];

/// Images of one photo; pairs are prediction and truth.
pub(crate) struct Row {
    pub photo: Image<[u8; 3]>,
    pub panoramas: [RadianceImage; 2],
    pub depths_m: [DepthMap; 2],
    pub octrees: Option<[LightOctree; 2]>,
}

/// Lays out one row per photo: the photo, then predicted and true panorama, depth and octree slice.
pub(crate) fn sheet(rows: &[Row]) -> Image<[u8; 3]> {
    let rows: Vec<Vec<Image<[u8; 3]>>> = rows.iter().map(tiles).collect();
    contact_sheet(&rows.iter().map(|row| &row[..]).collect::<Vec<_>>(), GAP)
}

fn tiles(row: &Row) -> Vec<Image<[u8; 3]>> {
    let width = |w: usize, h: usize| (TILE * w / h.max(1)).clamp(1, 4 * TILE);
    let photo = photo_tile(&row.photo, width(row.photo.width(), row.photo.height()), TILE);
    let panorama = |map: &RadianceImage| ToneCurve::Reinhard.map(&resize_equirectangular(map, 2 * TILE, TILE), 0.0);
    let depth = |map: &DepthMap| {
        let grey =
            map.map(|&z| [if z > 0.0 { (z / DEPTHS_M[0]).ln() / (DEPTHS_M[1] / DEPTHS_M[0]).ln() } else { 0.0 }; 3]);
        let grey = grey.map(|rgb| rgb.map(|v| v.clamp(0.0, 1.0)));
        resize(&grey, width(map.width(), map.height()), TILE).map(|rgb| rgb.map(|v| (255.0 * v).round() as u8))
    };
    let mut tiles = vec![photo];
    tiles.extend(row.panoramas.iter().map(panorama));
    tiles.extend(row.depths_m.iter().map(depth));
    tiles.extend(row.octrees.iter().flatten().map(slice));
    tiles
}

/// Renders a horizontal slice of an octree from above; the camera looks towards the top.
fn slice(light: &LightOctree) -> Image<[u8; 3]> {
    let (cube, depth) = (light.cube, light.octree.depth());
    let at = |pixel: usize| (pixel as f32 + 0.5) / TILE as f32 * cube.edge_m;
    let radiance = RadianceImage::from_fn(TILE, TILE, |x, z| {
        let point = cube.origin_m + Vec3::new(at(x), 0.0, at(z));
        let found = light.locate(Vec3::new(point.x, -SLICE_BELOW_M, point.z), depth);
        let found = found.and_then(|(depth, node)| light.node_rgba(depth, node));
        found.map_or([0.0; 3], |[r, g, b, alpha]| [r, g, b].map(|c| alpha * (c + 0.02)))
    });
    ToneCurve::Reinhard.map(&radiance, 0.0)
}
