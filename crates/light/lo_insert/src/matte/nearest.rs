/// Returns for each pixel of a grid the index of the nearest seed and the distance to it in pixels; `None` without
/// seeds.
///
/// Two sweeps with eight neighbours (Danielsson 1980): exact except for rare pixels with an error of a fraction of a
/// pixel.
pub(crate) fn nearest_seeds(width: usize, height: usize, is_seed: impl Fn(usize) -> bool) -> Vec<Option<(usize, f32)>> {
    let mut nearest: Vec<Option<(usize, f32)>> = (0..width * height).map(|i| is_seed(i).then_some((i, 0.0))).collect();
    let mut relax = |x: usize, y: usize, dx: isize, dy: isize| {
        let (Some(px), Some(py)) = (x.checked_add_signed(dx), y.checked_add_signed(dy)) else { return };
        if px >= width || py >= height {
            return;
        }
        let Some((seed, _)) = nearest[py * width + px] else { return };
        let distance = ((seed % width) as f32 - x as f32).hypot((seed / width) as f32 - y as f32);
        let own = &mut nearest[y * width + x];
        if own.is_none_or(|(_, known)| distance < known) {
            *own = Some((seed, distance));
        }
    };
    for y in 0..height {
        for x in 0..width {
            [(-1, 0), (-1, -1), (0, -1), (1, -1)].into_iter().for_each(|(dx, dy)| relax(x, y, dx, dy));
        }
        (0..width).rev().for_each(|x| relax(x, y, 1, 0));
    }
    for y in (0..height).rev() {
        for x in (0..width).rev() {
            [(1, 0), (1, 1), (0, 1), (-1, 1)].into_iter().for_each(|(dx, dy)| relax(x, y, dx, dy));
        }
        (0..width).for_each(|x| relax(x, y, -1, 0));
    }
    nearest
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn distances_are_those_of_a_search() {
        let (width, height) = (37, 23);
        let seeds = [5 * width + 4, 5 * width + 30, 20 * width + 11, 22 * width + 36, 0];
        let found = nearest_seeds(width, height, |i| seeds.contains(&i));
        for (i, found) in found.into_iter().enumerate() {
            let to = |seed: usize| {
                ((seed % width) as f32 - (i % width) as f32).hypot((seed / width) as f32 - (i / width) as f32)
            };
            let expected = seeds.iter().map(|&seed| to(seed)).fold(f32::INFINITY, f32::min);
            let (seed, distance) = found.unwrap();
            assert!((to(seed) - distance).abs() < 1e-5 && distance - expected < 0.1, "{i}: {distance} for {expected}");
        }
        assert!(nearest_seeds(3, 2, |_| false).iter().all(Option::is_none));
    }
}
