"""Reaches past spheres, cubes and cylinders (IV.8)."""
