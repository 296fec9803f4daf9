"""Recordings for the rerun viewer; every call of rerun in the project is in this package.

Each function writes one complete .rrd file with its own blueprint. `demonstrations` shows what was recorded
and where it was cut, `alignment` why it was cut there, `primitives` what was learned from it. `executions`
compares runs of the scraping robot without and with feedback, `robot` shows one of them with its arm,
`refinement` what trial changed in the feedback and how it was searched for. They take the project's own
dataclasses and tables, whatever their origin; of demonstrations, signals that were not recorded are left out.
"""

from structlearn.viewer.alignment import write_alignment
from structlearn.viewer.demonstrations import write_demonstrations
from structlearn.viewer.executions import write_executions
from structlearn.viewer.primitives import write_primitives
from structlearn.viewer.refinement import write_refinement
from structlearn.viewer.robot import write_robot
from structlearn.viewer.shown_runs import read_refined_runs, read_shown_runs

__all__ = [
    "read_refined_runs",
    "read_shown_runs",
    "write_alignment",
    "write_demonstrations",
    "write_executions",
    "write_primitives",
    "write_refinement",
    "write_robot",
]
