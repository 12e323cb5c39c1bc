//! Depth Anything V2: what of its output is what.
