"""Higher reaches as corrections of the nominal ones: the coupling term they ask for, and phase alone for it.

The reaches of the second set have the start and goal of the nominal ones and a higher arc. Their coupling
targets against the nominal primitive (eq. IV.23) are learned as a function of phase, without any sensor:

    c = w_c . (G(p, u) * b_m)          a phase-modulated network of input dimension 0 and no hidden layer

Such a network is linear in its features G, so its squared loss is convex: the least squares that the forcing
term is fitted with give its minimum at once, and nothing is trained.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from structlearn.feedback.coupling import position_target
from structlearn.feedback.coupling_model import CouplingModel
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork, open_loop
from structlearn.primitives import canonical, kernels
from structlearn.primitives.position import PositionPrimitive, in_local_frame
from structlearn.primitives.trajectory import Trajectory, differentiated
from structlearn.primitives.vector import VectorPrimitive, sample_count
from structlearn.recordings.demonstration import Demonstration

AXES = ("x", "y", "z")
"""Of the local frame: x from start to goal, z upwards, y to the side."""

Networks = Sequence[tuple[str, CouplingModel]]
"""One network per local axis, by its name in `AXES`."""


@dataclass(frozen=True)
class CorrectedReach:
    """One complete corrected reach.

    Attributes:
        name: of the recording.
        path: (T, 3) relative to its start, in its local frame.
        target: (T, 3) coupling target of each local axis, in m: c is an acceleration times tau^2.
    """

    name: str
    path: Trajectory
    target: np.ndarray


def completeness(
    demonstrations: Sequence[Demonstration], nominal: PositionPrimitive, largest_m: float
) -> pd.DataFrame:
    """Which higher reaches start and end where the nominal ones do.

    One that begins or ends in mid-air has no start or no goal, hence no local frame and no coupling target.

    Args:
        demonstrations: the higher reaches.
        nominal: position primitive of the nominal reaches.
        largest_m: between the ends of a complete reach and the primitive's.

    Returns:
        Per `reach`: `start_off_mm`, `goal_off_mm`, and whether it is `complete`.
    """
    off_mm = 1e3 * np.array(
        [
            np.linalg.norm(one.position[[0, -1]] - [nominal.start, nominal.goal], axis=1)
            for one in demonstrations
        ]
    )
    return pd.DataFrame(
        {
            "reach": [one.name for one in demonstrations],
            "start_off_mm": off_mm[:, 0],
            "goal_off_mm": off_mm[:, 1],
            "complete": off_mm.max(axis=1) <= 1e3 * largest_m,
        }
    )


def complete(demonstrations: Sequence[Demonstration], completeness: pd.DataFrame) -> list[Demonstration]:
    """Those that are complete."""
    names = set(completeness.loc[completeness["complete"], "reach"])
    return [one for one in demonstrations if one.name in names]


def corrected_reaches(
    demonstrations: Sequence[Demonstration], nominal: PositionPrimitive, smoothing_hz: float
) -> list[CorrectedReach]:
    """Corrected reaches with the coupling term that each asks of the nominal primitive.

    Args:
        demonstrations: complete ones.
        nominal: position primitive of the nominal reaches.
        smoothing_hz: cut-off of the low-pass.

    Returns:
        In the order of the demonstrations.
    """
    reaches = []
    for demonstration in demonstrations:
        smooth = differentiated(demonstration.position, demonstration.dt, smoothing_hz)
        path = in_local_frame(smooth, nominal.frame)
        target = position_target(path, nominal.local, goal=path.position[-1])
        reaches.append(CorrectedReach(demonstration.name, path, target))
    return reaches


def phase_networks(
    targets: Sequence[np.ndarray], kernel_count: int = kernels.KERNEL_COUNT
) -> list[tuple[str, PhaseModulatedNetwork]]:
    """Phase-only networks at the minimum of their squared loss.

    Only the products of w_c and b_m count, so w_c is 1 and b_m solves the ridge regression of
    `primitives.regression`; there is no other minimum.

    Args:
        targets: per reach (T_l, 3) coupling targets on a uniform clock from start to end.
        kernel_count: number of phase features N.

    Returns:
        One network per local axis; its input has dimension 0.
    """
    weights = kernels.forcing_weights(targets, count=kernel_count)  # (N, 3)
    return [(axis, open_loop(biases)) for axis, biases in zip(AXES, weights.T, strict=True)]


def phase_coupling(networks: Networks, samples: int) -> np.ndarray:
    """Coupling term (samples, 3) of phase-only networks from start to end; it does not depend on duration."""
    phases = canonical.phase(np.linspace(0.0, 1.0, samples), canonical.TAU_PER_DURATION)
    nothing = np.zeros((samples, 0))
    return np.column_stack([network.coupling(nothing, *phases) for _, network in networks])


def adapted_path(nominal: VectorPrimitive, reach: Trajectory, networks: Networks | None = None) -> Trajectory:
    """The nominal primitive to the goal and in the time of a reach, with learned coupling in the loop.

    Args:
        nominal: the nominal reaches' movement in the local frame.
        reach: (T, 3) relative to its start, in its local frame.
        networks: the feedback model; None: the nominal path itself.

    Returns:
        (T, 3) path in the same frame, at the reach's samples.
    """
    if networks is None:
        return nominal.unroll(reach.dt, reach.position[0], reach.position[-1], reach.duration)
    terms = phase_coupling(networks, len(reach.time))
    return nominal.unroll(
        reach.dt, reach.position[0], reach.position[-1], reach.duration, coupling=lambda k, x, xd: terms[k]
    )


def typical_paths(
    nominal: PositionPrimitive, demonstrations: Sequence[Demonstration], networks: Networks
) -> dict[str, Trajectory]:
    """The nominal primitive in the mean situation of corrected reaches, without and with learned coupling.

    Args:
        nominal: position primitive of the nominal reaches.
        demonstrations: the corrected reaches, complete ones.
        networks: the feedback model.

    Returns:
        `nominal` and `adapted`: (T, 3) paths in the base frame.
    """
    start, goal = (np.mean([one.position[end] for one in demonstrations], axis=0) for end in (0, -1))
    duration = float(np.mean([one.time[-1] for one in demonstrations]))
    dt = demonstrations[0].dt
    terms = phase_coupling(networks, sample_count(duration, dt))
    return {
        "nominal": nominal.unroll(dt, start, goal, duration),
        "adapted": nominal.unroll(dt, start, goal, duration, coupling=lambda k, x, xd: terms[k]),
    }
