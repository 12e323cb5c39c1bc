use std::collections::{HashMap, HashSet};

use lo_imaging::Image as Raster;

use super::buffers::{Buffers, read_uri};
use super::json::{Image, Root, get};
use super::material_json::{TextureInfo, TextureTransform};
use crate::model::Resolver;
use crate::texture::TextureBudget;
use crate::{MeshError, MeshWarning, Texture, TextureRef, Wrap};

/// Loads textures; decodes each image once per colour space.
pub(super) struct TextureLoader<'a> {
    root: &'a Root,
    buffers: &'a Buffers<'a>,
    resolve: &'a Resolver<'a>,
    /// Texture index by (image, sRGB); `None` for an image that could not be used.
    known: HashMap<(usize, bool), Option<usize>>,
    pub textures: Vec<Texture>,
    pub warnings: Vec<MeshWarning>,
    budget: TextureBudget,
    /// Image files already counted in the budget.
    counted: HashSet<&'a str>,
}

impl<'a> TextureLoader<'a> {
    /// Creates a loader without textures, for a file of `file_bytes` bytes.
    pub fn new(root: &'a Root, buffers: &'a Buffers<'a>, resolve: &'a Resolver<'a>, file_bytes: usize) -> Self {
        Self {
            root,
            buffers,
            resolve,
            known: HashMap::new(),
            textures: Vec::new(),
            warnings: Vec::new(),
            budget: TextureBudget::new(file_bytes),
            counted: HashSet::new(),
        }
    }

    /// Returns the texture that a material may refer to, as [`get`](Self::get).
    pub fn optional(&mut self, info: Option<&TextureInfo>, srgb: bool) -> Result<Option<TextureRef>, MeshError> {
        info.map_or(Ok(None), |info| self.get(info, srgb))
    }

    /// Adds a texture computed from others, which counts towards the budget. `None`, with a warning, if that is spent.
    ///
    /// `pixel` returns the values at a column and row, given the textures loaded so far.
    pub fn compute(
        &mut self,
        name: &str,
        (width, height): (usize, usize),
        srgb: bool,
        pixel: impl Fn(&[Texture], usize, usize) -> [u8; 4],
    ) -> Option<usize> {
        if let Err(reason) = self.budget.spend(width * height) {
            self.warnings.push(MeshWarning::texture(name, &reason));
            return None;
        }
        let image = Raster::from_fn(width, height, |x, y| pixel(&self.textures, x, y));
        self.textures.push(Texture::from_image(image, srgb));
        Some(self.textures.len() - 1)
    }

    /// Returns the texture that a material refers to; `None`, with a warning, if its image is missing or unreadable.
    pub fn get(&mut self, info: &TextureInfo, srgb: bool) -> Result<Option<TextureRef>, MeshError> {
        let texture = get(&self.root.textures, info.index, "texture")?;
        let Some(image) = texture.extensions.webp.as_ref().map(|webp| webp.source).or(texture.source) else {
            self.warnings.push(MeshWarning::texture(&info.index.to_string(), "it has no image in a supported format"));
            return Ok(None);
        };
        let index = match self.known.get(&(image, srgb)) {
            Some(&index) => index,
            None => {
                let index = self.load(image, srgb)?;
                self.known.insert((image, srgb), index);
                index
            }
        };
        let Some(index) = index else {
            return Ok(None);
        };
        let sampler = texture.sampler.map(|sampler| get(&self.root.samplers, sampler, "sampler")).transpose()?;
        let transform = info.extensions.transform.as_ref();
        let uv_set = transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord);
        if uv_set > 1 {
            let reason = format!("it uses UV set {uv_set}; only sets 0 and 1 are supported");
            self.warnings.push(MeshWarning::texture(&info.index.to_string(), &reason));
            return Ok(None);
        }
        Ok(Some(TextureRef {
            uv_set,
            uv_transform: transform.map_or(TextureRef::new(0).uv_transform, matrix),
            wrap: [sampler.and_then(|s| s.wrap_s), sampler.and_then(|s| s.wrap_t)].map(wrap),
            nearest: sampler.and_then(|s| s.mag_filter) == Some(9728),
            ..TextureRef::new(index)
        }))
    }

    fn load(&mut self, index: usize, srgb: bool) -> Result<Option<usize>, MeshError> {
        let image = get(&self.root.images, index, "image")?;
        let name = image.name.clone().or_else(|| image.uri.clone().filter(|uri| !uri.starts_with("data:")));
        let name = name.unwrap_or_else(|| format!("image {index}"));
        let texture = self.bytes(image).and_then(|bytes| {
            Texture::decode(&name, &bytes, srgb, &mut self.budget).map_err(|error| error.to_string())
        });
        match texture {
            Ok(texture) => {
                self.textures.push(texture);
                Ok(Some(self.textures.len() - 1))
            }
            Err(reason) => {
                self.warnings.push(MeshWarning::texture(&name, &reason));
                Ok(None)
            }
        }
    }

    fn bytes(&mut self, image: &'a Image) -> Result<Vec<u8>, String> {
        match (&image.uri, image.buffer_view) {
            (Some(uri), _) => {
                let bytes = read_uri(uri, self.resolve).map_err(|failure| failure.text())?;
                if !uri.starts_with("data:") && self.counted.insert(uri) {
                    self.budget.grow(bytes.len());
                }
                Ok(bytes)
            }
            (None, Some(view)) => self.buffers.view(view).map(<[u8]>::to_vec).map_err(|error| error.to_string()),
            (None, None) => Err("the image has neither a URI nor a buffer view".to_owned()),
        }
    }
}

/// Matrix of `KHR_texture_transform`: translation · rotation · scale.
fn matrix(transform: &TextureTransform) -> [f32; 6] {
    let (sin, cos) = transform.rotation.sin_cos();
    let ([sx, sy], [tx, ty]) = (transform.scale, transform.offset);
    let matrix = [cos * sx, sin * sy, tx, -sin * sx, cos * sy, ty];
    if matrix.iter().all(|x| x.is_finite()) { matrix } else { TextureRef::new(0).uv_transform }
}

fn wrap(code: Option<u32>) -> Wrap {
    match code {
        Some(33071) => Wrap::Clamp,
        Some(33648) => Wrap::Mirror,
        _ => Wrap::Repeat,
    }
}
