/// Features of a mesh file that are missing or not applied.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshWarning {
    /// A texture is ignored.
    #[error("texture {name} ignored: {reason}")]
    Texture {
        /// File name of the texture, or its index in the mesh file.
        name: String,
        /// Cause.
        reason: String,
    },
    /// A bump map is ignored because it stores heights, not normals.
    #[error("bump map {map} ignored: height maps are not supported; convert it to a normal map")]
    BumpMap {
        /// Arguments of the material's statement.
        map: String,
    },
    /// Normal textures are ignored because tangents cannot be computed.
    #[error("normal textures ignored: {reason}")]
    NormalTextures {
        /// Cause.
        reason: String,
    },
    /// A material file cannot be read.
    #[error("cannot read material file {file}, its materials are white: {reason}")]
    MaterialFile {
        /// Name of the file.
        file: String,
        /// Error of the operating system.
        reason: String,
    },
    /// Transmissive materials have no thickness, so that they are thin sheets.
    #[error(
        "glass without thickness is shown as thin panes, which do not refract: {}; for solid glass, export \
         KHR_materials_volume with a thickness, or give the material \"glass\"",
        .materials.join(", ")
    )]
    ThinGlass {
        /// Names of the materials.
        materials: Vec<String>,
    },
    /// Extensions of materials are not applied.
    #[error("material extensions not applied: {}", .names.join(", "))]
    MaterialExtensions {
        /// Names of the extensions.
        names: Vec<String>,
    },
    /// Some of the mesh's materials are fully transparent.
    #[error("fully transparent, so not visible: {}", .materials.join(", "))]
    TransparentMaterials {
        /// Names of the materials.
        materials: Vec<String>,
    },
    /// Materials that are not defined in any file are white.
    #[error("materials not defined in any MTL file are white: {}", .names.join(", "))]
    UnknownMaterials {
        /// Names of the materials.
        names: Vec<String>,
    },
    /// A texture named in a comment is ignored.
    #[error("texture {file} ignored: it is only named in a comment; set it as base_color_texture of a material")]
    TextureInComment {
        /// Name of the texture file.
        file: String,
    },
    /// Per-face texture coordinates are ignored.
    #[error("per-face texture coordinates ignored: only those of vertices are supported")]
    FaceTextureCoordinates,
    /// Triangles with a coordinate that is not finite or too large are dropped.
    #[error(
        "{dropped} of {triangles} triangles dropped: a coordinate is not finite or too large \
         (first: vertex {vertex} at {}, {}, {})",
        .at[0], .at[1], .at[2]
    )]
    UnusableCoordinate {
        /// Number of dropped triangles.
        dropped: usize,
        /// Number of all triangles.
        triangles: usize,
        /// Index of the first such vertex.
        vertex: usize,
        /// Coordinates of that vertex.
        at: [f32; 3],
    },
    /// Triangles without area are dropped.
    #[error("{dropped} of {triangles} triangles dropped: zero area")]
    NoArea {
        /// Number of dropped triangles.
        dropped: usize,
        /// Number of all triangles.
        triangles: usize,
    },
    /// Primitives of points or lines are ignored.
    #[error("primitives of points or lines ignored: {primitives}")]
    PointsOrLines {
        /// Number of such primitives.
        primitives: usize,
    },
    /// The model is at rest: its animations are not played.
    #[error("the model is at rest; its animations are {}", .names.join(", "))]
    Animations {
        /// Their names.
        names: Vec<String>,
    },
}

impl MeshWarning {
    /// Whether it is about a mesh's own materials, and no longer applies with another one.
    pub(crate) fn is_about_materials(&self) -> bool {
        match self {
            Self::Texture { .. }
            | Self::BumpMap { .. }
            | Self::NormalTextures { .. }
            | Self::ThinGlass { .. }
            | Self::MaterialExtensions { .. }
            | Self::TransparentMaterials { .. }
            | Self::MaterialFile { .. }
            | Self::UnknownMaterials { .. }
            | Self::TextureInComment { .. } => true,
            Self::FaceTextureCoordinates
            | Self::UnusableCoordinate { .. }
            | Self::NoArea { .. }
            | Self::PointsOrLines { .. }
            | Self::Animations { .. } => false,
        }
    }

    /// Creates the warning of an ignored texture; removes its name from the reason.
    pub(crate) fn texture(name: &str, reason: &str) -> Self {
        let reason = reason.strip_prefix(&format!("texture {name}: ")).unwrap_or(reason);
        Self::Texture { name: name.to_owned(), reason: reason.to_owned() }
    }
}
