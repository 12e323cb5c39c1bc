/// Part of a scene that is exported.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Content {
    /// The octree's leaves with radiance that face the room's free space or that the photo observed: the whole room,
    /// without the leaves that fill its walls from behind.
    #[default]
    Leaves,
    /// The photo's pixels with a depth reading.
    PhotoPoints,
}
