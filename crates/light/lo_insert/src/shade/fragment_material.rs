use lo_bsdf::MetallicRoughness;

/// BSDF of a fragment, with the kinds of light that it needs.
pub(crate) struct FragmentMaterial {
    pub bsdf: MetallicRoughness,
    /// Whether its reflection is faint and blurred enough to be interpolated from nearby pixels.
    pub shares_reflection: bool,
    /// Whether it reflects diffusely.
    pub diffuse: bool,
    /// Whether light samples make highlights on it.
    pub gloss: bool,
}

impl FragmentMaterial {
    /// Returns whether light gathered for one of two fragments is valid for the other.
    pub fn is_like(&self, other: &Self) -> bool {
        self.shares_reflection == other.shares_reflection && self.diffuse == other.diffuse && self.gloss == other.gloss
    }

    /// Returns whether it needs gathered light.
    pub fn gathers(&self) -> bool {
        self.diffuse || self.gloss
    }
}
