"""Recordings for the rerun viewer; every call of rerun in the project is in this package.

Each function writes one complete .rrd file with its own blueprint. `demonstrations` shows what was recorded
and where it was cut, `alignment` why it was cut there, `primitives` what was learned from it. They take the
project's own dataclasses and tables, whatever their origin; signals that were not recorded are not shown.
"""

from structlearn.viewer.alignment import write_alignment
from structlearn.viewer.demonstrations import write_demonstrations
from structlearn.viewer.primitives import write_primitives

__all__ = ["write_alignment", "write_demonstrations", "write_primitives"]
