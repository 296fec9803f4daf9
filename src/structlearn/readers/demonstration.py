"""A demonstration as everything downstream sees it: all signals on one uniform clock."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from structlearn.core.errors import InputError
from structlearn.readers.recording import NamedShape


@dataclass(frozen=True)
class Demonstration:
    """Signals of one demonstration (or execution) on one uniform clock.

    Whether it was simulated, recorded by a robot or read from a user's bag makes no difference from here on.
    """

    name: str  # unique within its set; error messages and tables use it
    time: np.ndarray  # (T,) s, starts at 0, uniform step
    position: np.ndarray  # (T, 3) m, end-effector in the base frame
    # (T, 4) unit quaternion w, x, y, z, sign-continuous; None where not recorded
    orientation: np.ndarray | None = None
    # (T, 3) m/s where recorded; otherwise it is derived from the position when needed
    velocity: np.ndarray | None = None
    angular_velocity: np.ndarray | None = None  # (T, 3) rad/s in the base frame, where recorded
    joint_positions: np.ndarray | None = None  # (T, J) rad, where recorded
    joint_velocities: np.ndarray | None = None  # (T, J) rad/s, where recorded
    joint_torques: np.ndarray | None = None  # (T, J) N m, where recorded
    wrench: np.ndarray | None = None  # (T, 6) force in N, torque in N m, where recorded
    tactile: np.ndarray | None = None  # (T, E) sensor counts, where recorded
    # (T, 4) orientation of the tool relative to the board, sign-continuous, where recorded
    tool_to_board: np.ndarray | None = None
    joint_names: tuple[str, ...] = ()  # (J,) of the joints in the order of the columns, where known
    # (P, 2) start and end of each primitive in s, known only when simulated
    true_segments: np.ndarray | None = None
    # what is known of the origin (simulated or recorded, seed, source, licence)
    provenance: Mapping[str, str] = field(default_factory=dict)
    shapes: tuple[NamedShape, ...] = ()  # solids at rest around the movement, where recorded

    def __post_init__(self) -> None:
        length = len(self.time)
        if length < 2:
            raise InputError(f"{self.name}: needs at least two samples, has {length}")
        for signal in SIGNAL_UNITS:
            values = getattr(self, signal)
            if values is not None and len(values) != length:
                raise InputError(f"{self.name}: {signal} has {len(values)} samples, the clock has {length}")

    @property
    def dt(self) -> float:
        """Sampling interval in s."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1)

    def signal(self, name: str) -> np.ndarray:
        """One of `SIGNAL_UNITS`.

        Raises InputError: it was not recorded.
        """
        values = getattr(self, name)
        if values is None:
            raise InputError(f"{self.name}: has no {name}")
        return values

    @property
    def simulated(self) -> bool:
        """Whether the data come from a simulation."""
        return self.provenance.get("origin") == "simulated"


SIGNAL_UNITS = {
    "position": "m",
    "orientation": "",
    "velocity": "m/s",
    "angular_velocity": "rad/s",
    "joint_positions": "rad",
    "joint_velocities": "rad/s",
    "joint_torques": "N m",
    "wrench": "N, N m",
    "tactile": "counts",
    "tool_to_board": "",
}
"""Sampled signals of a demonstration; quaternions w, x, y, z have no unit, a wrench is force, then torque."""
