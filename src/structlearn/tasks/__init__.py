"""Recorded data, public or a lab's own: one protocol for each kind of data."""
