"""Coupling as a function of phase alone, learned from corrected runs of a primitive (IV.6).

Corrected runs share start and goal with the nominal ones but take another path. Their coupling targets
against the nominal primitive (eq. IV.23) are learned as a function of phase, without any sensor:

    c = w_c . (G(p, u) * b_m)          a phase-modulated network of input dimension 0 and no hidden layer

Such a network is linear in its features G, so its squared loss is convex: the least squares used for the
forcing term give its minimum directly, without training.

Every split draws its training runs anew, since a single draw of a few test runs says little. The splits share
their runs, so an interval over splits would be too narrow: to compare two distances, take each run's mean
over the splits that left it out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from structlearn.core import signals
from structlearn.core.errors import MissingInputError
from structlearn.core.metrics import nmse
from structlearn.feedback.coupling import position_target
from structlearn.feedback.coupling_model import CouplingModel
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork, open_loop
from structlearn.primitives import canonical, kernels
from structlearn.primitives.position import PositionPrimitive, in_local_frame
from structlearn.primitives.trajectory import Trajectory, differentiated
from structlearn.primitives.vector import VectorPrimitive, sample_count
from structlearn.readers.demonstration import Demonstration
from structlearn.tasks.movement.parameters import PhaseCorrectionParameters

AXES = ("x", "y", "z")  # of the local frame: x from start to goal, z upwards, y sideways
SAMPLES = 500  # per movement in normalised time, for distances and tables
# Last fraction of the movement, reported separately: there the phase velocity vanishes, and with it the
# output of a phase-modulated network
END = 0.1
LEARNED_SHARE = 0.7  # of the complete runs, in every split: enough of the few to learn from
SEED = 1  # of the splits
Networks = Sequence[tuple[str, CouplingModel]]  # one network per local axis, by name in `AXES`


@dataclass(frozen=True)
class CorrectedRun:
    """One complete corrected run."""

    name: str  # of the recording
    path: Trajectory  # (T, 3) m relative to its start, in its local frame
    target: np.ndarray  # (T, 3) coupling target on each local axis, in m: c is an acceleration times tau^2


def completeness(runs: Sequence[Demonstration], nominal: PositionPrimitive, largest_m: float) -> pd.DataFrame:
    """Check which corrected runs start and end where the nominal ones do.

    A run that starts or ends in mid-air lacks a start or goal, hence a local frame and coupling targets.
    Returns `run`, `start_off_mm`, `goal_off_mm`, and whether it is `complete`.
    """
    ends = np.array([run.position[[0, -1]] for run in runs]) - [nominal.start, nominal.goal]
    off_mm = 1e3 * np.linalg.norm(ends, axis=2)
    return pd.DataFrame(
        {
            "run": [run.name for run in runs],
            "start_off_mm": off_mm[:, 0],
            "goal_off_mm": off_mm[:, 1],
            "complete": off_mm.max(axis=1) <= 1e3 * largest_m,
        }
    )


def complete(runs: Sequence[Demonstration], completeness: pd.DataFrame) -> list[Demonstration]:
    """Select the complete runs."""
    names = set(completeness.loc[completeness["complete"], "run"])
    return [run for run in runs if run.name in names]


def runs_with_coupling(
    runs: Sequence[Demonstration], nominal: PositionPrimitive, smoothing_hz: float
) -> list[CorrectedRun]:
    """Corrected runs with the coupling term that each requires of the nominal primitive."""
    corrected = []
    for run in runs:
        path = in_local_frame(differentiated(run.position, run.dt, smoothing_hz), nominal.frame)
        target = position_target(path, nominal.local, goal=path.position[-1])
        corrected.append(CorrectedRun(run.name, path, target))
    return corrected


def phase_networks(
    targets: Sequence[np.ndarray], kernel_count: int = kernels.KERNEL_COUNT
) -> list[tuple[str, PhaseModulatedNetwork]]:
    """Phase-only networks at the minimum of their squared loss, one per local axis.

    Only the products of w_c and b_m matter, so w_c is 1 and b_m solves the ridge regression of
    `kernels.forcing_weights`; the minimum is unique.
    """
    weights = kernels.forcing_weights(targets, count=kernel_count)  # (N, 3)
    return [(axis, open_loop(biases)) for axis, biases in zip(AXES, weights.T, strict=True)]


def phase_coupling(networks: Networks, samples: int) -> np.ndarray:
    """Coupling term (samples, 3) of phase-only networks from start to end, independent of duration."""
    phases = canonical.phase(np.linspace(0.0, 1.0, samples), canonical.TAU_PER_DURATION)
    nothing = np.zeros((samples, 0))
    return np.column_stack([network.coupling(nothing, *phases) for _, network in networks])


def adapted_path(nominal: VectorPrimitive, run: Trajectory, networks: Networks | None = None) -> Trajectory:
    """Unroll the nominal primitive to a run's goal in its duration, optionally with learned coupling."""
    terms = None if networks is None else phase_coupling(networks, len(run.time))
    coupling = None if terms is None else lambda k, x, xd: terms[k]
    return nominal.unroll(run.dt, run.position[0], run.position[-1], run.duration, coupling=coupling)


def typical_paths(
    nominal: PositionPrimitive, runs: Sequence[Demonstration], networks: Networks
) -> dict[str, Trajectory]:
    """Nominal primitive in the mean situation of corrected runs, without and with learned coupling.

    Returns `nominal` and `coupling`: (T, 3) paths in the base frame.
    """
    start, goal = (np.mean([run.position[end] for run in runs], axis=0) for end in (0, -1))
    duration, dt = float(np.mean([run.time[-1] for run in runs])), runs[0].dt
    terms = phase_coupling(networks, sample_count(duration, dt))
    return {
        "nominal": nominal.unroll(dt, start, goal, duration),
        "coupling": nominal.unroll(dt, start, goal, duration, coupling=lambda k, x, xd: terms[k]),
    }


def learn_corrections(
    runs: Sequence[CorrectedRun], nominal: VectorPrimitive, parameters: PhaseCorrectionParameters
) -> tuple[Networks, dict[str, pd.DataFrame]]:
    """Learn the coupling from some runs and reproduce the others, for several random splits.

    Returns the networks of the first split, and tables:

    distances: by `split` and left-out `run`: number `learned_from`; mean distances over normalised time from
        the nominal primitive without and with learned coupling, unrolled to the run's goal in its duration
        from the nominal runs' mean initial state (`nominal_mm`, `coupling_mm`), and from the mean of the
        training runs (`spread_mm`); `end_share` of the distance with coupling in the last `END`.
    profile: these distances over `fraction` of the duration and `phase`, mean over splits and left-out runs.
    targets: by `axis` and `fraction`, with `phase`, in m: `mean` and `std` of all targets, and the coupling
        `learned` in the first split.
    scores: by `split` and `axis`: `nmse` on left-out targets, and shares of the squared targets and residuals
        in the last `END` (`target_end_share`, `residual_end_share`).
    paths: the first split's left-out runs in local frames: `run`, `path` (`recorded`, `nominal` or
        `coupling`), `fraction`, `x`, `y`, `z` in m.

    Raises MissingInputError: fewer than two runs.
    """
    if len(runs) < 2:
        raise MissingInputError(f"{len(runs)} complete corrected runs; at least two are needed")
    curves = np.array([_curve(run.path) for run in runs])  # (L, S, 3) m
    unchanged = np.array([_curve(adapted_path(nominal, run.path)) for run in runs])
    targets = np.array([signals.time_normalised(run.target, SAMPLES) for run in runs])
    fraction = np.linspace(0.0, 1.0, SAMPLES)
    clock = {"fraction": fraction, "phase": canonical.phase(fraction, canonical.TAU_PER_DURATION)[0]}
    networks, profiles = [], []
    frames: dict[str, list[pd.DataFrame]] = {"distances": [], "scores": [], "paths": []}
    for split in range(parameters.splits):
        seen, unseen = _split(len(runs), split)
        networks.append(phase_networks([runs[place].target for place in seen], parameters.kernel_count))
        coupled = np.array([_curve(adapted_path(nominal, runs[at].path, networks[-1])) for at in unseen])
        paths = {"nominal": unchanged[unseen], "coupling": coupled, "spread": curves[seen].mean(axis=0)}
        away = {
            f"{name}_mm": 1e3 * np.linalg.norm(path - curves[unseen], axis=-1) for name, path in paths.items()
        }  # (M, S) each
        profiles.append(pd.DataFrame({name: mm.mean(axis=0) for name, mm in away.items()}))
        names = [runs[place].name for place in unseen]
        distances = {name: mm.mean(axis=1) for name, mm in away.items()}
        distances |= {"end_share": _end_share(away["coupling_mm"]), "split": split}
        frames["distances"].append(pd.DataFrame({"run": names, "learned_from": len(seen)} | distances))
        frames["scores"].append(_scores(networks[-1], targets[unseen]).assign(split=split))
        if split == 0:
            shown = {"recorded": curves[unseen], "nominal": paths["nominal"], "coupling": coupled}
            frames["paths"] = [
                pd.DataFrame(
                    {"run": name, "path": kind, "fraction": fraction} | dict(zip(AXES, curve.T, strict=True))
                )
                for kind, path in shown.items()
                for name, curve in zip(names, path, strict=True)
            ]
    tables = {name: pd.concat(parts, ignore_index=True) for name, parts in frames.items()}
    tables["profile"] = pd.DataFrame(
        clock | {name: np.mean([profile[name] for profile in profiles], axis=0) for name in profiles[0]}
    )
    mean, std, learned = targets.mean(axis=0), targets.std(axis=0), phase_coupling(networks[0], SAMPLES)
    by_axis = [
        {"axis": axis} | clock | {"mean": mean[:, at], "std": std[:, at], "learned": learned[:, at]}
        for at, axis in enumerate(AXES)
    ]
    tables["targets"] = pd.concat(map(pd.DataFrame, by_axis), ignore_index=True)
    return networks[0], tables


def _split(count: int, split: int) -> tuple[np.ndarray, np.ndarray]:
    """Sorted indices of the training runs and of those left out."""
    order = np.random.default_rng([SEED, split]).permutation(count)
    learned = min(max(round(LEARNED_SHARE * count), 1), count - 1)
    return np.sort(order[:learned]), np.sort(order[learned:])


def _scores(networks: Networks, targets: np.ndarray) -> pd.DataFrame:
    """Scores by axis, see `learn_corrections`; `targets` (M, S, 3) are of left-out runs."""
    learned = np.broadcast_to(phase_coupling(networks, SAMPLES), targets.shape)
    squared, residual = ((values**2).sum(axis=0).T for values in (targets, targets - learned))  # (3, S)
    return pd.DataFrame(
        {
            "axis": AXES,
            "nmse": nmse(learned.reshape(-1, len(AXES)), targets.reshape(-1, len(AXES))),
            "target_end_share": _end_share(squared),
            "residual_end_share": _end_share(residual),
        }
    )


def _curve(path: Trajectory) -> np.ndarray:
    return signals.time_normalised(path.position, SAMPLES)


def _end_share(values: np.ndarray) -> np.ndarray:
    """Share of the sum over normalised time (last axis) in the last `END`."""
    first = round((1.0 - END) * values.shape[-1])
    return values[..., first:].sum(axis=-1) / values.sum(axis=-1)
