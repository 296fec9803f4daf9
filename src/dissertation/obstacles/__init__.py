"""Reaches around spheres, cubes and cylinders (IV.8)."""
