/// Why a world cannot be lit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TransportError {
    /// The outdoors map has no pixels.
    #[error("the outdoors map has no pixels")]
    EmptyOutdoors,
    /// A pixel of the outdoors map is negative, NaN or infinite.
    #[error("pixel {pixel} of the outdoors map is {radiance:?}; radiance must be finite and not negative")]
    OutdoorsRadiance {
        /// Row-major index of the first such pixel.
        pixel: usize,
        /// Its value.
        radiance: [f32; 3],
    },
    /// The sun has no direction, no sensible size or a radiance that is negative or not finite.
    #[error("the sun {0:?} needs a unit direction, an angular radius in (0, 0.5] and finite radiance")]
    Sun(crate::Sun),
    /// A portal has no area or is not finite.
    #[error("portal {index} is no parallelogram with an area")]
    Portal {
        /// Index in [`crate::World::portals`].
        index: usize,
    },
    /// A triangle has a corner that is NaN or infinite, names a vertex or material that is not there, or lies too far away.
    #[error("triangle {index} has a corner or a material that is not there, not finite or more than 10 km away")]
    Triangle {
        /// Index in the model.
        index: usize,
    },
    /// A material gives off negative light or light that is not finite.
    #[error("material {index} ({name}) gives off {emissive:?}; radiance must be finite and not negative")]
    Emission {
        /// Index in the model.
        index: usize,
        /// Its name.
        name: String,
        /// Its value.
        emissive: [f32; 3],
    },
    /// A setting is out of range.
    #[error("{name} is {value}; it must lie in [{least}, {most}]")]
    Setting {
        /// Field of [`crate::BakeSettings`].
        name: &'static str,
        /// As given.
        value: f32,
        /// Smallest value that works.
        least: f32,
        /// Largest value that works.
        most: f32,
    },
    /// The surfaces are too large for the spacing.
    #[error("{area_m2} m² of surface at a spacing of {spacing_m} m need more than {most} cache points")]
    TooLarge {
        /// Area of all triangles.
        area_m2: f32,
        /// As asked for.
        spacing_m: f32,
        /// The limit.
        most: usize,
    },
}
