"""How well an arm follows with a model in its controller: sines it learned from, and reaches (III.4)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.ground.parallel import parallel_map
from structlearn.ground.params import Parameters
from structlearn.rigid_body.compiled_dynamics import InverseDynamics, inverse_dynamics
from structlearn.rigid_body.compiled_models import compiled_model
from structlearn.rigid_body.model_files import DynamicsModels
from structlearn.rigid_body.model_learning import Loss
from structlearn.rigid_body.operational_space_velocity import tool_motion
from structlearn.rigid_body.tree import Robot
from structlearn.simulation.arm import Arm, Mechanics
from structlearn.testbeds.dynamics.world.arm_motion import (
    Feedback,
    Run,
    SineParameters,
    joint_feedback,
    run,
    sine_path,
    sine_policy,
)
from structlearn.testbeds.dynamics.world.reaching import (
    ReachingParameters,
    first_posture,
    reaches,
    reaching_policy,
)

SHOWN_RATE_HZ = 25.0
SHOWN_SEED = 0
"""Of the paths that are kept to be looked at."""


class TrackingParameters(Parameters):
    """Models and tasks.

    Attributes:
        models: file names of models without suffix, tracked on the arm and on the stand-in.
        robot_models: tracked on the stand-in only: those with Coulomb friction.
        loss: with which they were learned; the text's is `raw`.
        seeds: of goals, for the models that are known instead of learned.
        reaching: the reaches.
    """

    models: tuple[str, ...]
    robot_models: tuple[str, ...]
    loss: Loss
    seeds: int = Field(ge=1)
    reaching: ReachingParameters


@dataclass(frozen=True)
class Candidate:
    """A model to be put into the controller.

    Attributes:
        name: of the model.
        seeds: of the goals it reaches for; a learned model has that of its training, one that was not learned
            has all.
        build: makes the compiled model, in the process that uses it.
    """

    name: str
    seeds: tuple[int, ...]
    build: Callable[[], InverseDynamics]


@dataclass(frozen=True)
class Testbed:
    """An arm and its tasks.

    Attributes:
        name: of the arm.
        robot: its URDF, from which the gains of the joints come.
        mechanics: what really moves.
        motion: the sines.
        reaching: the reaches.
    """

    __test__ = False  # not a test, whatever pytest thinks of its name

    name: str
    robot: Robot
    mechanics: Mechanics
    motion: SineParameters
    reaching: ReachingParameters


def known(testbed: Testbed, seeds: int) -> list[Candidate]:
    """What is known of an arm: the truth, and the URDF where the truth is another."""
    tree, true = testbed.robot.tree, testbed.mechanics
    friction = np.stack([true.viscous, true.coulomb, np.zeros_like(true.viscous)])
    goals = tuple(range(seeds))
    truth = Candidate("ground_truth", goals, partial(inverse_dynamics, tree, true.inertias, friction))
    if true.inertias is testbed.robot.inertias:
        return [truth]
    return [truth, Candidate("default", goals, partial(inverse_dynamics, tree, testbed.robot.inertias))]


def learned(testbed: Testbed, models: Mapping[str, DynamicsModels]) -> list[Candidate]:
    """Learned models by name, one candidate per seed."""
    return [
        Candidate(name, (seed,), partial(compiled_model, group, seed, testbed.robot.tree))
        for name, group in models.items()
        for seed in range(group.count)
    ]


def track(testbed: Testbed, candidates: Sequence[Candidate]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Let the arm follow sines and reaches with every model.

    Errors are normalised by the variance of the reference: of sines per joint, then averaged; of reaches
    over all axes. A run that was stopped (see `arm_motion.run`) has no score and says why.

    Args:
        testbed: the arm.
        candidates: the models.

    Returns:
        scores: a row per model, seed and task: `robot`, `model`, `seed`, `task` (`sine`, `reach`),
            `position_nmse`, `velocity_nmse` (NaN where it was stopped), `stopped` (empty where it ran
            through), `duration_s`.
        paths: of each model's seed 0, 25 Hz: `robot`, `model`, `task`, `time_s`, a column per joint in
            rad, `tool_x` ... and `wanted_x` ... in m.
    """
    tables = parallel_map(partial(_track_one, testbed), candidates, f"tracking, {testbed.name}")
    scores, paths = zip(*tables, strict=True)
    return pd.concat(scores, ignore_index=True), pd.concat(chain.from_iterable(paths), ignore_index=True)


def _track_one(testbed: Testbed, candidate: Candidate) -> tuple[pd.DataFrame, list[pd.DataFrame]]:
    """Scores of one model, and paths of the shown seed; the sines are the same for all seeds and run once."""
    robot, motion = testbed.robot, testbed.motion
    torques = candidate.build()
    feedback = joint_feedback(robot.tree, robot.inertias, motion.feedback)
    rows, paths = [], []
    with Arm(robot.tree, testbed.mechanics, 1.0 / motion.rate_hz) as arm:
        moved, wanted, errors = _follow_sines(testbed, arm, torques, feedback)
        rows += [_score(candidate, seed, "sine", moved, errors, motion) for seed in candidate.seeds]
        if SHOWN_SEED in candidate.seeds:
            paths.append(_path(testbed, candidate, "sine", moved, wanted))
        for seed in candidate.seeds:
            moved, wanted, errors = _reach(testbed, arm, torques, feedback, seed)
            rows.append(_score(candidate, seed, "reach", moved, errors, motion))
            if seed == SHOWN_SEED:
                paths.append(_path(testbed, candidate, "reach", moved, wanted))
    scores = pd.DataFrame(rows)
    scores.insert(0, "robot", testbed.name)
    return scores, paths


def _follow_sines(
    testbed: Testbed, arm: Arm, torques: InverseDynamics, feedback: Feedback
) -> tuple[Run, np.ndarray, tuple[float, float]]:
    """The run, the tool's wanted positions (T, 3), and the errors of q and qd."""
    robot = testbed.robot
    reference = sine_path(robot.tree, testbed.motion)
    arm.place(reference.q[0], reference.qd[0])
    policy = sine_policy(torques, reference, feedback)
    moved = run(arm, robot.tree, policy, len(reference.q), robot.model.effortLimit)
    q, qd = reference.q, reference.qd
    errors = tuple(
        float(np.mean(_squared_error(moved, found, wanted) / wanted.var(axis=0)))
        for found, wanted in ((moved.q, q), (moved.qd, qd))
    )
    return moved, tool_motion(robot.tree, testbed.reaching.tool_m, q, qd)[0], errors


def _reach(
    testbed: Testbed, arm: Arm, torques: InverseDynamics, feedback: Feedback, seed: int
) -> tuple[Run, np.ndarray, tuple[float, float]]:
    """The run, the tool's wanted positions (T, 3), and the errors of x and xd."""
    robot, parameters = testbed.robot, testbed.reaching
    reference = reaches(robot.tree, parameters, testbed.motion.rate_hz, seed)
    posture = first_posture(robot.tree, parameters)
    arm.place(posture, np.zeros_like(posture))
    policy = reaching_policy(robot.tree, torques, reference, feedback, parameters)
    moved = run(arm, robot.tree, policy, len(reference.x), robot.model.effortLimit)
    x, xd = tool_motion(robot.tree, parameters.tool_m, moved.q, moved.qd)
    errors = tuple(
        float(_squared_error(moved, found, wanted).sum() / wanted.var(axis=0).sum())
        for found, wanted in ((x, reference.x), (xd, reference.xd))
    )
    return moved, reference.x, errors


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
        "seed": seed,
        "task": task,
        "position_nmse": errors[0],
        "velocity_nmse": errors[1],
        "stopped": moved.stopped or "",
        "duration_s": len(moved.q) / motion.rate_hz,
    }


def _path(testbed: Testbed, candidate: Candidate, task: str, moved: Run, wanted: np.ndarray) -> pd.DataFrame:
    every = max(1, round(testbed.motion.rate_hz / SHOWN_RATE_HZ))
    tree = testbed.robot.tree
    q, qd = moved.q[::every], moved.qd[::every]
    tool, _ = tool_motion(tree, testbed.reaching.tool_m, q, qd)
    columns = {"robot": testbed.name, "model": candidate.name, "task": task}
    columns["time_s"] = np.arange(len(q)) * every / testbed.motion.rate_hz
    columns |= dict(zip(tree.names, q.T, strict=True))
    for place, letter in enumerate("xyz"):
        columns[f"tool_{letter}"] = tool[:, place]
        columns[f"wanted_{letter}"] = wanted[: len(moved.q) : every][:, place]
    return pd.DataFrame(columns)
