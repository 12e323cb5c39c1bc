//! MoGe-2: focal length and shift of affine points, metres.
