"""Tracking with a dynamics model in the controller: sines like the training motion, and reaches (III.4)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain

import numpy as np
import pandas as pd
from pydantic import Field

from dissertation.dynamics.protocol.forms import Form
from dissertation.dynamics.world.arm_motion import (
    ReachingParameters,
    SineParameters,
    first_posture,
    joint_feedback,
    random_reaches,
    reaching_controller,
    sine_controller,
    sine_path,
)
from dissertation.dynamics.world.controlled_arm import (
    ControlledRun,
    FeedbackGains,
    ReferencePath,
    SimulatedArm,
    run_controller,
)
from dissertation.dynamics.world.operational_space import tool_motion
from structlearn.core.parallel import parallel_map
from structlearn.core.params import Parameters
from structlearn.rigid_body.compiled_dynamics import (
    InverseDynamics,
    friction_rows,
    inverse_dynamics,
)
from structlearn.rigid_body.dynamics_models import DynamicsModels, compiled_model
from structlearn.rigid_body.model_names import DEFAULT, GROUND_TRUTH, model_name

SHOWN_RATE_HZ = 25.0  # sampling rate of the paths kept for viewing
KNOWN = ""  # form of a model that is not learned


class TrackingParameters(Parameters):
    """Models that track, and their tasks."""

    models: tuple[str, ...]
    robot_models: tuple[str, ...]
    sine_s: float = Field(gt=0)
    reaching: ReachingParameters


@dataclass(frozen=True)
class Candidate:
    """A model to track with."""

    name: str
    form: str  # of its training; `KNOWN` if it was not learned
    seeds: tuple[int, ...]  # of its goals: the training seed, or all if it was not learned
    model: InverseDynamics


@dataclass(frozen=True)
class Testbed:
    """An arm and its tracking tasks."""

    __test__ = False  # tells pytest that this is no test class

    name: str  # of the arm
    seeds: tuple[int, ...]  # of the goals; a robot only has its own
    shown: int  # seed whose paths are kept
    arm: SimulatedArm  # its URDF determines the joints' feedback gains
    motion: SineParameters
    reaching: ReachingParameters

    @property
    def feedback(self) -> FeedbackGains:
        """Joint feedback gains."""
        robot = self.arm.robot
        return joint_feedback(robot.tree, robot.inertias, self.motion.feedback)


def known(testbed: Testbed) -> list[Candidate]:
    """Models of an arm that are not learned: the truth, and the URDF if it differs."""
    robot, true = testbed.arm.robot, testbed.arm.mechanics
    friction = friction_rows(np.stack([true.viscous, true.coulomb], axis=-1), ("viscous", "coulomb"))
    models = {GROUND_TRUTH: inverse_dynamics(robot.tree, true.inertias, friction)}
    if true.inertias is not robot.inertias:
        models[DEFAULT] = inverse_dynamics(robot.tree, robot.inertias)
    return [Candidate(name, KNOWN, testbed.seeds, model) for name, model in models.items()]


def learned(
    testbed: Testbed, outcomes: pd.DataFrame, read: Callable[[str, str], DynamicsModels]
) -> list[Candidate]:
    """Learned models that met the criterion, one candidate per seed.

    `read` returns the models of a form and name, in the order of this arm's outcomes of
    `trainings.train_all`.
    """
    return [
        Candidate(name, form, (row.seed,), compiled_model(read(form, name), place, testbed.arm.robot.tree))
        for (form, name), rows in outcomes.groupby(["form", "model"], sort=False)
        for place, row in enumerate(rows.itertuples())
        if row.met
    ]


def track(testbed: Testbed, candidates: Sequence[Candidate]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Track sines and reaches with every model.

    Errors are normalised by the variance of the reference: for sines per joint, then averaged; for reaches
    over all axes together. A stopped run (`controlled_arm.run_controller`) has a reason instead of scores.

    Returns:
        scores: one row per model, seed and task: `robot`, `model`, `form`, `seed`, `task` (`sine`, `reach`),
            `position_nmse`, `velocity_nmse` (NaN if stopped), `stopped` (reason, or empty), `duration_s`;
            of sines `feedback_share` (NaN if stopped), of reaches `acceleration_error_m_s2` (until stopped).
        paths: of the shown seed at 25 Hz: `robot`, `model`, `form`, `task`, `time_s`, one column per joint in
            rad, `tool_x` ... and `wanted_x` ... in m.
    """
    tables = parallel_map(partial(_track_one, testbed), candidates, f"tracking, {testbed.name}")
    scores, paths = zip(*tables, strict=True)
    none = pd.DataFrame()  # most robots keep no paths
    return pd.concat(scores, ignore_index=True), pd.concat([none, *chain(*paths)], ignore_index=True)


def _track_one(testbed: Testbed, candidate: Candidate) -> tuple[pd.DataFrame, list[pd.DataFrame]]:
    """Scores of one model, and paths of the shown seed; sines do not depend on the goals and run once."""
    sines = _follow_sines(testbed, candidate.model)
    runs = [("sine", seed, *sines) for seed in candidate.seeds]
    runs += [("reach", seed, *_reach(testbed, candidate.model, seed)) for seed in candidate.seeds]
    keys = {"robot": testbed.name, "model": candidate.name, "form": candidate.form}
    rows, paths = [], []
    for task, seed, moved, reference, found in runs:
        ended = {"stopped": moved.stopped or "", "duration_s": len(moved.q) / testbed.motion.rate_hz}
        rows.append(keys | {"seed": seed, "task": task} | found | ended)
        if seed == testbed.shown:
            paths.append(_path(testbed, keys | {"task": task}, moved, reference))
    return pd.DataFrame(rows), paths


def _follow_sines(
    testbed: Testbed, model: InverseDynamics
) -> tuple[ControlledRun, ReferencePath, dict[str, float]]:
    """ControlledRun of the sines, reference path of the joints, and scores.

    `feedback_share`: RMS of the feedback's torque over that of the drives, mean over joints; NaN if stopped.
    """
    reference, feedback = sine_path(testbed.arm.robot.tree, testbed.motion), testbed.feedback
    q, qd = reference.position, reference.velocity
    moved = run_controller(testbed.arm, sine_controller(model, reference, feedback), q[0], qd[0])
    scores = {
        f"{name}_nmse": float(np.mean(_squared_error(moved, found, wanted) / wanted.var(axis=0)))
        for name, found, wanted in (("position", moved.q, q), ("velocity", moved.qd, qd))
    }
    share = np.nan
    if not moved.stopped:
        added = feedback.stiffness * (q - moved.q) + feedback.damping * (qd - moved.qd)
        share = float(np.sqrt(np.mean(added**2, axis=0) / np.mean(moved.torques**2, axis=0)).mean())
    return moved, reference, scores | {"feedback_share": share}


def _reach(
    testbed: Testbed, model: InverseDynamics, seed: int
) -> tuple[ControlledRun, ReferencePath, dict[str, float]]:
    """ControlledRun of the random_reaches, reference path of the tool, and scores.

    `acceleration_error_m_s2`: RMS error of the tool's acceleration, which oscillations raise most.
    """
    tree, parameters = testbed.arm.robot.tree, testbed.reaching
    reference = random_reaches(tree, parameters, testbed.motion.rate_hz, seed)
    posture = first_posture(tree, parameters)
    controller = reaching_controller(tree, model, reference, testbed.feedback, parameters)
    moved = run_controller(testbed.arm, controller, posture, np.zeros_like(posture))
    x, xd = tool_motion(tree, parameters.tool_m, moved.q, moved.qd)
    scores = {
        f"{name}_nmse": float(_squared_error(moved, found, wanted).sum() / wanted.var(axis=0).sum())
        for name, found, wanted in (("position", x, reference.position), ("velocity", xd, reference.velocity))
    }
    off = np.diff(xd - reference.velocity[: len(xd)], axis=0) * testbed.motion.rate_hz
    rms = float(np.sqrt(np.mean(np.sum(off**2, axis=1)))) if len(off) else np.nan
    return moved, reference, scores | {"acceleration_error_m_s2": rms}


def _squared_error(moved: ControlledRun, found: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Mean squared error per column; NaN if the run was stopped."""
    if moved.stopped:
        return np.full(wanted.shape[1], np.nan)
    return np.mean((found - wanted) ** 2, axis=0)


def _path(
    testbed: Testbed, keys: dict[str, str], moved: ControlledRun, reference: ReferencePath
) -> pd.DataFrame:
    """Thinned tool and joint path of a run, with the tool's reference (from the joints' for sines)."""
    tree, rate_hz, tool_m = testbed.arm.robot.tree, testbed.motion.rate_hz, testbed.reaching.tool_m
    every = max(1, round(rate_hz / SHOWN_RATE_HZ))
    q, qd = moved.q[::every], moved.qd[::every]
    wanted = reference.position[: len(moved.q) : every]
    if keys["task"] == "sine":
        wanted, _ = tool_motion(tree, tool_m, wanted, reference.velocity[: len(moved.q) : every])
    tool, _ = tool_motion(tree, tool_m, q, qd)
    columns: dict[str, str | np.ndarray] = {**keys, "time_s": np.arange(len(q)) * every / rate_hz}
    columns |= dict(zip(tree.names, q.T, strict=True))
    for place, letter in enumerate("xyz"):
        columns |= {f"tool_{letter}": tool[:, place], f"wanted_{letter}": wanted[:, place]}
    return pd.DataFrame(columns)


@dataclass(frozen=True)
class TrackedReach:
    """Reaches of a model with the shown seed."""

    model: str  # key in `model_names`
    time: np.ndarray  # (T,) s
    joints: np.ndarray  # (T, n) rad
    tool: np.ndarray  # (T, 3) m, base frame
    wanted: np.ndarray  # (T, 3) m, reference of the tool
    velocity_nmse: float  # of the tool; NaN if stopped
    stopped: str  # reason; empty if the run was not stopped

    @property
    def label(self) -> str:
        """Display name of the model."""
        return model_name(self.model)

    @property
    def off_mm(self) -> np.ndarray:
        """Distance (T,) of the tool from its reference in mm."""
        return 1e3 * np.linalg.norm(self.tool - self.wanted, axis=1)

    @property
    def speeds(self) -> tuple[np.ndarray, np.ndarray]:
        """Speeds (T,) in m/s of the tool and of its reference; 0 at the start."""
        tool, wanted = (
            np.linalg.norm(np.diff(points, axis=0), axis=1) / np.diff(self.time)
            for points in (self.tool, self.wanted)
        )
        return np.concatenate([[0.0], tool]), np.concatenate([[0.0], wanted])


def tracked_reaches(
    paths: pd.DataFrame,
    scores: pd.DataFrame,
    robot: str,
    form: Form,
    models: Sequence[str],
    joints: Sequence[str] = (),
) -> list[TrackedReach]:
    """Reaches of each model with the shown seed; models without runs on this robot are left out.

    `paths` and `scores` are those of `track`; `joints` are columns of `paths`.
    """
    found = []
    for model in models:
        its = {"robot": robot, "model": model, "task": "reach"}
        path, score = (
            table[(table[list(its)] == pd.Series(its)).all(axis=1) & table["form"].isin((form, KNOWN))]
            for table in (paths, scores)
        )
        if len(path):
            first = score.sort_values("seed", kind="stable").iloc[0]
            reach = TrackedReach(
                model,
                time=path["time_s"].to_numpy(float),
                joints=path[list(joints)].to_numpy(float),
                tool=path[["tool_x", "tool_y", "tool_z"]].to_numpy(float),
                wanted=path[["wanted_x", "wanted_y", "wanted_z"]].to_numpy(float),
                velocity_nmse=float(first["velocity_nmse"]),
                stopped=first["stopped"],
            )
            found.append(reach)
    return found
