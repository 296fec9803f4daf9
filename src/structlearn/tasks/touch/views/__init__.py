"""Recordings of touch to look at."""
