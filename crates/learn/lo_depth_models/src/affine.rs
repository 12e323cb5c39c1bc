//! Affine inverse depth to metres: a robust fit of `1 / z = a · d + b` to other depth of the same photo.
