//! Upper levels of a lighting octree from its leaves.

use rayon::prelude::*;

/// Colour, opacity and seen share of the rows of one level, from those of the level below.
///
/// `child_keys` are the strictly increasing keys of the non-empty nodes below. Returns one row per distinct parent, in order.
pub(crate) fn parents_from_children(
    child_keys: &[u32],
    rgba: &[[f32; 4]],
    seen: &[u8],
) -> (Vec<u32>, Vec<[f32; 4]>, Vec<u8>) {
    let families: Vec<&[u32]> = child_keys.chunk_by(|a, b| a >> 3 == b >> 3).collect();
    let firsts: Vec<usize> = families
        .iter()
        .scan(0, |next, family| {
            let first = *next;
            *next += family.len();
            Some(first)
        })
        .collect();
    let rows: Vec<([f32; 4], u8)> = families
        .par_iter()
        .zip(&firsts)
        .with_min_len(1024)
        .map(|(family, &first)| {
            let range = first..first + family.len();
            (merged(family, &rgba[range.clone()]), mean_share(&seen[range]))
        })
        .collect();
    let keys = families.iter().map(|family| family[0] >> 3).collect();
    let (rgba, seen) = rows.into_iter().unzip();
    (keys, rgba, seen)
}

/// Mean share of the children, rounded.
fn mean_share(seen: &[u8]) -> u8 {
    let sum: usize = seen.iter().map(|&share| usize::from(share)).sum();
    ((sum + seen.len() / 2) / seen.len()) as u8
}

/// Premultiplied mean colour and crossing opacity of up to eight children with the keys `family`.
fn merged(family: &[u32], rgba: &[[f32; 4]]) -> [f32; 4] {
    let mut alpha = [0.0f32; 8];
    let mut sum = [0.0f64; 3];
    let mut plain_sum = [0.0f64; 3];
    let mut weight = 0.0;
    for (key, child) in family.iter().zip(rgba) {
        alpha[(key & 7) as usize] = child[3];
        let a = f64::from(child[3]);
        weight += a;
        for c in 0..3 {
            sum[c] += a * f64::from(child[c]);
            plain_sum[c] += f64::from(child[c]);
        }
    }
    // Invisible children keep their colour: a network may still make them visible.
    let [r, g, b] = if weight > 0.0 {
        sum.map(|total| (total / weight) as f32)
    } else {
        plain_sum.map(|total| (total / family.len() as f64) as f32)
    };
    [r, g, b, crossing_opacity(&alpha)]
}

/// Opacity of crossing a node whose children (in key order) have these opacities.
///
/// Along one axis it is the mean over the four columns of two children of `1 − (1 − α₁)(1 − α₂)`; the greatest of the three
/// axes counts. The mean of the children, or of the axes, makes a wall one leaf thick transparent from afar.
pub(crate) fn crossing_opacity(alpha: &[f32; 8]) -> f32 {
    [4, 2, 1]
        .map(|step| {
            let columns = (0..8).filter(|child| child & step == 0);
            let sum: f32 = columns.map(|near| 1.0 - (1.0 - alpha[near]) * (1.0 - alpha[near | step])).sum();
            0.25 * sum
        })
        .into_iter()
        .fold(0.0, f32::max)
}
