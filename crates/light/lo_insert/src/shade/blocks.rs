//! Light shared by neighbouring pixels.
//!
//! Light is gathered at one fragment of each surface in each block of pixels, on the photo's own grid. It is
//! interpolated between these sources, only along one surface (irradiance caching, Ward 1988, on a fixed grid).

use lo_geometry::Vec3;

use crate::light::gather::Gathered;
use crate::shade::fragment_material::FragmentMaterial;
use crate::shade::visibility::Fragment;

const NONE: u32 = u32::MAX;

/// Source fragments by blocks of pixels.
pub(crate) struct Blocks {
    /// Side of a block in pixels; with 1, every fragment is a source.
    stride: usize,
    /// Fragments at which light is gathered.
    pub sources: Vec<usize>,
    first_block: (usize, usize),
    columns: usize,
    rows: usize,
    /// For each block its last source, and for each source the previous one in its block.
    last: Vec<u32>,
    before: Vec<u32>,
}

/// Light at a fragment.
pub(crate) struct FragmentLight {
    pub irradiance: Vec3,
    /// See [`Gathered::highlights`].
    pub highlights: Vec3,
    /// Mean radiance over the specular reflection.
    pub reflected: Vec3,
}

impl Blocks {
    pub fn new(fragments: &[Fragment], materials: &[FragmentMaterial], stride: usize) -> Self {
        let block = |f: &Fragment| (f.pixel.0 / stride, f.pixel.1 / stride);
        if stride == 1 || fragments.is_empty() {
            let sources = (0..fragments.len()).collect();
            return Self { stride, sources, first_block: (0, 0), columns: 0, rows: 0, last: vec![], before: vec![] };
        }
        let (mut low, mut high) = ((usize::MAX, usize::MAX), (0, 0));
        for (column, row) in fragments.iter().map(block) {
            low = (low.0.min(column), low.1.min(row));
            high = (high.0.max(column), high.1.max(row));
        }
        let (columns, rows) = (high.0 - low.0 + 1, high.1 - low.1 + 1);
        let last = vec![NONE; columns * rows];
        let mut blocks = Self { stride, sources: vec![], first_block: low, columns, rows, last, before: vec![] };
        for (i, fragment) in fragments.iter().enumerate() {
            let (column, row) = block(fragment);
            let index = (row - low.1) * columns + column - low.0;
            let found = blocks.chain(blocks.last[index]).any(|slot| {
                let source = blocks.sources[slot];
                materials[source].is_like(&materials[i]) && blocks.on_same_surface(&fragments[source], fragment)
            });
            if !found {
                blocks.before.push(blocks.last[index]);
                blocks.last[index] = blocks.sources.len() as u32;
                blocks.sources.push(i);
            }
        }
        blocks
    }

    /// Returns the light at fragment `index`, from the light gathered at the sources and the reflections of fragments
    /// with their own.
    pub fn light_of(
        &self,
        index: usize,
        fragments: &[Fragment],
        materials: &[FragmentMaterial],
        gathered: &[Gathered],
        reflected: &[Vec3],
    ) -> FragmentLight {
        if self.stride == 1 {
            let own = &gathered[index];
            return FragmentLight {
                irradiance: own.irradiance,
                highlights: own.highlights,
                reflected: reflected[index],
            };
        }
        if !materials[index].gathers() && !materials[index].shares_reflection {
            return FragmentLight { irradiance: Vec3::ZERO, highlights: Vec3::ZERO, reflected: reflected[index] };
        }
        let fragment = &fragments[index];
        let per_pixel = 1.0 / (1.5 * self.stride as f32);
        let mut sum = FragmentLight { irradiance: Vec3::ZERO, highlights: Vec3::ZERO, reflected: Vec3::ZERO };
        let mut total = 0.0;
        let (column, row) = (fragment.pixel.0 / self.stride, fragment.pixel.1 / self.stride);
        let (column, row) = (column - self.first_block.0, row - self.first_block.1);
        for row in row.saturating_sub(1)..(row + 2).min(self.rows) {
            for column in column.saturating_sub(1)..(column + 2).min(self.columns) {
                for slot in self.chain(self.last[row * self.columns + column]) {
                    let source = self.sources[slot];
                    let other = &fragments[source];
                    let offset = |a: usize, b: usize| a.abs_diff(b) as f32 * per_pixel;
                    let weight = (1.0 - offset(other.pixel.0, fragment.pixel.0)).max(0.0)
                        * (1.0 - offset(other.pixel.1, fragment.pixel.1)).max(0.0);
                    if weight <= 0.0 {
                        continue;
                    }
                    let alike = source == index
                        || (!other.point.unlit
                            && materials[source].is_like(&materials[index])
                            && self.on_same_surface(other, fragment));
                    if !alike {
                        continue;
                    }
                    let light = &gathered[slot];
                    let (from, to) = (other.point.shading_normal, fragment.point.shading_normal);
                    sum.irradiance += light.irradiance_for(from, to) * weight;
                    sum.highlights += light.highlights * weight;
                    sum.reflected += reflected[source] * weight;
                    total += weight;
                }
            }
        }
        // The block's own source is less than a block away, so there is always one.
        let scale = if total > 0.0 { 1.0 / total } else { 0.0 };
        let shared = materials[index].shares_reflection;
        FragmentLight {
            irradiance: sum.irradiance * scale,
            highlights: sum.highlights * scale,
            reflected: if shared { sum.reflected * scale } else { reflected[index] },
        }
    }

    fn chain(&self, last: u32) -> impl Iterator<Item = usize> {
        let slot = |slot: u32| (slot != NONE).then_some(slot as usize);
        std::iter::successors(slot(last), move |&at| slot(self.before[at]))
    }

    /// Returns whether two fragments of neighbouring pixels receive about equal light; larger blocks allow larger
    /// distances.
    fn on_same_surface(&self, a: &Fragment, b: &Fragment) -> bool {
        let (near, far) = (a.point.position.z.abs(), b.point.position.z.abs());
        let least_cosine = if self.stride > 2 { 0.7 } else { 0.85 };
        a.object == b.object
            && a.point.unlit == b.point.unlit
            && a.point.geometric_normal.dot(b.point.geometric_normal) > least_cosine
            && (near - far).abs() < 0.02 * far
    }
}
