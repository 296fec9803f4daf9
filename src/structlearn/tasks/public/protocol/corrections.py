"""Higher reaches as corrections of the nominal ones: their coupling targets, learned from the phase alone.

The reaches of the second set have the start and goal of the nominal ones and a higher arc. Their coupling
targets against the nominal primitive (eq. IV.23) are learned as a function of phase, without any sensor:

    c = w_c . (G(p, u) * b_m)          a phase-modulated network of input dimension 0 and no hidden layer

Such a network is linear in its features G, so its squared loss is convex: the least squares that the forcing
term is fitted with give its minimum at once, and nothing is trained.

Every split draws the reaches to learn from anew, since one draw of a few reaches to reproduce says little.
The splits share their reaches, so an interval over them would be too narrow: whoever compares two distances
takes each reach's mean over the splits that left it out.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.core import signals
from structlearn.core.errors import MissingInputError
from structlearn.core.metrics import nmse
from structlearn.core.params import Parameters
from structlearn.feedback.coupling import position_target
from structlearn.feedback.coupling_model import CouplingModel
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork, open_loop
from structlearn.primitives import canonical, kernels
from structlearn.primitives.position import PositionPrimitive, in_local_frame
from structlearn.primitives.trajectory import Trajectory, differentiated
from structlearn.primitives.vector import VectorPrimitive, sample_count
from structlearn.readers.demonstration import Demonstration

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
    `kernels.forcing_weights`; there is no other minimum.

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


SAMPLES = 500
"""Of a movement in normalised time, for distances and tables."""

END = 0.1
"""Last part of the movement that is looked at alone: there the phase velocity fades, and with it all that a
phase-modulated network can say."""


class CorrectionParameters(Parameters):
    """Parameters of the corrected reaches."""

    smoothing_hz: float = Field(gt=0)
    kernel_count: int = Field(ge=2, le=200)
    incomplete_m: float = Field(gt=0)
    learned_share: float = Field(gt=0, lt=1)
    splits: int = Field(ge=1)
    seed: int = Field(ge=0)


@dataclass(frozen=True)
class CorrectionResults:
    """What the splits show; every attribute is a table.

    Attributes:
        distances: per `split` and left-out `reach`: how many it was `learned_from`, and its mean distances
            over normalised time: `nominal_mm` and `coupling_mm` from the nominal primitive without and with
            the learned coupling (unrolled to the reach's own goal in its own duration, from the nominal
            reaches' mean initial state), `spread_mm` from the mean path of the reaches learned from, which
            a perfect memory of that mean would leave; and `end_share`, the part of the summed distance with
            coupling that the last `END` holds.
        profile: mean of the three distances over splits and left-out reaches: `fraction` of the duration,
            `phase`, `nominal_mm`, `coupling_mm`, `spread_mm`.
        targets: per `axis` and `fraction` with `phase`: `mean` and `std` of the targets over all reaches, and
            `learned`, the network's coupling of the first split, m.
        scores: per `split` and `axis`: `nmse` of the network on the left-out reaches' targets, and which part
            of the squared targets (`target_end_share`) and of the squared residuals (`residual_end_share`)
            the last `END` holds.
        paths: of the first split's left-out reaches in their local frames: `reach`, `path` (`recorded`,
            `nominal` or `coupling`), `fraction`, `x`, `y`, `z` in m.
    """

    distances: pd.DataFrame
    profile: pd.DataFrame
    targets: pd.DataFrame
    scores: pd.DataFrame
    paths: pd.DataFrame


def learn_corrections(
    reaches: Sequence[CorrectedReach], nominal: VectorPrimitive, parameters: CorrectionParameters
) -> tuple[Networks, CorrectionResults]:
    """Learn the coupling from some reaches and reproduce the others, for several random choices.

    Returns:
        The networks of the first split, and the results over all splits.

    Raises:
        MissingInputError: there are no two reaches, one to learn from and one to leave out.
    """
    if len(reaches) < 2:
        raise MissingInputError(f"{len(reaches)} complete corrected reaches; at least two are needed")
    curves = np.array([_curve(reach.path) for reach in reaches])
    nominal_curves = np.array([_curve(adapted_path(nominal, reach.path)) for reach in reaches])
    outcomes = []
    for split in range(parameters.splits):
        learned, left_out = _split(len(reaches), parameters, split)
        networks = phase_networks([reaches[place].target for place in learned], parameters.kernel_count)
        adapted = np.array(
            [_curve(adapted_path(nominal, reaches[place].path, networks)) for place in left_out]
        )
        distances_mm = {
            "nominal_mm": _distances_mm(nominal_curves[left_out], curves[left_out]),
            "coupling_mm": _distances_mm(adapted, curves[left_out]),
            "spread_mm": _distances_mm(curves[learned].mean(axis=0), curves[left_out]),
        }
        outcomes.append(_Outcome(left_out, networks, adapted, distances_mm))
    first = outcomes[0]
    results = CorrectionResults(
        distances=_over_splits(_distance_rows(outcome, reaches) for outcome in outcomes),
        profile=_profile(outcomes),
        targets=_target_table(reaches, first.networks),
        scores=_over_splits(_scores(outcome, reaches) for outcome in outcomes),
        paths=_path_table(first, reaches, {"recorded": curves, "nominal": nominal_curves}),
    )
    return first.networks, results


@dataclass(frozen=True)
class _Outcome:
    """One split: M reaches left out, S samples of normalised time."""

    left_out: np.ndarray  # (M,) their places
    networks: Networks
    adapted: np.ndarray  # (M, S, 3) nominal primitive with learned coupling, m
    distances_mm: dict[str, np.ndarray]  # by column of `CorrectionResults.distances`: (M, S)


def _split(count: int, parameters: CorrectionParameters, split: int) -> tuple[np.ndarray, np.ndarray]:
    """Places of the reaches learned from and of those left out, each in order."""
    order = np.random.default_rng([parameters.seed, split]).permutation(count)
    learned = min(max(round(parameters.learned_share * count), 1), count - 1)
    return np.sort(order[:learned]), np.sort(order[learned:])


def _curve(path: Trajectory) -> np.ndarray:
    return signals.time_normalised(path.position, SAMPLES)


def _distances_mm(paths: np.ndarray, references: np.ndarray) -> np.ndarray:
    """Distance at each sample: (..., S, 3), (..., S, 3) m -> (..., S) mm."""
    return 1e3 * np.linalg.norm(paths - references, axis=-1)


def _end_share(values: np.ndarray) -> np.ndarray:
    """Share of the sum over normalised time (last axis) that lies in the last `END`."""
    first = round((1.0 - END) * values.shape[-1])
    return values[..., first:].sum(axis=-1) / values.sum(axis=-1)


def _clock() -> dict[str, np.ndarray]:
    fraction = np.linspace(0.0, 1.0, SAMPLES)
    return {"fraction": fraction, "phase": canonical.phase(fraction, canonical.TAU_PER_DURATION)[0]}


def _over_splits(tables: Iterable[pd.DataFrame]) -> pd.DataFrame:
    numbered = [table.assign(split=split) for split, table in enumerate(tables)]
    return pd.concat(numbered, ignore_index=True)


def _distance_rows(outcome: _Outcome, reaches: Sequence[CorrectedReach]) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "reach": [reaches[place].name for place in outcome.left_out],
            "learned_from": len(reaches) - len(outcome.left_out),
            **{name: values.mean(axis=1) for name, values in outcome.distances_mm.items()},
            "end_share": _end_share(outcome.distances_mm["coupling_mm"]),
        }
    )


def _profile(outcomes: Sequence[_Outcome]) -> pd.DataFrame:
    columns = {
        name: np.mean([outcome.distances_mm[name].mean(axis=0) for outcome in outcomes], axis=0)
        for name in outcomes[0].distances_mm
    }
    return pd.DataFrame(_clock() | columns)


def _target_table(reaches: Sequence[CorrectedReach], networks: Networks) -> pd.DataFrame:
    stretched = np.array([signals.time_normalised(reach.target, SAMPLES) for reach in reaches])
    mean, std, learned = stretched.mean(axis=0), stretched.std(axis=0), phase_coupling(networks, SAMPLES)
    tables = [
        pd.DataFrame({"axis": axis, **_clock(), "mean": m, "std": s, "learned": c})
        for axis, m, s, c in zip(AXES, mean.T, std.T, learned.T, strict=True)
    ]
    return pd.concat(tables, ignore_index=True)


def _scores(outcome: _Outcome, reaches: Sequence[CorrectedReach]) -> pd.DataFrame:
    """One row per axis, see `CorrectionResults.scores`."""
    targets = np.array([signals.time_normalised(reaches[i].target, SAMPLES) for i in outcome.left_out])
    learned = np.broadcast_to(phase_coupling(outcome.networks, SAMPLES), targets.shape)  # (M, S, 3)
    squared, residual = ((values**2).sum(axis=0).T for values in (targets, targets - learned))  # (3, S)
    stacked = (-1, len(AXES))
    return pd.DataFrame(
        {
            "axis": AXES,
            "nmse": nmse(learned.reshape(stacked), targets.reshape(stacked)),
            "target_end_share": _end_share(squared),
            "residual_end_share": _end_share(residual),
        }
    )


def _path_table(
    outcome: _Outcome, reaches: Sequence[CorrectedReach], curves: dict[str, np.ndarray]
) -> pd.DataFrame:
    """Paths of the left-out reaches; `curves`: (L, S, 3) of all reaches by kind."""
    fraction = _clock()["fraction"]
    kinds = {kind: values[outcome.left_out] for kind, values in curves.items()} | {
        "coupling": outcome.adapted
    }
    tables = [
        pd.DataFrame(
            {
                "reach": reaches[place].name,
                "path": kind,
                "fraction": fraction,
                **dict(zip(AXES, curve.T, strict=True)),
            }
        )
        for kind, its in kinds.items()
        for place, curve in zip(outcome.left_out, its, strict=True)
    ]
    return pd.concat(tables, ignore_index=True)
