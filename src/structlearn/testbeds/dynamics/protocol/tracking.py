"""How well an arm follows with a model in its controller: sines it learned from, and reaches (III.4)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.core.parallel import parallel_map
from structlearn.core.params import Parameters
from structlearn.rigid_body.compiled_dynamics import InverseDynamics, bodies_model, inverse_dynamics
from structlearn.rigid_body.dynamics_models import DynamicsModels, compiled_model
from structlearn.rigid_body.model_names import model_name
from structlearn.rigid_body.operational_space_velocity import tool_motion
from structlearn.rigid_body.training_grid import Form
from structlearn.testbeds.dynamics.world.arm_motion import (
    Feedback,
    JointPath,
    ReachingParameters,
    SineParameters,
    first_posture,
    joint_feedback,
    reaches,
    reaching_controller,
    sine_controller,
    sine_path,
)
from structlearn.testbeds.dynamics.world.controlled_arm import Run, SimulatedArm, run

SHOWN_RATE_HZ = 25.0
"""Of the paths that are kept to be looked at."""

KNOWN = ""
"""Form of a model that is known instead of learned."""


class TrackingParameters(Parameters):
    """Models and tasks."""

    models: tuple[str, ...]
    robot_models: tuple[str, ...]
    sine_s: float = Field(gt=0)
    reaching: ReachingParameters


@dataclass(frozen=True)
class Candidate:
    """A model to be put into the controller.

    Attributes:
        name: of the model.
        form: of its training; `KNOWN` for one that was not learned.
        seeds: of the goals it reaches for; a learned model has that of its training, one that was not learned
            has all.
        model: itself.
    """

    name: str
    form: str
    seeds: tuple[int, ...]
    model: InverseDynamics


@dataclass(frozen=True)
class Testbed:
    """An arm and its tasks.

    Attributes:
        name: of the arm.
        seeds: of the goals; a robot has its own alone.
        shown: seed of the paths that are kept.
        arm: itself; the gains of the joints come from its URDF.
        motion: the sines.
        reaching: the reaches.
    """

    __test__ = False  # not a test, whatever pytest thinks of its name

    name: str
    seeds: tuple[int, ...]
    shown: int
    arm: SimulatedArm
    motion: SineParameters
    reaching: ReachingParameters

    @property
    def feedback(self) -> Feedback:
        """Of the joints."""
        robot = self.arm.robot
        return joint_feedback(robot.tree, robot.inertias, self.motion.feedback)


def known(testbed: Testbed) -> list[Candidate]:
    """What is known of an arm: the truth, and the URDF where the truth is another."""
    robot, true = testbed.arm.robot, testbed.arm.mechanics
    truth = Candidate("ground_truth", KNOWN, testbed.seeds, _true_model(testbed))
    if true.inertias is robot.inertias:
        return [truth]
    default = bodies_model(inverse_dynamics(robot.tree, robot.inertias))
    return [truth, Candidate("default", KNOWN, testbed.seeds, default)]


def learned(
    testbed: Testbed, outcomes: pd.DataFrame, read: Callable[[str, str], DynamicsModels]
) -> list[Candidate]:
    """Learned models, one candidate for each that met the criterion: of others nothing would follow.

    `read` gives the models of a form and name, in the order of the outcomes (of `training_grid.train`, of
    this arm).
    """
    return [
        Candidate(name, form, (row.seed,), compiled_model(read(form, name), place, testbed.arm.robot.tree))
        for (form, name), rows in outcomes.groupby(["form", "model"], sort=False)
        for place, row in enumerate(rows.itertuples())
        if row.met
    ]


def track(testbed: Testbed, candidates: Sequence[Candidate]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Let the arm follow sines and reaches with every model.

    Errors are normalised by the variance of the reference: of sines per joint, then averaged; of reaches
    over all axes. A run that was stopped (see `controlled_arm.run`) has no score and says why.

    Returns:
        scores: a row per model, seed and task: `robot`, `model`, `form`, `seed`, `task` (`sine`, `reach`),
            `position_nmse`, `velocity_nmse` (NaN where it was stopped), `stopped` (empty where it ran
            through), `duration_s`.
        paths: of the shown seed, 25 Hz: `robot`, `model`, `form`, `task`, `time_s`, a column per joint in
            rad, `tool_x` ... and `wanted_x` ... in m.
    """
    tables = parallel_map(partial(_track_one, testbed), candidates, f"tracking, {testbed.name}")
    scores, paths = zip(*tables, strict=True)
    none = pd.DataFrame()  # robots but one have no paths that are kept
    return pd.concat(scores, ignore_index=True), pd.concat([none, *chain(*paths)], ignore_index=True)


def _track_one(testbed: Testbed, candidate: Candidate) -> tuple[pd.DataFrame, list[pd.DataFrame]]:
    """Scores of one model, and paths of the shown seed; the sines are the same for all goals and run once."""
    motion = testbed.motion
    rows, paths = [], []
    moved, path, errors = _follow_sines(testbed, candidate.model)
    rows += [_score(candidate, seed, "sine", moved, errors, motion) for seed in candidate.seeds]
    if testbed.shown in candidate.seeds:
        wanted, _ = tool_motion(testbed.arm.robot.tree, testbed.reaching.tool_m, path.q, path.qd)
        paths.append(_path(testbed, candidate, "sine", moved, wanted))
    for seed in candidate.seeds:
        moved, wanted, errors = _reach(testbed, candidate.model, seed)
        rows.append(_score(candidate, seed, "reach", moved, errors, motion))
        if seed == testbed.shown:
            paths.append(_path(testbed, candidate, "reach", moved, wanted))
    scores = pd.DataFrame(rows)
    scores.insert(0, "robot", testbed.name)
    return scores, paths


def _follow_sines(testbed: Testbed, model: InverseDynamics) -> tuple[Run, JointPath, tuple[float, float]]:
    """The run, what it should be, and the errors of q and qd."""
    reference = sine_path(testbed.arm.robot.tree, testbed.motion)
    q, qd = reference.q, reference.qd
    moved = run(testbed.arm, sine_controller(model, reference, testbed.feedback), q[0], qd[0])
    position, velocity = (
        float(np.mean(_squared_error(moved, found, wanted) / wanted.var(axis=0)))
        for found, wanted in ((moved.q, q), (moved.qd, qd))
    )
    return moved, reference, (position, velocity)


def _reach(
    testbed: Testbed, model: InverseDynamics, seed: int
) -> tuple[Run, np.ndarray, tuple[float, float]]:
    """The run, the tool's wanted positions (T, 3), and the errors of x and xd."""
    tree, parameters = testbed.arm.robot.tree, testbed.reaching
    reference = reaches(tree, parameters, testbed.motion.rate_hz, seed)
    posture = first_posture(tree, parameters)
    controller = reaching_controller(tree, model, reference, testbed.feedback, parameters)
    moved = run(testbed.arm, controller, posture, np.zeros_like(posture))
    x, xd = tool_motion(tree, parameters.tool_m, moved.q, moved.qd)
    position, velocity = (
        float(_squared_error(moved, found, wanted).sum() / wanted.var(axis=0).sum())
        for found, wanted in ((x, reference.x), (xd, reference.xd))
    )
    return moved, reference.x, (position, velocity)


def _true_model(testbed: Testbed) -> InverseDynamics:
    true = testbed.arm.mechanics
    friction = np.stack([true.viscous, true.coulomb, np.zeros_like(true.viscous)])
    return bodies_model(inverse_dynamics(testbed.arm.robot.tree, true.inertias, friction))


def _squared_error(moved: Run, found: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Mean squared error per column; NaN where the run was stopped."""
    if moved.stopped:
        return np.full(wanted.shape[1], np.nan)
    return np.mean((found - wanted) ** 2, axis=0)


def _score(
    candidate: Candidate,
    seed: int,
    task: str,
    moved: Run,
    errors: tuple[float, float],
    motion: SineParameters,
) -> dict[str, object]:
    return {
        "model": candidate.name,
        "form": candidate.form,
        "seed": seed,
        "task": task,
        "position_nmse": errors[0],
        "velocity_nmse": errors[1],
        "stopped": moved.stopped or "",
        "duration_s": len(moved.q) / motion.rate_hz,
    }


def _path(testbed: Testbed, candidate: Candidate, task: str, moved: Run, wanted: np.ndarray) -> pd.DataFrame:
    every = max(1, round(testbed.motion.rate_hz / SHOWN_RATE_HZ))
    tree = testbed.arm.robot.tree
    q, qd = moved.q[::every], moved.qd[::every]
    tool, _ = tool_motion(tree, testbed.reaching.tool_m, q, qd)
    columns: dict[str, str | np.ndarray] = {"robot": testbed.name, "model": candidate.name}
    columns |= {"form": candidate.form, "task": task}
    columns["time_s"] = np.arange(len(q)) * every / testbed.motion.rate_hz
    columns |= dict(zip(tree.names, q.T, strict=True))
    for place, letter in enumerate("xyz"):
        columns[f"tool_{letter}"] = tool[:, place]
        columns[f"wanted_{letter}"] = wanted[: len(moved.q) : every][:, place]
    return pd.DataFrame(columns)


@dataclass(frozen=True)
class TrackedReach:
    """The reaches of a model's shown seed.

    Attributes:
        model: its key.
        time: (T,) s.
        joints: (T, n) rad.
        tool: (T, 3) m, base frame.
        wanted: (T, 3) m, where the tool should be.
        velocity_nmse: of the tool; NaN where it was stopped.
        stopped: why it was stopped; empty where it ran through.
    """

    model: str
    time: np.ndarray
    joints: np.ndarray
    tool: np.ndarray
    wanted: np.ndarray
    velocity_nmse: float
    stopped: str

    @property
    def label(self) -> str:
        """Name of the model."""
        return model_name(self.model)

    @property
    def off_mm(self) -> np.ndarray:
        """(T,) distance of the tool from where it should be."""
        return 1e3 * np.linalg.norm(self.tool - self.wanted, axis=1)

    @property
    def speeds(self) -> tuple[np.ndarray, np.ndarray]:
        """(T,) m/s of the tool, and as it should be; 0 at the start."""
        return _speed(self.tool, self.time), _speed(self.wanted, self.time)


def tracked_reaches(
    paths: pd.DataFrame,
    scores: pd.DataFrame,
    robot: str,
    form: Form,
    models: Sequence[str],
    joints: Sequence[str] = (),
) -> list[TrackedReach]:
    """The reaches of each model's shown seed; models that did not track with this robot are left out.

    Paths and scores are those of `track`; `joints` are columns of the paths.
    """
    chosen = [
        (model, *(_reach_rows(table, robot, form, model) for table in (paths, scores))) for model in models
    ]
    return [_tracked_reach(model, path, score, joints) for model, path, score in chosen if len(path)]


def _tracked_reach(
    model: str, rows: pd.DataFrame, scores: pd.DataFrame, joints: Sequence[str]
) -> TrackedReach:
    first = scores.sort_values("seed").iloc[0]
    tool, wanted = (
        rows[[f"{prefix}_{axis}" for axis in "xyz"]].to_numpy(float) for prefix in ("tool", "wanted")
    )
    time, angles = rows["time_s"].to_numpy(float), rows[list(joints)].to_numpy(float)
    return TrackedReach(model, time, angles, tool, wanted, float(first["velocity_nmse"]), first["stopped"])


def _reach_rows(table: pd.DataFrame, robot: str, form: Form, model: str) -> pd.DataFrame:
    reaches = table[(table["robot"] == robot) & (table["model"] == model) & (table["task"] == "reach")]
    return reaches[reaches["form"].isin((form, KNOWN))]


def _speed(points: np.ndarray, time: np.ndarray) -> np.ndarray:
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1) / np.diff(time)
    return np.concatenate([[0.0], steps])
