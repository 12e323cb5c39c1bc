/// Direction of a face neighbour, in the order of `ognn`'s edge types. Its seventh type is the self loop.
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
    /// All six directions in numeric order.
    pub const ALL: [Self; 6] = [Self::PlusZ, Self::MinusZ, Self::PlusY, Self::MinusY, Self::PlusX, Self::MinusX];

    /// Returns the opposite direction.
    pub fn opposite(self) -> Self {
        Self::ALL[self as usize ^ 1]
    }

    /// Returns the bit of a child's index that holds its coordinate along this axis.
    pub(crate) fn bit(self) -> u32 {
        1 << (self as u32 / 2)
    }

    /// Reports whether it points towards greater coordinates.
    pub(crate) fn is_positive(self) -> bool {
        (self as u32).is_multiple_of(2)
    }

    /// Returns the four of a node's eight children on the face in this direction, in order.
    pub(crate) fn face(self) -> [u32; 4] {
        let bit = self.bit();
        let side = if self.is_positive() { bit } else { 0 };
        // The two other bits in increasing order.
        let (low, high) = match bit {
            1 => (2, 4),
            2 => (1, 4),
            _ => (1, 2),
        };
        [side, side | low, side | high, side | low | high]
    }

    /// Returns the four of a neighbour's eight children that touch the node from which it is in this direction.
    pub(crate) fn opposite_face(self) -> [u32; 4] {
        self.face().map(|child| child ^ self.bit())
    }
}
