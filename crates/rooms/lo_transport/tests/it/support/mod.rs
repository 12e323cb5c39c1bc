//! Test rooms, built triangle by triangle, and image comparison.
#![allow(dead_code)]

use lo_geometry::{Camera, Quat, Vec3};
use lo_imaging::{Image, RadianceImage};
use lo_mesh::{Material, Model};
use lo_transport::{Outdoors, Portal, Pose, Sun, View, World};

/// Builder of a triangle model.
pub struct Builder {
    pub model: Model,
}

impl Builder {
    pub fn new() -> Self {
        Self { model: Model::default() }
    }

    pub fn material(&mut self, material: Material) -> u32 {
        self.model.materials.push(material);
        self.model.materials.len() as u32 - 1
    }

    pub fn matte(&mut self, color: [f32; 3]) -> u32 {
        let [r, g, b] = color;
        self.material(Material { base_color: [r, g, b, 1.0], ..Material::default() })
    }

    pub fn lamp(&mut self, emissive: [f32; 3]) -> u32 {
        self.material(Material {
            base_color: [0.0, 0.0, 0.0, 1.0],
            emissive,
            double_sided: false,
            ..Material::default()
        })
    }

    /// Adds a parallelogram cut into `n` × `m` pieces. `a × b` points to its front.
    pub fn sheet(&mut self, corner: Vec3, a: Vec3, b: Vec3, [n, m]: [u32; 2], material: u32) {
        let first = self.model.positions.len() as u32;
        let normal = a.cross(b).normalize();
        for j in 0..=m {
            for i in 0..=n {
                self.model.positions.push(corner + a * (i as f32 / n as f32) + b * (j as f32 / m as f32));
                self.model.normals.push(normal);
            }
        }
        for j in 0..m {
            for i in 0..n {
                let at = first + j * (n + 1) + i;
                self.triangle([at, at + 1, at + n + 2], material);
                self.triangle([at, at + n + 2, at + n + 1], material);
            }
        }
    }

    fn triangle(&mut self, vertices: [u32; 3], material: u32) {
        self.model.triangles.push(vertices);
        self.model.triangle_materials.push(material);
    }

    /// Adds a solid box rotated about +Y, its front outside. Each face is cut into `n` × `n`.
    pub fn solid(&mut self, center: Vec3, size: Vec3, yaw_rad: f32, n: u32, material: u32) {
        let turn = Quat::from_rotation_y(yaw_rad);
        self.boxed(center, size, turn, [n; 3], material, 1.0);
    }

    /// Adds a room seen from inside. Each face is cut into `n` × `n`.
    pub fn room(&mut self, size: Vec3, n: u32, material: u32) {
        self.boxed(size * Vec3::new(0.0, 0.5, 0.0), size, Quat::IDENTITY, [n; 3], material, -1.0);
    }

    fn boxed(&mut self, center: Vec3, size: Vec3, turn: Quat, cuts: [u32; 3], material: u32, out: f32) {
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
                let unit = |k: usize| turn * (Vec3::AXES[k] * size[k]);
                let corner = center + unit(axis) * (0.5 * side) - unit(i) * 0.5 - unit(j) * 0.5;
                if side * out > 0.0 {
                    self.sheet(corner, unit(i), unit(j), [cuts[i], cuts[j]], material);
                } else {
                    self.sheet(corner, unit(j), unit(i), [cuts[j], cuts[i]], material);
                }
            }
        }
    }

    /// Adds a ball of 2 · `n`² faces.
    pub fn ball(&mut self, center: Vec3, radius: f32, n: u32, material: u32) {
        let first = self.model.positions.len() as u32;
        for j in 0..=n {
            for i in 0..=2 * n {
                let (phi, theta) =
                    (i as f32 / n as f32 * std::f32::consts::PI, j as f32 / n as f32 * std::f32::consts::PI);
                let normal = Vec3::new(theta.sin() * phi.sin(), theta.cos(), theta.sin() * phi.cos());
                self.model.positions.push(center + normal * radius);
                self.model.normals.push(normal);
            }
        }
        for j in 0..n {
            for i in 0..2 * n {
                let at = first + j * (2 * n + 1) + i;
                if j > 0 {
                    self.triangle([at, at + 2 * n + 2, at + 1], material);
                }
                if j + 1 < n {
                    self.triangle([at, at + 2 * n + 1, at + 2 * n + 2], material);
                }
            }
        }
    }

    /// Adds an open tube about +Y, its front outside, with the radii at the bottom and the top.
    pub fn tube(&mut self, base: Vec3, radii: [f32; 2], height: f32, n: u32, material: u32) {
        let first = self.model.positions.len() as u32;
        for j in 0..=4 {
            for i in 0..=n {
                let phi = i as f32 / n as f32 * std::f32::consts::TAU;
                let normal = Vec3::new(phi.sin(), 0.0, phi.cos());
                let t = j as f32 / 4.0;
                let radius = radii[0] + (radii[1] - radii[0]) * t;
                self.model.positions.push(base + normal * radius + Vec3::Y * (height * t));
                self.model.normals.push(normal);
            }
        }
        for j in 0..4 {
            for i in 0..n {
                let at = first + j * (n + 1) + i;
                self.triangle([at, at + 1, at + n + 2], material);
                self.triangle([at, at + n + 2, at + n + 1], material);
            }
        }
    }

    pub fn world(self, sky: [f32; 3], sun: Option<Sun>, portals: Vec<Portal>) -> World {
        let radiance = Image::new(4, 2, vec![sky; 8]);
        World { model: self.model, outdoors: Outdoors { radiance, sun }, portals }
    }
}

/// Returns a box of one colour in which every face emits the same radiance.
pub fn furnace(albedo: f32, emission: f32) -> World {
    let mut b = Builder::new();
    let wall = b.material(Material {
        base_color: [albedo, albedo, albedo, 1.0],
        emissive: [emission; 3],
        double_sided: false,
        ..Material::default()
    });
    b.room(Vec3::new(3.0, 2.4, 4.0), 4, wall);
    b.world([0.0; 3], None, Vec::new())
}

/// Returns a Cornell box 5.6 m wide: red and green walls, a panel in the ceiling, two blocks.
pub fn cornell() -> World {
    let mut b = Builder::new();
    let (white, red, green) = (b.matte([0.73; 3]), b.matte([0.63, 0.065, 0.05]), b.matte([0.14, 0.45, 0.09]));
    let lamp = b.lamp([17.0, 12.0, 4.0].map(|x| x * 0.6));
    let s = 2.8;
    let cuts = [8, 8];
    let corner = Vec3::new(-s, 0.0, -s);
    let (x, y, z) = (Vec3::X * 2.0 * s, Vec3::Y * 2.0 * s, Vec3::Z * 2.0 * s);
    b.sheet(corner, z, x, cuts, white);
    b.sheet(corner + y, x, z, cuts, white);
    b.sheet(corner, x, y, cuts, white);
    b.sheet(corner + z, y, x, cuts, white);
    b.sheet(corner, y, z, cuts, red);
    b.sheet(corner + x, z, y, cuts, green);
    b.sheet(Vec3::new(-0.65, 2.0 * s - 0.005, -0.5), Vec3::X * 1.3, Vec3::Z * 1.05, [1, 1], lamp);
    b.solid(Vec3::new(-0.9, 1.65, -0.8), Vec3::new(1.65, 3.3, 1.65), 0.3, 4, white);
    b.solid(Vec3::new(0.95, 0.825, 0.7), Vec3::new(1.65, 1.65, 1.65), -0.3, 4, white);
    b.world([0.0; 3], None, Vec::new())
}

/// Light sources of a furnished room.
pub struct RoomLight {
    pub sky: [f32; 3],
    pub sun: Option<[f32; 3]>,
    pub lamps: bool,
}

/// Returns a furnished living room of some tens of thousands of triangles: window with pane and curtain, lamps with and
/// without shades, tables, shelves with books, sofa, rug, mirror, a polished floor and metal.
pub fn living_room(light: &RoomLight) -> World {
    let mut b = Builder::new();
    let plain = |color: [f32; 3], roughness: f32, metallic: f32| Material {
        base_color: [color[0], color[1], color[2], 1.0],
        roughness,
        metallic,
        ..Material::default()
    };
    let wall = b.matte([0.75, 0.72, 0.66]);
    let ceiling = b.matte([0.85; 3]);
    let floor = b.material(plain([0.42, 0.27, 0.15], 0.3, 0.0));
    let wood = b.material(plain([0.5, 0.33, 0.2], 0.5, 0.0));
    let fabric = b.material(plain([0.2, 0.3, 0.5], 1.0, 0.0));
    let rug = b.material(plain([0.6, 0.15, 0.12], 1.0, 0.0));
    let metal = b.material(plain([0.9, 0.8, 0.6], 0.35, 1.0));
    let mirror = b.material(plain([0.95; 3], 0.0, 1.0));
    let pane = b.material(Material {
        transmission: 1.0,
        roughness: 0.0,
        base_color: [0.95, 1.0, 0.97, 1.0],
        ..Material::default()
    });
    let cloth = b.material(Material { diffuse_transmission: 0.4, ..plain([0.8, 0.78, 0.7], 1.0, 0.0) });
    let (w, h, d) = (5.0, 2.6, 4.2);
    let at = |x: f32, y: f32, z: f32| Vec3::new(x - w / 2.0, y, z - d / 2.0);
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    b.sheet(at(0.0, 0.0, 0.0), z * d, x * w, [42, 50], floor);
    b.sheet(at(0.0, h, 0.0), x * w, z * d, [40, 40], ceiling);
    b.sheet(at(0.0, 0.0, 0.0), y * h, z * d, [26, 42], wall);
    b.sheet(at(w, 0.0, 0.0), z * d, y * h, [42, 26], wall);
    b.sheet(at(0.0, 0.0, d), y * h, x * w, [26, 50], wall);
    // The wall z = 0 with a window 1.6 × 1.3 m, its reveal 20 cm deep.
    let (x0, x1, y0, y1) = (2.4, 4.0, 0.9, 2.2);
    b.sheet(at(0.0, 0.0, 0.0), x * x0, y * h, [24, 26], wall);
    b.sheet(at(x1, 0.0, 0.0), x * (w - x1), y * h, [10, 26], wall);
    b.sheet(at(x0, 0.0, 0.0), x * (x1 - x0), y * y0, [16, 9], wall);
    b.sheet(at(x0, y1, 0.0), x * (x1 - x0), y * (h - y1), [16, 4], wall);
    let depth = z * -0.2;
    b.sheet(at(x0, y0, 0.0), x * (x1 - x0), depth, [16, 2], wall);
    b.sheet(at(x0, y1, 0.0), depth, x * (x1 - x0), [2, 16], wall);
    b.sheet(at(x0, y0, 0.0), depth, y * (y1 - y0), [2, 13], wall);
    b.sheet(at(x1, y0, 0.0), y * (y1 - y0), depth, [13, 2], wall);
    b.sheet(at(x0, y0, -0.18), x * (x1 - x0), y * (y1 - y0), [1, 1], pane);
    b.solid(at((x0 + x1) / 2.0, (y0 + y1) / 2.0, -0.15), Vec3::new(0.05, y1 - y0, 0.05), 0.0, 3, wood);
    let portal = Portal { corner: at(x0, y0, -0.2), edges: [x * (x1 - x0), y * (y1 - y0)] };
    // A curtain in waves.
    for i in 0..24 {
        let wave = |i: i32| at(3.6 + i as f32 * 0.025, 0.05, 0.12 + 0.03 * (i as f32 * 0.9).sin());
        b.sheet(wave(i), wave(i + 1) - wave(i), y * 2.3, [1, 12], cloth);
    }
    // Table with four legs, things on it.
    b.solid(at(2.3, 0.73, 1.9), Vec3::new(1.4, 0.04, 0.8), 0.2, 12, wood);
    for (i, k) in [(-0.6, -0.32), (0.6, -0.32), (-0.6, 0.32), (0.6, 0.32)] {
        let leg = Quat::from_rotation_y(0.2) * Vec3::new(i, 0.0, k);
        b.solid(at(2.3, 0.355, 1.9) + leg, Vec3::new(0.05, 0.71, 0.05), 0.2, 4, wood);
    }
    b.ball(at(2.1, 0.85, 1.8), 0.1, 24, metal);
    b.ball(at(2.6, 0.83, 2.0), 0.08, 24, rug);
    // Sofa, rug, shelf with books.
    b.solid(at(0.6, 0.22, 2.4), Vec3::new(0.8, 0.44, 1.9), 0.0, 16, fabric);
    b.solid(at(0.28, 0.6, 2.4), Vec3::new(0.16, 0.4, 1.9), 0.0, 12, fabric);
    b.solid(at(2.4, 0.006, 2.3), Vec3::new(2.2, 0.012, 1.5), 0.1, 12, rug);
    for row in 0..5 {
        b.solid(at(4.75, 0.1 + 0.42 * row as f32, 2.8), Vec3::new(0.3, 0.025, 1.4), 0.0, 8, wood);
        for book in 0..24 {
            let (thick, tall) = (0.03 + 0.012 * (book % 3) as f32, 0.2 + 0.03 * (book % 5) as f32);
            let color = if (book + row) % 3 == 0 {
                rug
            } else if (book + row) % 3 == 1 {
                fabric
            } else {
                wood
            };
            let center = at(4.75, 0.1125 + 0.42 * row as f32 + tall / 2.0, 2.15 + 0.055 * book as f32);
            b.solid(center, Vec3::new(0.18, tall, thick), 0.0, 3, color);
        }
    }
    b.sheet(at(1.0, 1.0, d - 0.01), y * 1.0, x * 0.8, [1, 1], mirror);
    // Lamps: a panel, a bulb in a shade that is open above and below, a bare bulb.
    let power = if light.lamps { 1.0 } else { 0.0 };
    let panel = b.lamp([30.0 * power, 27.0 * power, 22.0 * power]);
    let bulb = b.lamp([900.0 * power, 700.0 * power, 420.0 * power]);
    b.sheet(at(1.0, h - 0.01, 2.0), x * 0.6, z * 0.6, [6, 6], panel);
    let shade = b.material(Material { diffuse_transmission: 0.5, ..plain([0.9, 0.85, 0.7], 1.0, 0.0) });
    b.ball(at(0.5, 1.45, 0.6), 0.04, 10, bulb);
    b.tube(at(0.5, 1.3, 0.6), [0.22, 0.14], 0.3, 32, shade);
    b.solid(at(0.5, 0.65, 0.6), Vec3::new(0.03, 1.3, 0.03), 0.0, 3, metal);
    b.ball(at(4.2, 2.1, 1.0), 0.04, 10, bulb);
    let sun = light.sun.map(|radiance| Sun {
        direction: Vec3::new(0.25, 0.55, -0.9).normalize(),
        angular_radius_rad: 0.00465,
        radiance,
    });
    b.world(light.sky, sun, vec![portal])
}

pub fn panorama(position: Vec3, height: usize) -> View {
    View::Panorama { pose: Pose { position, rotation: Quat::IDENTITY }, height }
}

pub fn photo(position: Vec3, yaw_rad: f32, pitch_rad: f32, [width, height]: [u32; 2]) -> View {
    let rotation = Quat::from_rotation_y(yaw_rad) * Quat::from_rotation_x(pitch_rad);
    let camera = Camera::from_hfov_deg(75.0, width, height).expect("a usual camera");
    View::Pinhole { pose: Pose { position, rotation }, camera }
}

/// Applies x / (1 + x) to radiance divided by `white`.
fn shown(image: &RadianceImage, white: f32) -> Vec<f32> {
    image.pixels().iter().flatten().map(|v| v / (v + white)).collect()
}

/// Returns the PSNR in dB of tone-mapped images. The curve is x / (1 + x) with x in units of the truth's mean. The
/// truth is given twice with independent noise, so that the mean product of both differences is free of it.
pub fn psnr_db(found: &RadianceImage, truth: [&RadianceImage; 2]) -> f32 {
    let white = mean(truth[0]);
    let (x, [a, b]) = (shown(found, white), truth.map(|t| shown(t, white)));
    let product = x.iter().zip(a.iter().zip(&b)).map(|(x, (a, b))| f64::from((x - a) * (x - b)));
    let mse = product.sum::<f64>() / x.len() as f64;
    (-10.0 * mse.max(1e-9).log10()) as f32
}

/// Returns the mean of all channels and pixels.
pub fn mean(image: &RadianceImage) -> f32 {
    (image.pixels().iter().flatten().map(|v| f64::from(*v)).sum::<f64>() / (3 * image.pixels().len()) as f64) as f32
}
