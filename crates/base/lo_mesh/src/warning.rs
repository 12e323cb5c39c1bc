/// What a file asks for and its model does not have.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshWarning {
    /// A texture is left out.
    #[error("texture {name} left out: {reason}")]
    Texture {
        /// Its file, or its number in the mesh's file.
        name: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A bump map is left out since it holds heights, not normals.
    #[error("bump map {map} holds heights, not normals; left out")]
    BumpMap {
        /// The material's statement.
        map: String,
    },
    /// Normal textures are not used, since tangents cannot be made.
    #[error("normal textures are not used: {reason}")]
    NormalTextures {
        /// Why.
        reason: String,
    },
    /// A file of materials cannot be read.
    #[error("material file {file} cannot be read ({reason}): shown matte white")]
    MaterialFile {
        /// Which file.
        file: String,
        /// Why.
        reason: String,
    },
    /// Materials that no file describes are shown white.
    #[error("materials that no MTL file describes are shown white: {}", .names.join(", "))]
    UnknownMaterials {
        /// Their names.
        names: Vec<String>,
    },
    /// A comment names a texture, which is not read.
    #[error("the file names the texture {file} in a comment; give it as a material")]
    TextureInComment {
        /// What it names.
        file: String,
    },
    /// Texture coordinates per face are not read.
    #[error("texture coordinates per face are not read")]
    FaceTextureCoordinates,
    /// Triangles are dropped for a coordinate that is not finite or too large.
    #[error(
        "{dropped} of {triangles} triangles dropped: a coordinate is not a usable number (first: vertex {vertex} at {}, {}, {})",
        .at[0], .at[1], .at[2]
    )]
    UnusableCoordinate {
        /// How many triangles.
        dropped: usize,
        /// Of how many.
        triangles: usize,
        /// The first such vertex.
        vertex: usize,
        /// Its coordinates as they were read.
        at: [f32; 3],
    },
    /// Triangles are dropped since they have no area.
    #[error("{dropped} of {triangles} triangles dropped: they have no area")]
    NoArea {
        /// How many triangles.
        dropped: usize,
        /// Of how many.
        triangles: usize,
    },
    /// Primitives of points or lines are left out.
    #[error("{primitives} primitives of points or lines left out")]
    PointsOrLines {
        /// How many.
        primitives: usize,
    },
    /// Morph targets are not applied.
    #[error("morph targets are not applied")]
    MorphTargets,
    /// Animations are not played: the model is in its bind pose.
    #[error("{} are not played: the model is shown in its bind pose", if *.skins { "skins and animations" } else { "animations" })]
    BindPose {
        /// Whether it has skins too.
        skins: bool,
    },
}

impl MeshWarning {
    /// Of a texture that is left out; where the reason names it too, it is named once.
    pub(crate) fn texture(name: &str, reason: &str) -> Self {
        let reason = reason.strip_prefix(&format!("texture {name}: ")).unwrap_or(reason);
        Self::Texture { name: name.to_owned(), reason: reason.to_owned() }
    }
}
