"""Representations of the coupling term past obstacles, on published samples."""
