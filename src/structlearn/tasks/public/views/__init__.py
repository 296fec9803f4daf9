"""Recordings of the recorded data, to look at."""
