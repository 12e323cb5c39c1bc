//! Categories and statistics of a generated room.

use serde::{Deserialize, Serialize};

/// Purpose of a room.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RoomKind {
    /// A bed, a wardrobe, night tables.
    Bedroom,
    /// Sofas around a coffee table, a television, shelves.
    Living,
    /// A kitchen line with worktop and wall cupboards, a small table.
    Kitchen,
    /// Desks with screens, shelves.
    Office,
    /// A large table with chairs, a sideboard.
    Dining,
    /// A bath or a shower, a basin, a toilet.
    Bathroom,
    /// A narrow room with many doors.
    Corridor,
    /// A large room for living, sleeping and work.
    Studio,
    /// Rows of desks in front of a board.
    Classroom,
    /// A kitchen, a dining table and sofas in one large room.
    OpenPlan,
    /// Benches with instruments, cabinets of electronics.
    Laboratory,
    /// A low room with racks, boxes, pipes, a boiler or a washing machine.
    Cellar,
    /// Workbenches below tool boards, machines, racks.
    Workshop,
    /// A large, high room with few objects.
    Hall,
    /// An empty or nearly empty room.
    Empty,
}

impl RoomKind {
    /// All kinds, in declaration order.
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

    /// Whether rooms of this kind can have glazed walls.
    pub(crate) fn can_be_glazed(self) -> bool {
        !matches!(self, Self::Bathroom | Self::Corridor | Self::Cellar)
    }

    /// Whether rooms of this kind can be much larger than usual.
    pub(crate) fn can_be_large(self) -> bool {
        use RoomKind::{Classroom, Empty, Hall, Laboratory, OpenPlan, Studio, Workshop};
        matches!(self, Classroom | Empty | Hall | Laboratory | OpenPlan | Studio | Workshop)
    }
}

/// Shape of the floor plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outline {
    /// Four walls.
    Rectangle,
    /// Six walls.
    LShape,
    /// A large room with several purposes.
    OpenPlan,
}

/// Outdoor conditions behind the windows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Weather {
    /// A blue sky with sun.
    Clear,
    /// A grey sky without sun.
    Overcast,
    /// A clear sky with a low sun.
    Sunset,
    /// Night with street lamps and lit windows.
    Night,
    /// A user-supplied panorama.
    Panorama,
}

/// Which lamps are on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LightingMode {
    /// No lamp: daylight only.
    Daylight,
    /// Ceiling lamps, at the illuminance recommended for the room's purpose.
    Normal,
    /// All lamps, far brighter than needed.
    OverLit,
    /// A single floor, table or desk lamp; screens and kitchen strips may add a little light.
    SingleLamp,
    /// Several small lamps, no ceiling lamp.
    Mixed,
}

fn is_zero(number: &usize) -> bool {
    *number == 0
}

/// Statistics of one room.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// Purpose of the room.
    pub kind: RoomKind,
    /// Shape of the floor plan.
    pub outline: Outline,
    /// Floor area, square metres.
    pub area_m2: f32,
    /// Maximum height, metres.
    pub height_m: f32,
    /// Whether the ceiling is sloped.
    pub sloped: bool,
    /// Outdoor conditions.
    pub weather: Weather,
    /// Which lamps are on.
    pub lighting: LightingMode,
    /// Amount of small objects: 0 bare … 1 cluttered.
    pub clutter: f32,
    /// Whether walls and furniture are dark.
    pub dark: bool,
    /// Area of the window openings divided by the floor area.
    pub window_share: f32,
    /// Number of windows.
    pub windows: usize,
    /// Number of doors.
    pub doors: usize,
    /// Number of people.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub people: usize,
    /// Number of lamps, on or off.
    pub lamps: usize,
    /// Number of lamps that are on.
    pub lamps_on: usize,
    /// Luminous flux of all lamps that are on, lumens.
    pub flux_lm: f32,
    /// Number of objects: furniture, fittings, small objects and parts of the building.
    pub objects: usize,
    /// Number of triangles.
    pub triangles: usize,
}
