"""Reaches past obstacles: learned from some people, tried in the scenes of others (dissertation IV.8)."""
