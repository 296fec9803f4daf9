"""Recorded data, public or a lab's own: one protocol per kind of data."""
