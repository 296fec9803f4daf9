"""Demonstrations cut into primitives: zero-velocity crossing, time warping, weighted least squares (IV.5)."""
