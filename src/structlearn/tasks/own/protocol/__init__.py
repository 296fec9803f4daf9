"""Experiments and scores on your own recordings."""
