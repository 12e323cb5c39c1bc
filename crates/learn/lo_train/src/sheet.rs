//! The picture that shows how far the networks are.

use lo_geometry::Vec3;
use lo_imaging::{
    DepthMap, Image, RadianceImage, ToneCurve, contact_sheet, photo_tile, resize, resize_equirectangular,
};
use lo_octree::LightOctree;

/// Height of a row in pixels; panoramas are twice as wide, cuts as wide.
const TILE: usize = 140;
const GAP: usize = 4;

/// A horizontal cut shows the octree this far below the camera, in metres: through furniture and windows.
const CUT_BELOW_M: f32 = 0.4;

/// Depths from black to white in metres, on a logarithmic scale.
const DEPTHS_M: [f32; 2] = [12.0, 0.5];

/// What is shown of one photo; pairs are of prediction and truth.
pub(crate) struct Row {
    pub photo: Image<[u8; 3]>,
    pub panoramas: [RadianceImage; 2],
    pub depths_m: [DepthMap; 2],
    pub octrees: Option<[LightOctree; 2]>,
}

/// Row by row: photo; predicted and true panorama; predicted and true depth; cuts through the predicted and the true octree.
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
    tiles.extend(row.octrees.iter().flatten().map(cut));
    tiles
}

/// What a plane below the camera cuts of an octree, seen from above, the camera's forward upwards.
fn cut(light: &LightOctree) -> Image<[u8; 3]> {
    let (cube, depth) = (light.cube, light.octree.depth());
    let at = |pixel: usize| (pixel as f32 + 0.5) / TILE as f32 * cube.edge_m;
    let radiance = RadianceImage::from_fn(TILE, TILE, |x, z| {
        let point = cube.origin_m + Vec3::new(at(x), 0.0, at(z));
        let found = light.locate(Vec3::new(point.x, -CUT_BELOW_M, point.z), depth);
        let found = found.and_then(|(depth, node)| light.node_rgba(depth, node));
        found.map_or([0.0; 3], |[r, g, b, alpha]| [r, g, b].map(|c| alpha * (c + 0.02)))
    });
    ToneCurve::Reinhard.map(&radiance, 0.0)
}
