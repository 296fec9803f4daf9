"""Reaches past obstacles: models of some people, tested in the scenes of others (dissertation IV.8)."""
