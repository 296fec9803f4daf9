"""structlearn: learning robot control and reactive planning with structured models."""

__version__ = "0.1.0"
