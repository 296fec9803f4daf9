"""Learning robot control and reactive planning with structured models (after Sutanto, USC 2020)."""

__version__ = "0.1.0"
