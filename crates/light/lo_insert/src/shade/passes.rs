//! Passes for compositing: the objects' light by kind, their geometry, and mattes.

use lo_geometry::{RigidTransform, Vec3};
use lo_imaging::{ChannelGroup, Image, RadianceImage};

use crate::shade::cryptomatte::Cryptomatte;
use crate::shade::redistortion::Redistortion;
use crate::shade::shader::Shaded;
use crate::shade::visibility::{Fragment, TileView};

/// Passes of a composite, all of the photo's size.
///
/// The light adds up to the layer `object`: `diffuse + specular + transmission + emission + edge`, premultiplied like
/// it. Positions and normals are in the scene's frame: +X right, +Y up, the camera at the origin looks along −Z.
#[derive(Clone, Debug)]
pub struct Passes {
    /// Light that the objects reflect diffusely.
    pub diffuse: RadianceImage,
    /// Light that their specular layers and clear coats reflect.
    pub specular: RadianceImage,
    /// Light that passes their glass, except clear panes, through which the photo shows.
    pub transmission: RadianceImage,
    /// Light that they emit.
    pub emission: RadianceImage,
    /// Change of the photo along soft edges of real surfaces in front.
    pub edge: RadianceImage,
    /// Base colour, premultiplied by the share of the pixel.
    pub albedo: RadianceImage,
    /// Unit shading normal of the object with the largest share of the pixel.
    pub normal: RadianceImage,
    /// Its position in metres.
    pub position_m: RadianceImage,
    /// Its depth in metres, along −Z; 0 without an object.
    pub depth_m: Image<f32>,
    /// Its motion to the next and from the previous image of a sequence, in pixels: right and up, right and up.
    pub motion_px: Option<Image<[f32; 4]>>,
    /// The objects.
    pub objects: Cryptomatte,
    /// Their materials; those of one name are one.
    pub materials: Cryptomatte,
}

/// Passes during rendering.
pub(crate) struct PassImages {
    light: [Image<Vec3>; 4],
    edge: Image<Vec3>,
    albedo: Image<Vec3>,
    normal: Image<Vec3>,
    position_m: Image<Vec3>,
    depth_m: Image<f32>,
    /// To the next image, and from the previous one; z is unused.
    motion_px: Option<[Image<Vec3>; 2]>,
    objects: Cryptomatte,
    materials: Cryptomatte,
}

/// Gives the pixels the values of fragments, as their light is.
pub(crate) type AddValues<'a> = dyn Fn(&[Vec3]) -> Image<Vec3> + 'a;

/// Gives a fragment's motion to the next image and from the previous one.
pub(crate) type MotionOf<'a> = dyn Fn(&Fragment) -> [Vec3; 2] + 'a;

impl PassImages {
    /// Computes the passes of shaded fragments. `names` are those of the objects, and `material_of` gives the
    /// material's name of a fragment,
    /// `motion_of` its motion to the next image and from the previous one.
    pub fn new(
        view: &TileView,
        shaded: &[Shaded],
        size: [usize; 2],
        names: &[String],
        material_of: impl Fn(&Fragment) -> String,
        motion_of: Option<&MotionOf<'_>>,
        add: &AddValues<'_>,
    ) -> Self {
        let light = [
            |shaded: &Shaded| shaded.diffuse,
            |shaded: &Shaded| shaded.specular,
            |shaded: &Shaded| shaded.transmission,
            |shaded: &Shaded| shaded.emission,
        ];
        let light = light.map(|part| add(&shaded.iter().map(part).collect::<Vec<_>>()));
        let albedo: Vec<Vec3> = view.fragments.iter().map(|f| Vec3::from(f.point.base_color)).collect();
        let [width, height] = size;
        let mut largest: Image<Option<usize>> = Image::new(width, height, vec![None; width * height]);
        for (i, fragment) in view.fragments.iter().enumerate() {
            let best = &mut largest[fragment.pixel];
            if best.is_none_or(|best| fragment.weight > view.fragments[best].weight) {
                *best = Some(i);
            }
        }
        let of_largest = |value: fn(&Fragment) -> Vec3| {
            largest.map(|best| best.map_or(Vec3::ZERO, |best| value(&view.fragments[best])))
        };
        let owners: Vec<String> = view.fragments.iter().map(|fragment| names[fragment.object].clone()).collect();
        let materials: Vec<String> = view.fragments.iter().map(material_of).collect();
        Self {
            light,
            edge: Image::new(width, height, vec![Vec3::ZERO; width * height]),
            albedo: add(&albedo),
            normal: of_largest(|fragment| fragment.point.shading_normal),
            position_m: of_largest(|fragment| fragment.point.position),
            depth_m: largest.map(|best| best.map_or(0.0, |best| -view.fragments[best].point.position.z)),
            motion_px: motion_of.map(|motion_of| {
                [0, 1].map(|end| {
                    largest.map(|best| best.map_or(Vec3::ZERO, |best| motion_of(&view.fragments[best])[end]))
                })
            }),
            objects: Cryptomatte { layer: "CryptoObject", coverage: coverage(&owners, add) },
            materials: Cryptomatte { layer: "CryptoMaterial", coverage: coverage(&materials, add) },
        }
    }

    /// Returns the passes with normals and positions in the axes of the room.
    pub fn in_room(mut self, room_from_camera: &RigidTransform) -> Self {
        let shown = self.depth_m.pixels().iter().map(|&depth_m| depth_m != 0.0);
        let surfaces = self.normal.pixels_mut().iter_mut().zip(self.position_m.pixels_mut());
        for ((normal, position_m), _) in surfaces.zip(shown).filter(|(_, shown)| *shown) {
            *normal = room_from_camera.direction(*normal);
            *position_m = room_from_camera.point(*position_m);
        }
        self
    }

    /// Adds what [`Layers::clear_edge`] adds to the objects.
    pub fn add_edge(&mut self, pixel: (usize, usize), change: Vec3) {
        self.edge[pixel] += change;
    }

    /// Removes everything from a pixel.
    pub fn clear(&mut self, pixel: (usize, usize)) {
        let radiance = [&mut self.edge, &mut self.albedo, &mut self.normal, &mut self.position_m];
        self.light.iter_mut().chain(radiance).for_each(|image| image[pixel] = Vec3::ZERO);
        self.depth_m[pixel] = 0.0;
        self.motion_px.iter_mut().flatten().for_each(|image| image[pixel] = Vec3::ZERO);
        let mattes = self.objects.coverage.iter_mut().chain(&mut self.materials.coverage);
        mattes.for_each(|(_, image)| image[pixel] = 0.0);
    }

    /// Finishes the passes; `back` distorts them like the photo.
    pub fn finish(self, back: Option<&Redistortion>) -> Passes {
        let linear = |image: Image<Vec3>| {
            let image = back.map_or_else(|| image.clone(), |back| back.layer(&image, Vec3::ZERO));
            image.map(|value| value.to_array())
        };
        // These are not interpolated.
        let nearest = |image: Image<Vec3>| {
            back.map_or_else(|| image.clone(), |back| back.nearest(&image, Vec3::ZERO)).map(|value| value.to_array())
        };
        let matte = |matte: Cryptomatte| Cryptomatte {
            coverage: (matte.coverage.into_iter())
                .map(|(name, image)| (name, back.map_or_else(|| image.clone(), |back| back.layer(&image, 0.0))))
                .collect(),
            ..matte
        };
        let [diffuse, specular, transmission, emission] = self.light.map(linear);
        Passes {
            diffuse,
            specular,
            transmission,
            emission,
            edge: linear(self.edge),
            albedo: linear(self.albedo),
            normal: nearest(self.normal),
            position_m: nearest(self.position_m),
            motion_px: self.motion_px.map(|ends| {
                let [next, previous] = ends.map(nearest);
                let both = |(a, b): (&[f32; 3], &[f32; 3])| [a[0], a[1], b[0], b[1]];
                let pixels = next.pixels().iter().zip(previous.pixels()).map(both).collect();
                Image::new(next.width(), next.height(), pixels)
            }),
            depth_m: back.map_or_else(|| self.depth_m.clone(), |back| back.nearest(&self.depth_m, 0.0)),
            objects: matte(self.objects),
            materials: matte(self.materials),
        }
    }
}

/// Returns each name with the share of each pixel that fragments of that name cover.
fn coverage(names: &[String], add: &AddValues<'_>) -> Vec<(String, Image<f32>)> {
    let mut different: Vec<&String> = names.iter().collect();
    different.sort_unstable();
    different.dedup();
    // Three names at a time, as red, green and blue.
    let mut found = Vec::with_capacity(different.len());
    for group in different.chunks(3) {
        let axis = |name: &String| group.iter().position(|other| *other == name);
        let unit = |name: &String| axis(name).map_or(Vec3::ZERO, |axis| Vec3::AXES[axis]);
        let image = add(&names.iter().map(unit).collect::<Vec<_>>());
        found.extend(group.iter().enumerate().map(|(i, &name)| (name.clone(), image.map(|shares| shares[i]))));
    }
    found
}

impl Passes {
    /// Returns the layers of an OpenEXR file.
    pub(crate) fn channels(&self) -> Vec<ChannelGroup> {
        let size = [self.depth_m.width(), self.depth_m.height()];
        let xyz = |name: &str, image: &RadianceImage| {
            let mut group = ChannelGroup::rgb(name, image);
            group.channels.iter_mut().zip(["X", "Y", "Z"]).for_each(|(channel, axis)| axis.clone_into(&mut channel.0));
            group
        };
        let mut groups = vec![
            ChannelGroup::rgb("diffuse", &self.diffuse),
            ChannelGroup::rgb("specular", &self.specular),
            ChannelGroup::rgb("transmission", &self.transmission),
            ChannelGroup::rgb("emission", &self.emission),
            ChannelGroup::rgb("edge", &self.edge),
            ChannelGroup::rgb("albedo", &self.albedo),
            xyz("normal", &self.normal),
            xyz("position", &self.position_m),
            ChannelGroup::single("depth", "Z", &self.depth_m),
        ];
        if let Some(motion_px) = &self.motion_px {
            let mut planes = ChannelGroup::rgba("", motion_px).channels.into_iter();
            for name in ["forward", "backward"] {
                let uv = ["u", "v"].into_iter().map(str::to_owned);
                let channels = uv.zip(planes.by_ref().take(2)).map(|(axis, (_, plane))| (axis, plane)).collect();
                groups.push(ChannelGroup { name: name.to_owned(), channels });
            }
        }
        groups.extend(self.objects.channels(size));
        groups.extend(self.materials.channels(size));
        groups
    }

    /// Returns the attributes of an OpenEXR file.
    pub(crate) fn metadata(&self) -> Vec<(String, String)> {
        [&self.objects, &self.materials].into_iter().flat_map(Cryptomatte::metadata).collect()
    }
}
