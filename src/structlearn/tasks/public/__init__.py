"""Protocols on the public recordings: what is asked of segmentation and primitives on real data."""

from pathlib import Path

PARAMETER_FILE = Path("stages/recorded/params.yaml")
"""Of the pipeline on recorded data; its stages read some keys of the main pipeline's too."""
