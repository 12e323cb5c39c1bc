/// The face of a node across which a neighbour lies; the order is that of `ognn`'s edge types (its seventh is the self loop).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Direction {
    /// Towards greater z.
    PlusZ = 0,
    /// Towards smaller z.
    MinusZ = 1,
    /// Towards greater y.
    PlusY = 2,
    /// Towards smaller y.
    MinusY = 3,
    /// Towards greater x.
    PlusX = 4,
    /// Towards smaller x.
    MinusX = 5,
}

impl Direction {
    /// All six, by number.
    pub const ALL: [Self; 6] = [Self::PlusZ, Self::MinusZ, Self::PlusY, Self::MinusY, Self::PlusX, Self::MinusX];

    /// The way back.
    pub fn opposite(self) -> Self {
        Self::ALL[self as usize ^ 1]
    }

    /// The bit of a child's number that its coordinate along this axis is.
    pub(crate) fn bit(self) -> u32 {
        1 << (self as u32 / 2)
    }

    /// Whether it points towards greater coordinates.
    pub(crate) fn is_positive(self) -> bool {
        (self as u32).is_multiple_of(2)
    }

    /// The four of a node's eight children that touch what lies in this direction, in order.
    pub(crate) fn face(self) -> [u32; 4] {
        let bit = self.bit();
        let side = if self.is_positive() { bit } else { 0 };
        // The two other bits, counted up.
        let (low, high) = match bit {
            1 => (2, 4),
            2 => (1, 4),
            _ => (1, 2),
        };
        [side, side | low, side | high, side | low | high]
    }

    /// The four of a neighbour's eight children that touch the node from which it lies in this direction.
    pub(crate) fn opposite_face(self) -> [u32; 4] {
        self.face().map(|child| child ^ self.bit())
    }
}
