/// Which part of a scene is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Content {
    /// The octree's leaves with radiance that the room's air touches or that the photo saw: the whole room, but not what
    /// fills the walls from behind.
    #[default]
    Leaves,
    /// The photo's pixels that have a depth reading.
    PhotoPoints,
}
