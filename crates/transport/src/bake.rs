//! The exchange of diffuse light between surfels: one pass of rays tells who sees whom, then light is passed on along these
//! links until nothing changes.

use std::f32::consts::PI;

use geometry::{Ray, Vec3, cosine_hemisphere, orthonormal_basis};
use mesh::{Hit, offset_origin};
use rayon::prelude::*;

use crate::BakeSettings;
use crate::lighting::{Lighting, Part, Surfaces, limited};
use crate::lights::{Emitters, luminance};
use crate::pattern::{Rotations, shifted};
use crate::places::Place;
use crate::reach;
use crate::scene::Scene;
use crate::surfels::Surfels;
use crate::transfer;

/// Most mirrors and panes on the way of a gather ray.
const MOST_MIRRORS: u32 = 8;

/// Lamps in mirrors are no brighter to the cache than this many times the mean irradiance: few rays find them.
const MOST_MIRRORED: f64 = 1.0;

/// Times that indirect light is averaged over neighbours: what is left of the noise of single rays.
const SMOOTHING: usize = 4;

/// Passes that take out single bright and dark surfels; more of them close larger holes.
const DESPECKLING: usize = 3;

/// Rays per surfel of the first estimate.
const FIRST_RAYS: usize = 16;

/// Surfaces brighter than this many times the geometric mean are sampled like lamps in the exchange.
const BRIGHT: f32 = 12.0;

/// A gap narrower than this share of the spacing cannot be looked into.
const BURIED_SHARE: f32 = 0.25;

/// Longest edge of a piece of a glowing sheet.
const SHEET_PIECE_M: f32 = 0.15;

/// Light at the surfels and what it was sampled from.
pub(crate) struct Cache {
    pub surfels: Surfels,
    pub lighting: Lighting<'static>,
    /// Irradiance by lamps, portals, sun and glowing sheets.
    pub direct: Vec<Vec3>,
    /// Irradiance by everything else.
    pub indirect: Vec<Vec3>,
    /// Irradiance on the other side of the sheet; zero where nothing shines through.
    pub behind: Vec<Vec3>,
    parts: Vec<Part>,
    first_part: Vec<u32>,
}

/// What the rays of a surfel found.
#[derive(Default)]
struct Row {
    /// Irradiance by lamps and glowing sheets, as far as light samples leave it to gather rays.
    lamps: Vec3,
    /// Irradiance by what is neither sampled as a light nor a surfel, and corrections for bright surfaces.
    light: Vec3,
    /// Irradiance by lamps in mirrors, up to a limit per ray.
    mirrored: Vec3,
    /// What went beyond that limit.
    excess: Vec3,
    /// Rays that left by no portal.
    escaped: u32,
    /// Rays that ended so near that the place cannot be seen.
    blocked: u32,
    /// Surfels hit directly.
    links: Vec<u32>,
    /// Surfels hit by way of mirrors and panes, with what these leave.
    tinted: Vec<(u32, Vec3)>,
}

impl Row {
    fn add_mirrored(&mut self, light: Vec3, most: f32) {
        let kept = limited(light, most);
        self.mirrored += kept;
        self.excess += light - kept;
    }
}

/// What sampling a surfel's direct light left behind.
struct Lit {
    direct: Vec3,
    sun: Vec3,
    parts: Vec<Part>,
}

/// Surfaces so bright by direct light that they are sampled like lamps, and how they were at a surfel.
struct Bright<'a> {
    lighting: &'a Lighting<'a>,
    parts: &'a [Part],
}

struct Baker<'a> {
    scene: &'a Scene,
    settings: &'a BakeSettings,
    rotations: Rotations,
    pattern: Vec<Vec3>,
}

impl Cache {
    pub(crate) fn bake(scene: &Scene, settings: &BakeSettings) -> Result<Self, crate::TransportError> {
        let mut surfels = Surfels::spread(scene, settings.spacing_m)?;
        let baker = Baker {
            scene,
            settings,
            rotations: Rotations::new("transport cache", settings.seed),
            pattern: cosine_hemisphere(settings.gather_rays as usize),
        };
        let mut lighting = Lighting::new(Emitters::new(scene));
        let others = baker.other_sides(&surfels);
        surfels.retain(&reach::reached(scene, &surfels, &lighting.emitters, &others));
        let others = baker.other_sides(&surfels);
        // Sheets lit from behind become lights themselves.
        let glow = baker.glow(&surfels, &lighting, &others);
        if let Some(glow) = &glow {
            let mut emitters = lighting.emitters;
            baker.push_sheets(&surfels, glow, &mut emitters);
            lighting = Lighting::new(emitters);
        }
        let lit: Vec<Lit> =
            (0..surfels.list.len()).into_par_iter().map(|i| baker.light(&surfels, &lighting, i)).collect();
        // A first estimate tells which surfaces are so bright that few rays would find them.
        let coarse = Baker { pattern: cosine_hemisphere(FIRST_RAYS), ..baker };
        let dark = Lighting::new(Emitters::none(scene));
        let rows = coarse.smoothed(&surfels, coarse.gather(&surfels, &lighting, &dark, &lit));
        let direct: Vec<Vec3> = lit.iter().zip(&rows).map(|(lit, row)| lit.direct + row.lamps + lit.sun).collect();
        let indirect = exchange(&surfels, &rows, &direct, &others, FIRST_RAYS as u32);
        let baker = Baker { pattern: cosine_hemisphere(settings.gather_rays as usize), ..coarse };
        let bright = baker.bright(&surfels, &lighting, &direct, &indirect, &others);
        let rows = baker.gather(&surfels, &lighting, &bright, &lit);
        let rows = baker.smoothed(&surfels, rows);
        let direct: Vec<Vec3> = lit.iter().zip(&rows).map(|(lit, row)| lit.direct + row.lamps + lit.sun).collect();
        // What lies in gaps too narrow to look into must not show beside them.
        let most = settings.gather_rays / 2;
        let open: Vec<bool> = rows.iter().map(|row| row.blocked <= most).collect();
        let mut indirect = exchange(&surfels, &rows, &direct, &others, settings.gather_rays);
        for _ in 0..DESPECKLING {
            despeckle(&surfels, &mut indirect);
        }
        for _ in 0..SMOOTHING {
            indirect = averaged(&surfels, |surfel| indirect[surfel]);
        }
        // Corrections for what is sampled leave less than nothing here and there.
        indirect.iter_mut().for_each(|light| *light = light.max(Vec3::ZERO));
        let behind = others
            .iter()
            .map(
                |&other| if other == u32::MAX { Vec3::ZERO } else { direct[other as usize] + indirect[other as usize] },
            )
            .collect();
        let mut cache = Self { surfels, lighting, direct, indirect, behind, parts: Vec::new(), first_part: vec![0] };
        for lit in lit {
            cache.parts.extend(lit.parts);
            cache.first_part.push(cache.parts.len() as u32);
        }
        if !scene.sky.portals.is_empty() {
            // What lies under the open sky must not show indoors, behind a thin wall.
            let outside: Vec<bool> = rows.iter().map(|row| row.escaped > settings.gather_rays / 5).collect();
            cache.surfels.set_outside(&outside);
        }
        cache.surfels.index(&open);
        Ok(cache)
    }

    /// Parts of the light at a surfel.
    pub(crate) fn parts(&self, surfel: u32) -> &[Part] {
        let at = surfel as usize;
        &self.parts[self.first_part[at] as usize..self.first_part[at + 1] as usize]
    }
}

impl Baker<'_> {
    /// For surfels of sheets that let diffuse light through, the surfel on the other side.
    fn other_sides(&self, surfels: &Surfels) -> Vec<u32> {
        let other = |surfel: &crate::surfels::Surfel| {
            if surfel.scatter.through == Vec3::ZERO {
                return u32::MAX;
            }
            surfels.near(surfel.position, -surfel.normal, surfel.part).best().unwrap_or(u32::MAX)
        };
        surfels.list.par_iter().map(other).collect()
    }

    fn light(&self, surfels: &Surfels, lighting: &Lighting, i: usize) -> Lit {
        let surfel = &surfels.list[i];
        let (rays, gather) = (self.settings.light_rays, self.settings.gather_rays);
        let rotation = self.rotations.of(i);
        let reach = self.settings.spacing_m;
        let light = lighting.direct(self.scene, surfel.position, surfel.normal, reach, rays, gather, rotation);
        Lit { direct: light.irradiance, sun: light.sun, parts: light.parts }
    }

    /// Radiance with which each surfel of a sheet glows from the direct light behind it; nothing where no sheet is.
    fn glow(&self, surfels: &Surfels, lighting: &Lighting, others: &[u32]) -> Option<Vec<Vec3>> {
        if others.iter().all(|&other| other == u32::MAX) {
            return None;
        }
        let glow = |(i, &other): (usize, &u32)| {
            if other == u32::MAX {
                return Vec3::ZERO;
            }
            let behind = &surfels.list[other as usize];
            let (rays, rotation) = (4 * self.settings.light_rays, self.rotations.of(i));
            let light = lighting.direct(self.scene, behind.position, behind.normal, 0.0, rays, 0, rotation);
            surfels.list[i].scatter.through * (light.irradiance + light.sun) / PI
        };
        Some(others.par_iter().enumerate().map(glow).collect())
    }

    fn push_sheets(&self, surfels: &Surfels, glow: &[Vec3], emitters: &mut Emitters) {
        let model = self.scene.prepared.model();
        for triangle in 0..model.triangles.len() as u32 {
            let material = &model.materials[model.triangle_materials[triangle as usize] as usize];
            if material.diffuse_transmission <= 0.0 || material.emissive != [0.0; 3] {
                continue;
            }
            let part = surfels.part(triangle);
            emitters.push_triangle(
                self.scene,
                triangle,
                SHEET_PIECE_M,
                |emitter, _| {
                    emitter.sheet = true;
                    let center = emitter.corner + (emitter.edges[0] + emitter.edges[1]) / 3.0;
                    emitter.radiance = [emitter.normal, -emitter.normal]
                        .map(|normal| surfels.near(center, normal, part).mean(|surfel| glow[surfel]));
                },
                false,
            );
        }
    }

    /// Surfaces much brighter than the rest: lit by the sun, near to a lamp, under the open sky. Few rays would find them.
    fn bright<'s>(
        &self,
        surfels: &'s Surfels,
        lighting: &Lighting,
        direct: &[Vec3],
        indirect: &[Vec3],
        others: &[u32],
    ) -> Lighting<'s> {
        let leaving: Vec<Vec3> =
            (0..surfels.list.len()).map(|i| leaving(surfels, direct, indirect, others, i)).collect();
        let lit = leaving.iter().map(|&l| luminance(l)).filter(|&l| l > 0.0);
        let (sum, count) = lit.fold((0.0, 0), |(sum, count), l| (sum + f64::from(l).ln(), count + 1));
        let least = (f64::from(BRIGHT) * (sum / f64::from(count.max(1))).exp()) as f32;
        let hot: Vec<bool> = leaving.iter().map(|&light| luminance(light) > least).collect();
        let emitters = self.bright_pieces(surfels, lighting, &leaving, &hot);
        Lighting { surfaces: Some(Surfaces { surfels, leaving }), ..Lighting::new(emitters) }
    }

    /// Pieces of triangles near hot surfels.
    fn bright_pieces(&self, surfels: &Surfels, lighting: &Lighting, leaving: &[Vec3], hot: &[bool]) -> Emitters {
        let triangles = self.scene.prepared.model().triangles.len();
        let mut wanted = vec![false; triangles];
        for (surfel, _) in surfels.list.iter().zip(hot).filter(|(_, hot)| **hot) {
            wanted[surfel.place.triangle as usize] = true;
        }
        // Triangles smaller than the spacing may have no surfel of their own.
        let center = |triangle: u32| Place::at(self.scene, triangle, [1.0 / 3.0; 2]);
        let hot_at = |place: &Place| {
            let surfel = surfels.nearest(place.position, place.normal, surfels.part(place.triangle));
            surfel.filter(|&surfel| hot[surfel as usize])
        };
        let mut emitters = Emitters::none(self.scene);
        let mut sums: Vec<[(Vec3, f32); 2]> = Vec::new();
        for triangle in (0..triangles as u32).filter(|&t| !lighting.emitters.holds(t) || self.scene.is_lamp(t)) {
            let sides = center(triangle).map(|sides| sides.map(|place| hot_at(&place)));
            let Some(sides) = sides.filter(|sides| wanted[triangle as usize] || *sides != [None; 2]) else { continue };
            emitters.push_triangle(
                self.scene,
                triangle,
                SHEET_PIECE_M,
                |emitter, _| {
                    emitter.radiance = [Vec3::ONE; 2];
                },
                false,
            );
            sums.resize(emitters.list.len(), [(Vec3::ZERO, 0.0); 2]);
            let middle = Hit { distance_m: 0.0, triangle, barycentric: [1.0 / 3.0; 2] };
            if let Some(piece) = emitters.of(&middle) {
                for (sum, surfel) in sums[piece as usize].iter_mut().zip(sides) {
                    let light = surfel.map_or(Vec3::ZERO, |surfel| leaving[surfel as usize]);
                    *sum = (sum.0 + light, sum.1 + f32::from(u8::from(surfel.is_some())));
                }
            }
        }
        for (i, surfel) in surfels.list.iter().enumerate().filter(|(i, _)| hot[*i]) {
            for place in surfel.place.around(self.scene, 0.6 * self.settings.spacing_m) {
                let hit = Hit { distance_m: 0.0, triangle: place.triangle, barycentric: place.barycentric };
                let Some(piece) = emitters.of(&hit) else { continue };
                let back = emitters.list[piece as usize].normal.dot(surfel.normal) < 0.0;
                let sum = &mut sums[piece as usize][usize::from(back)];
                *sum = (sum.0 + leaving[i], sum.1 + 1.0);
            }
        }
        for (emitter, sums) in emitters.list.iter_mut().zip(sums) {
            emitter.radiance = sums.map(|(sum, count)| sum / count.max(1.0));
        }
        emitters
    }

    /// Spreads the light of mirrored lamps, which few rays find, over neighbours.
    fn smoothed(&self, surfels: &Surfels, mut rows: Vec<Row>) -> Vec<Row> {
        const PASSES: usize = 6;
        if rows.iter().all(|row| row.mirrored == Vec3::ZERO && row.excess == Vec3::ZERO) {
            return rows;
        }
        for _ in 0..PASSES {
            let next = averaged(surfels, |surfel| rows[surfel].mirrored);
            rows.iter_mut().zip(next).for_each(|(row, mirrored)| row.mirrored = mirrored);
        }
        // What few rays found is spread over all surfaces that face the same way.
        let mut sums = [(Vec3::ZERO, 0.0_f32); 6];
        for (surfel, row) in surfels.list.iter().zip(&rows) {
            let sum = &mut sums[surfel.face()];
            *sum = (sum.0 + row.excess, sum.1 + 1.0);
        }
        for (surfel, row) in surfels.list.iter().zip(&mut rows) {
            let (sum, count) = sums[surfel.face()];
            row.light += row.mirrored + sum / count;
        }
        rows
    }

    /// What the rays of all surfels find.
    fn gather(&self, surfels: &Surfels, lighting: &Lighting, bright: &Lighting, lit: &[Lit]) -> Vec<Row> {
        // Mirrored lamps are limited by what matte surfaces get on average.
        let sum: f64 = lit.iter().map(|lit| f64::from(luminance(lit.direct + lit.sun))).sum();
        let most = (MOST_MIRRORED * sum / lit.len().max(1) as f64) as f32;
        (0..lit.len()).into_par_iter().map(|i| self.row(surfels, lighting, bright, &lit[i].parts, i, most)).collect()
    }

    fn row(
        &self,
        surfels: &Surfels,
        lighting: &Lighting,
        bright: &Lighting,
        parts: &[Part],
        i: usize,
        most: f32,
    ) -> Row {
        let surfel = &surfels.list[i];
        let rotation = self.rotations.of(i);
        let turn = geometry::Mat3::from_rotation_z(std::f32::consts::TAU * rotation[3]);
        let basis = orthonormal_basis(surfel.normal) * turn;
        let origin = offset_origin(surfel.position, surfel.normal);
        let (rays, gather) = (self.settings.light_rays, self.settings.gather_rays);
        let reach = self.settings.spacing_m;
        let lit = bright.direct(self.scene, surfel.position, surfel.normal, reach, rays, gather, rotation);
        let (bright, sampled) = (Bright { lighting: bright, parts: &lit.parts }, &lit);
        let mut row = Row { links: Vec::with_capacity(self.pattern.len()), ..Row::default() };
        for (k, &local) in self.pattern.iter().enumerate() {
            let ray = Ray { origin, direction: basis * local };
            let dice = shifted(k as f32 * 0.618_034 % 1.0, rotation[0]);
            self.follow(surfels, lighting, parts, &bright, surfel.normal, ray, local.z / PI, dice, most, &mut row);
        }
        row.light *= PI / self.pattern.len() as f32;
        row.light += sampled.irradiance;
        row.mirrored *= PI / self.pattern.len() as f32;
        row.excess *= PI / self.pattern.len() as f32;
        row.lamps *= PI / self.pattern.len() as f32;
        row
    }

    #[expect(clippy::too_many_arguments, reason = "the state of one ray")]
    fn follow(
        &self,
        surfels: &Surfels,
        lighting: &Lighting,
        parts: &[Part],
        bright: &Bright,
        normal: Vec3,
        mut ray: Ray,
        density: f32,
        mut dice: f32,
        most: f32,
        row: &mut Row,
    ) {
        let start = ray;
        let mut run = ray;
        let (mut tint, mut straight) = (Vec3::ONE, true);
        for _ in 0..MOST_MIRRORS {
            let Some(hit) = self.scene.hit(&ray) else {
                let sky = &self.scene.sky;
                let light = tint * sky.radiance(ray.direction);
                if !straight {
                    if sky.is_open(&run, self.scene.far_m) {
                        row.add_mirrored(light, most);
                    }
                } else if !sky.leaves_by_portal(&start, self.scene.far_m) {
                    row.escaped += 1;
                    if sky.portals.is_empty() {
                        row.light += light;
                    }
                }
                return;
            };
            row.blocked += u32::from(straight && hit.distance_m < BURIED_SHARE * self.settings.spacing_m);
            let surface = self.scene.surface(&hit, &ray, 0.0);
            let offset = surface.position - start.origin;
            let sr_per_m2 = surface.geometric_normal.dot(ray.direction).abs() / offset.length_squared().max(1e-12);
            // Share of the light of an emitter that gather rays answer for; the rest is light samples'.
            let share = |lighting: &Lighting, parts: &[Part], emitter: u32| {
                let other = lighting.density(parts, emitter, start.origin, normal, sr_per_m2.max(1e-9));
                let own = self.pattern.len() as f32 * density;
                own / (own + other)
            };
            let emitter = lighting.emitters.of(&hit);
            if surface.emission != Vec3::ZERO {
                match emitter {
                    Some(emitter) if straight => row.lamps += tint * surface.emission * share(lighting, parts, emitter),
                    None if straight => row.light += tint * surface.emission,
                    _ => row.add_mirrored(tint * surface.emission, most),
                }
            } else if let Some(emitter) = emitter.filter(|_| straight) {
                // A sheet lit from behind: its light, which the surfel there has too, counts as a lamp's.
                let light = lighting.emitters.radiance(emitter, surface.geometric_normal);
                row.lamps += tint * light * share(lighting, parts, emitter);
                row.light -= tint * light;
            }
            if let Some(emitter) = bright.lighting.emitters.of(&hit).filter(|_| straight) {
                let normal = surface.geometric_normal;
                let shines = bright.lighting.emitters.radiance(emitter, normal) != Vec3::ZERO;
                let surfaces = bright.lighting.surfaces.as_ref().filter(|_| shines);
                let light = surfaces.map_or(Vec3::ZERO, |s| s.radiance(surface.position, normal, hit.triangle));
                row.light += tint * light * (share(bright.lighting, bright.parts, emitter) - 1.0);
            }
            let [pass, mirror] = transfer::rays(&surface);
            if pass == Vec3::ZERO && mirror == Vec3::ZERO {
                return self.link(surfels, &surface, tint, row);
            }
            // One way is chosen by its share.
            let rest = surface.diffuse.max_element() + surface.through.max_element();
            let shares = [pass.max_element(), mirror.max_element(), rest];
            let sum: f32 = shares.iter().sum();
            if sum <= 0.0 {
                return;
            }
            dice *= sum;
            if dice < shares[0] {
                dice /= shares[0];
                tint *= pass * (sum / shares[0]);
                ray = surface.ray(ray.direction);
            } else if dice < shares[0] + shares[1] {
                dice = (dice - shares[0]) / shares[1];
                tint *= mirror * (sum / shares[1]);
                ray = surface.ray(surface.mirrored());
                run = ray;
                straight = false;
            } else {
                return self.link(surfels, &surface, tint * (sum / rest), row);
            }
            dice = dice.clamp(0.0, 1.0 - f32::EPSILON);
        }
    }

    fn link(&self, surfels: &Surfels, surface: &crate::scene::Surface, tint: Vec3, row: &mut Row) {
        let part = surfels.part(surface.triangle);
        if let Some(surfel) = surfels.nearest(surface.position, surface.geometric_normal, part) {
            if tint == Vec3::ONE { row.links.push(surfel) } else { row.tinted.push((surfel, tint)) }
        }
    }
}

/// Passes light along the links until nothing changes; irradiance without direct light.
fn exchange(surfels: &Surfels, rows: &[Row], direct: &[Vec3], others: &[u32], gather_rays: u32) -> Vec<Vec3> {
    const MOST_BOUNCES: usize = 400;
    let mut indirect: Vec<Vec3> = rows.iter().map(|row| row.light).collect();
    let mut leaving = vec![Vec3::ZERO; rows.len()];
    for _ in 0..MOST_BOUNCES {
        leaving.par_iter_mut().enumerate().for_each(|(i, light)| {
            *light = self::leaving(surfels, direct, &indirect, others, i);
        });
        let arriving = |row: &Row| {
            let seen: Vec3 = row.links.iter().map(|&surfel| leaving[surfel as usize]).sum();
            let mirrored: Vec3 = row.tinted.iter().map(|&(surfel, tint)| leaving[surfel as usize] * tint).sum();
            row.light + (seen + mirrored) * (PI / gather_rays as f32)
        };
        let next: Vec<Vec3> = rows.par_iter().map(arriving).collect();
        let sum = |values: &[Vec3]| values.iter().map(|v| f64::from(v.element_sum())).sum::<f64>();
        let (before, after) = (sum(&indirect), sum(&next));
        indirect = next;
        if (after - before).abs() <= 2e-4 * after.abs() {
            break;
        }
    }
    indirect
}

/// The mean of a value over the neighbourhood of each surfel.
/// Takes from surfels that are far brighter than all around them what one lucky ray found, and gives to those that are far darker
/// what a correction took too much.
fn despeckle(surfels: &Surfels, indirect: &mut [Vec3]) {
    /// Real light from elsewhere changes by less from surfel to surfel.
    const MOST: f32 = 3.0;
    let corrected: Vec<Vec3> = surfels
        .list
        .par_iter()
        .enumerate()
        .map(|(i, surfel)| {
            let near = surfels.near(surfel.position, surfel.normal, surfel.part);
            let others = near.as_slice().iter().filter(|(other, _)| *other as usize != i);
            let (sum, count) = others.fold((Vec3::ZERO, 0), |(sum, count), &(other, _)| {
                (sum + indirect[other as usize].max(Vec3::ZERO), count + 1)
            });
            if count < 2 {
                return indirect[i];
            }
            let around = sum / count as f32;
            if MOST * luminance(indirect[i]) < luminance(around) {
                around / MOST
            } else {
                limited(indirect[i], MOST * luminance(around))
            }
        })
        .collect();
    indirect.copy_from_slice(&corrected);
}

fn averaged(surfels: &Surfels, value: impl Fn(usize) -> Vec3 + Sync) -> Vec<Vec3> {
    surfels.list.par_iter().map(|s| surfels.near(s.position, s.normal, s.part).mean(&value)).collect()
}

/// Radiance leaving a surfel.
fn leaving(surfels: &Surfels, direct: &[Vec3], indirect: &[Vec3], others: &[u32], i: usize) -> Vec3 {
    let scatter = &surfels.list[i].scatter;
    let own = (direct[i] + indirect[i]) * scatter.same_side;
    let other = others[i] as usize;
    let behind = if others[i] == u32::MAX { Vec3::ZERO } else { direct[other] + indirect[other] };
    (own + behind * scatter.through) / PI
}
