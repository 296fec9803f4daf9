"""Protocols on the public recordings: what is asked of segmentation and primitives on real data."""
