use lo_bsdf::MetallicRoughness;

/// BSDF of a fragment.
pub(crate) struct Look {
    pub bsdf: MetallicRoughness,
    /// Whether its reflection is faint and blurred enough to be carried over from pixels near by.
    pub shares_reflection: bool,
    /// Whether it reflects diffusely.
    pub diffuse: bool,
    /// Whether light samples make highlights on it.
    pub gloss: bool,
}

impl Look {
    /// Whether what is gathered for one of two fragments serves the other.
    pub fn is_like(&self, other: &Self) -> bool {
        self.shares_reflection == other.shares_reflection && self.diffuse == other.diffuse && self.gloss == other.gloss
    }

    /// Whether it needs what is gathered.
    pub fn gathers(&self) -> bool {
        self.diffuse || self.gloss
    }
}
