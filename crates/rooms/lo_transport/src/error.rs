/// Reasons why a world is rejected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TransportError {
    /// The outdoors map has no pixels.
    #[error("the outdoors map has no pixels")]
    EmptyOutdoors,
    /// A pixel of the outdoors map is negative, NaN or infinite.
    #[error("pixel {pixel} of the outdoors map is {radiance:?}; radiance must be finite and not negative")]
    OutdoorsRadiance {
        /// Row-major index of the first invalid pixel.
        pixel: usize,
        /// Radiance of that pixel.
        radiance: [f32; 3],
    },
    /// The sun's direction is not a unit vector, its angular radius is out of range, or its radiance is negative or not
    /// finite.
    #[error("the sun {0:?} needs a unit direction, an angular radius in (0, 0.5] and finite radiance")]
    Sun(crate::Sun),
    /// A portal is degenerate or not finite.
    #[error("portal {index} is degenerate: its edges must be finite and not parallel")]
    Portal {
        /// Index in [`crate::World::portals`].
        index: usize,
    },
    /// A triangle refers to a missing vertex or material, or a corner is NaN, infinite or too far from the origin.
    #[error(
        "triangle {index} has a missing vertex or material, or a corner that is not finite or beyond 10 km on an axis"
    )]
    Triangle {
        /// Index in the model.
        index: usize,
    },
    /// A material's emission is negative or not finite.
    #[error("material {index} ({name}) emits {emissive:?}; radiance must be finite and not negative")]
    Emission {
        /// Index in the model.
        index: usize,
        /// Name of the material.
        name: String,
        /// Emitted radiance.
        emissive: [f32; 3],
    },
    /// A setting is out of range.
    #[error("{name} is {value}; it must be between {min} and {max}")]
    Setting {
        /// Field of [`crate::BakeSettings`].
        name: &'static str,
        /// Value that was set.
        value: f32,
        /// Smallest allowed value.
        min: f32,
        /// Largest allowed value.
        max: f32,
    },
    /// The scene's surface area is too large for the spacing.
    #[error(
        "{area_m2} m² of surface at a spacing of {spacing_m} m need more than {limit} cache points; increase the spacing"
    )]
    TooLarge {
        /// Area of all triangles.
        area_m2: f32,
        /// Spacing that was set.
        spacing_m: f32,
        /// Most cache points.
        limit: usize,
    },
}
