//! Geometric shapes: zones, voids and cracks.
