//! What a generated room is, in words and figures.

use serde::{Deserialize, Serialize};

/// Use of a room.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RoomKind {
    /// Bed, wardrobe, night tables.
    Bedroom,
    /// Sofas around a low table, a television, shelves.
    Living,
    /// Kitchen line with worktop and wall cupboards, a small table.
    Kitchen,
    /// Desks with screens, shelves.
    Office,
    /// A large table with chairs, a sideboard.
    Dining,
    /// Bath or shower, basin, toilet.
    Bathroom,
    /// Narrow, with many doors.
    Corridor,
    /// One large room for living, sleeping and work, or an atelier.
    Studio,
    /// Rows of desks before a board.
    Classroom,
    /// Kitchen, table and sofas in one large room.
    OpenPlan,
    /// Benches with instruments, racks of electronics.
    Laboratory,
    /// Low, with racks, boxes, pipes, a boiler or a washing machine.
    Cellar,
    /// Workbenches under tools, machines, racks.
    Workshop,
    /// Large and high, with few things in it.
    Hall,
    /// Nothing in it, or hardly anything.
    Empty,
}

impl RoomKind {
    /// All of them, in the order of their names above.
    pub const ALL: [Self; 15] = [
        Self::Bedroom,
        Self::Living,
        Self::Kitchen,
        Self::Office,
        Self::Dining,
        Self::Bathroom,
        Self::Corridor,
        Self::Studio,
        Self::Classroom,
        Self::OpenPlan,
        Self::Laboratory,
        Self::Cellar,
        Self::Workshop,
        Self::Hall,
        Self::Empty,
    ];

    /// Whether there are rooms of this kind with walls of glass.
    pub(crate) fn may_be_glazed(self) -> bool {
        !matches!(self, Self::Bathroom | Self::Corridor | Self::Cellar)
    }

    /// Whether there are rooms of this kind that are much larger than usual.
    pub(crate) fn may_be_large(self) -> bool {
        use RoomKind::{Classroom, Empty, Hall, Laboratory, OpenPlan, Studio, Workshop};
        matches!(self, Classroom | Empty | Hall | Laboratory | OpenPlan | Studio | Workshop)
    }
}

/// Shape of the floor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outline {
    /// Four walls.
    Rectangle,
    /// Six walls.
    LShape,
    /// Several uses in one large room.
    OpenPlan,
}

/// What is to be seen through the windows, and what comes in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Weather {
    /// Blue sky and sun.
    Clear,
    /// Grey sky, no sun.
    Overcast,
    /// The sun stands low.
    Sunset,
    /// After dark: street lamps and lit windows.
    Night,
    /// A panorama of the user's.
    Panorama,
}

/// Which lamps burn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LampUse {
    /// None: daylight alone.
    Daylight,
    /// The ceiling's, at the level that the use asks for.
    Normal,
    /// Every lamp there is, bright ones: far more than needed.
    OverLit,
    /// A single floor or desk lamp, candles' worth of a screen or a strip.
    SingleLamp,
    /// Several small lamps, none on the ceiling.
    Mixed,
}

fn is_zero(number: &usize) -> bool {
    *number == 0
}

/// Figures of one room, for statistics.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// Its use.
    pub kind: RoomKind,
    /// Shape of its floor.
    pub outline: Outline,
    /// Floor area, square metres.
    pub area_m2: f32,
    /// Greatest height, metres.
    pub height_m: f32,
    /// Whether the ceiling comes down somewhere.
    pub sloped: bool,
    /// What is outside.
    pub weather: Weather,
    /// Which lamps burn.
    pub lighting: LampUse,
    /// How full of things it is: 0 bare … 1 cluttered.
    pub clutter: f32,
    /// Dark walls and furniture.
    pub dark: bool,
    /// Area of the window openings over that of the floor.
    pub window_share: f32,
    /// Number of windows.
    pub windows: usize,
    /// Number of doors.
    pub doors: usize,
    /// Number of people.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub people: usize,
    /// Number of lamps, burning or not.
    pub lamps: usize,
    /// Number of lamps that burn.
    pub lamps_on: usize,
    /// Light of all burning lamps, lumen.
    pub flux_lm: f32,
    /// Number of pieces of furniture, fittings and small things.
    pub objects: usize,
    /// Number of triangles.
    pub triangles: usize,
}
