"""Your own arm from logs of its joints: what its motion tells, models asked about other motion (III.4)."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from structlearn.ground.block_bootstrap import block_count, blocks, percentiles
from structlearn.ground.errors import InputError
from structlearn.recordings.joint_log import JointLog
from structlearn.rigid_body.arm_identification import (
    TRAIN,
    Identified,
    body_table,
    error_table,
    friction_table,
    identify_arm,
    trace_table,
    write_identified,
)
from structlearn.rigid_body.base_parameters import base_parameters, fit_base
from structlearn.rigid_body.dynamics_models import rigid_body_torques
from structlearn.rigid_body.friction import friction_columns
from structlearn.rigid_body.motion import Motion, block_table, drawn_nmse, excited, measured_motion
from structlearn.rigid_body.training_grid import FRICTIONS
from structlearn.rigid_body.tree import Robot, joint_order
from structlearn.testbeds.own.protocol.arm_parameters import MotionParameters

TEST = "test"

TRACES_HZ = 20.0
"""Of the torques that are kept to be drawn."""

FRICTION = FRICTIONS["offset"]
"""Beside what is looked at by least squares: sensors of torque need not be zeroed."""

YES, NO, DOUBTFUL, SILENT = "yes", "no", "doubtful", "not tested"
"""Whether a joint's torque holds gravity."""


@dataclass(frozen=True)
class OwnMotionResults:
    """Tables; `joint` is a name.

    Attributes:
        logs: `log`, `length_s`, `moving_s` (of the motion that is taken), `learned_s` and `tested_s` of it.
        errors: per `model`, `friction` and `joint` on what is held out: `nmse`, `low`, `high` (95 %), and
            `learned_nmse` on what was learned from.
        gravity: per `joint`: `gravity_n_m` and `torque_n_m` (std), `share` of the URDF's gravity that the
            torque shows, `holds` (`YES`, ...).
        base: `parameter` (its formula), `value`, `low`, `high`, `urdf`.
        excitation: one row: `condition`, `parameters`, `blocks` that were held out.
        friction: `model`, `friction`, `joint`, `term`, `value`.
        links: of `inertia_tables.link_table`; `true_*` are the URDF's.
        traces: torques over what is held out: `time_s`, `joint`, `measured`, a column per model.
        written: per `joint` the `difference_n_m` between the model and the URDF that was written of it.
    """

    logs: pd.DataFrame
    errors: pd.DataFrame
    gravity: pd.DataFrame
    base: pd.DataFrame
    excitation: pd.DataFrame
    friction: pd.DataFrame
    links: pd.DataFrame
    traces: pd.DataFrame
    written: pd.DataFrame


def identify_own_arm(
    robot: Robot, logs: Sequence[JointLog], parameters: MotionParameters, source: Path, target: Path
) -> tuple[Identified, OwnMotionResults]:
    """Learn on the first logs and ask about the last; of a lone log, time blocks are held out.

    Args:
        robot: with the inertias of its URDF.
        logs: in order.
        parameters: see there.
        source: the robot's URDF.
        target: where the identified one is written.

    Raises:
        InputError: a log lacks a joint, is too short, has no motion or a torque that does not vary.
    """
    names = np.array(robot.tree.names)
    motions = [own_motion(robot, log, parameters) for log in logs]
    learned, tested = held_out(motions, parameters)
    parts = {TRAIN: joined(learned), TEST: joined(tested)}
    if min(map(len, parts.values())) < parameters.block:
        raise InputError(
            f"{parameters.source}: {len(parts[TRAIN]) / parameters.rate_hz:.1f} s to learn from and "
            f"{len(parts[TEST]) / parameters.rate_hz:.1f} s to test on are too short for blocks of "
            f"{parameters.block_s:g} s"
        )
    identified = identify_arm(robot, parts, parameters.iterations, {}, ("cov",))
    base = base_parameters(robot.tree)
    drawing = parameters.block, parameters.draws, parameters.seed
    fit = fit_base(robot.tree, base, parts[TRAIN], FRICTION, *drawing)
    found = {
        "parameter": base.formulas(robot.tree),
        "value": fit.parameters,
        "low": fit.low,
        "high": fit.high,
        "urdf": base.values(robot.inertias),
    }
    held = block_count(len(parts[TEST]), parameters.block)
    excitation = {"condition": fit.condition, "parameters": len(base.columns), "blocks": held}
    traces = trace_table(
        identified,
        TEST,
        parts[TEST],
        parameters.rate_hz,
        max(1, round(parameters.rate_hz / TRACES_HZ)),
    )
    written = write_identified(source, target, robot, identified)
    named = {
        "errors": _errors(identified, parts, parameters),
        "friction": friction_table(identified),
        "traces": traces,
        "written": written,
    }
    return identified, OwnMotionResults(
        logs=_logs(logs, motions, learned, tested, parameters.rate_hz),
        gravity=gravity_check(robot, parts[TRAIN], parameters).assign(joint=names),
        base=pd.DataFrame(found),
        excitation=pd.DataFrame([excitation]),
        links=body_table(identified, robot),
        **{name: table.assign(joint=names[table["joint"] - 1]) for name, table in named.items()},
    )


def own_motion(robot: Robot, log: JointLog, parameters: MotionParameters) -> Motion:
    """The longest motion of a log, in the order of the robot's joints."""
    order = joint_order(robot.tree, log.joints, log.name)
    positions, velocities, torques = (
        values[:, order] for values in (log.positions, log.velocities, log.torques)
    )
    motion = measured_motion(
        log.name, log.time, positions, velocities, torques, parameters.rate_hz, parameters.smoothing_hz
    )
    rest = round(parameters.rest_s * parameters.rate_hz)
    return motion.part(excited(log.name, motion.qd, parameters.rest_rad_s, rest))


def held_out(
    motions: Sequence[Motion], parameters: MotionParameters
) -> tuple[list[list[Motion]], list[list[Motion]]]:
    """Pieces of each log that are learned from, and pieces that are asked about."""
    if len(motions) > 1:
        last = len(motions) - min(parameters.test_logs, len(motions) - 1)
        learned = [[motion] if place < last else [] for place, motion in enumerate(motions)]
        return learned, [[motion] if place >= last else [] for place, motion in enumerate(motions)]
    pieces = [motions[0].part(piece) for piece in blocks(np.arange(len(motions[0])), parameters.block)]
    every = parameters.test_every
    tested = [piece for place, piece in enumerate(pieces) if place % every == every - 1]
    return [[piece for place, piece in enumerate(pieces) if place % every != every - 1]], [tested]


def joined(pieces: Sequence[Sequence[Motion]]) -> Motion:
    """One after the other; samples of inverse dynamics do not know what came before."""
    every = [piece for its in pieces for piece in its]
    if not every:
        return Motion(*np.zeros((4, 0, 1)))
    return Motion(
        *(np.concatenate([getattr(one, name) for one in every]) for name in ("q", "qd", "qdd", "torque"))
    )


def gravity_check(robot: Robot, motion: Motion, parameters: MotionParameters) -> pd.DataFrame:
    """Whether measured torques hold what the URDF's gravity asks for.

    The torque of each joint is put together from gravity, what else moves the URDF's bodies, and friction, by
    least squares. A share of one is gravity in N m with the sign that is expected, none tells that the driver
    takes gravity out, a negative one that its sign is turned, and others that the unit is another one.

    Returns:
        `gravity_n_m`, `torque_n_m`, `share`, `holds`, a row per joint.
    """
    still = Motion(motion.q, *np.zeros((3, *motion.q.shape)))
    gravity = rigid_body_torques(robot.tree, robot.inertias, still)
    moving = rigid_body_torques(robot.tree, robot.inertias, motion) - gravity
    rubbing = friction_columns(motion.qd, FRICTION)
    rows = []
    for joint in range(motion.joints):
        columns = np.column_stack([gravity[:, joint], moving[:, joint], rubbing[:, joint]])
        share = np.linalg.lstsq(columns, motion.torque[:, joint], rcond=None)[0][0]
        varies = gravity[:, joint].std()
        rows.append((varies, motion.torque[:, joint].std(), share, _holds(share, varies, parameters)))
    return pd.DataFrame(rows, columns=["gravity_n_m", "torque_n_m", "share", "holds"])


def _holds(share: float, varies: float, parameters: MotionParameters) -> str:
    if varies < parameters.gravity_n_m:
        return SILENT
    least = parameters.gravity_share
    if least <= share <= 1.0 / least:
        return YES
    return NO if share < 1.0 - least else DOUBTFUL


def _errors(identified: Identified, parts: dict[str, Motion], parameters: MotionParameters) -> pd.DataFrame:
    """Rows of `OwnMotionResults.errors`, joints from 1."""
    learned = error_table(identified, parts).query("part == @TRAIN")
    learned = learned.set_index(["model", "friction"])["nmse"]
    sums = block_table(identified.torques, {TEST: parts[TEST]}, parameters.block)
    tables = []
    for key in identified.torques:
        values, draws, _ = drawn_nmse(sums, key, parameters.draws, parameters.seed)
        low, high = percentiles(draws)
        columns = {"nmse": values, "low": low, "high": high, "learned_nmse": learned.loc[key].to_numpy()}
        joints = np.arange(1, len(values) + 1)
        tables.append(pd.DataFrame({"model": key[0], "friction": key[1], "joint": joints, **columns}))
    return pd.concat(tables, ignore_index=True)


def _logs(
    logs: Sequence[JointLog],
    motions: Sequence[Motion],
    learned: Sequence[Sequence[Motion]],
    tested: Sequence[Sequence[Motion]],
    rate_hz: float,
) -> pd.DataFrame:
    rows = [
        (
            log.name,
            log.time[-1],
            len(motion) / rate_hz,
            *(sum(map(len, pieces)) / rate_hz for pieces in (of_train, of_test)),
        )
        for log, motion, of_train, of_test in zip(logs, motions, learned, tested, strict=True)
    ]
    return pd.DataFrame(rows, columns=["log", "length_s", "moving_s", "learned_s", "tested_s"])
