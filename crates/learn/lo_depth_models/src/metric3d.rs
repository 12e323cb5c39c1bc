//! Metric3D v2: canonical depth to metres, padding undone.
