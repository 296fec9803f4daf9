"""Drives observed through motor currents, loads and payloads, and intervals of link parameters."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

from structlearn.core import signals
from structlearn.core.metrics import block_count
from structlearn.core.parallel import parallel_map
from structlearn.readers.clock import MAX_GAP_S, on_one_clock
from structlearn.readers.demonstration import Stream
from structlearn.readers.joint_log import DriveLog
from structlearn.rigid_body.dynamics_models import DynamicsModels
from structlearn.rigid_body.friction import FRICTIONS
from structlearn.rigid_body.identification import drawn_fits
from structlearn.rigid_body.log_fitness import current_delays, moving_gains, resting_gains
from structlearn.rigid_body.motion import Motion, excited, joined_motions, smoothed_motion
from structlearn.rigid_body.payload import PayloadLearningParameters, identify_load, learn_payload
from structlearn.rigid_body.regressor import (
    SYMMETRIC_COLUMNS,
    MotionRegressor,
    link_parameters,
    torque_regressor,
)
from structlearn.rigid_body.robot import Robot
from structlearn.rigid_body.tree import KinematicTree, LinkInertias
from structlearn.tasks.motion import parameters as names
from structlearn.tasks.motion.parameters import CENTRE, MotionParameters

# Friction terms of least squares on logs, with an offset, since torque and current sensors may not be zeroed
FRICTION = FRICTIONS["offset"]
PAYLOAD_COLUMNS = 4  # mass and first moment of a link


def longest_motion(name: str, velocities: np.ndarray, parameters: MotionParameters) -> slice:
    """Part of a log with its longest motion; the whole log if no speed of rest is set."""
    if parameters.rest_rad_s is None:
        return slice(0, len(velocities))
    return excited(name, velocities, parameters.rest_rad_s, round(parameters.rest_s * parameters.rate_hz))


def drive_tables(
    tree: KinematicTree, logs: Mapping[str, DriveLog], parameters: MotionParameters
) -> dict[str, pd.DataFrame]:
    """Gains from the log at rest, delays of the currents from the training log.

    For repeatability, gains in motion and delays are estimated on the test log too. Returns:
    `drives`: `quantity` (`AT_REST`, ...), `log`, number of `blocks`, `joint`, `value` in N m/A or s.
    `drive_draws`: the same with bootstrap `draw`, without `blocks`. `gains`: see `found_gains`.
    `delay_curves`: `log`, `delay_s`, `joint`, `squares` relative to the least.
    """
    own, drawing = parameters.drives, parameters.drawing
    assert own is not None
    joints, dt = np.arange(1, len(tree.names) + 1), 1.0 / parameters.rate_hz
    first, last = own.delays_s
    delays = first + own.delay_step_s * np.arange(round((last - first) / own.delay_step_s) + 1)
    # keyed by quantity and log: number of blocks, values (n,), draws (D, n)
    measured: dict[tuple[str, str], tuple[int, np.ndarray, np.ndarray]] = {}
    curves = []
    if own.rest is not None:
        rest = logs[own.rest]
        gains = resting_gains(rest.desired_currents, rest.target_torques, *drawing)
        measured[names.AT_REST, rest.name] = (block_count(len(rest.stamps), parameters.block), *gains)
    for name in filter(None, (parameters.train, parameters.test)):
        log = logs[name]
        cut = longest_motion(name, log.velocities, parameters)
        moved = (log.desired_currents[cut], log.target_torques[cut], log.velocities[cut])
        gains = moving_gains(*moved, *drawing)
        tried = np.repeat(delays[:, None], len(joints), axis=1)
        _, positions, velocities, currents = log_on_clock(log, parameters.rate_hz, tried)
        whole = smoothed_motion(name, positions, velocities, currents[0], dt, parameters.smoothing_hz)
        cut = longest_motion(name, whole.qd, parameters)
        states = whole.part(cut)
        smooth = np.stack(
            [signals.low_pass(current, dt, parameters.smoothing_hz)[cut] for current in currents]
        )
        late, drawn_late, squares = current_delays(tree, states, smooth, delays, FRICTION, *drawing)
        count = block_count(len(states), parameters.block)
        measured |= {(names.IN_MOTION, name): (count, *gains), (names.DELAY, name): (count, late, drawn_late)}
        grid = {"delay_s": np.repeat(delays, len(joints)), "joint": np.tile(joints, len(delays))}
        curves.append(pd.DataFrame({"log": name} | grid | {"squares": squares.ravel()}))
    every = {"draw": np.repeat(np.arange(parameters.draws), len(joints))}
    every |= {"joint": np.tile(joints, parameters.draws)}
    tables, drawn = [], []
    for (quantity, name), (count, values, draws) in measured.items():
        keys = {"quantity": quantity, "log": name}
        tables.append(pd.DataFrame(keys | {"blocks": count, "joint": joints, "value": values}))
        drawn.append(pd.DataFrame(keys | every | {"value": draws.ravel()}))
    drives = pd.concat(tables, ignore_index=True)
    return {
        "drives": drives,
        "drive_draws": pd.concat(drawn, ignore_index=True),
        "gains": found_gains(drives, parameters),
        "delay_curves": pd.concat(curves, ignore_index=True),
    }


def log_on_clock(
    log: DriveLog, rate_hz: float, delays_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Resample a log to a uniform clock (`clock.on_one_clock`), shifting each joint's current by its delay.

    `delays_s` (..., n): by how much the measured currents lag the motion; several candidates share the clock.
    Returns times (N,) s, positions and velocities (N, n), currents (..., N, n).
    """
    late = np.round(np.asarray(delays_s) * 1e9).astype(np.int64)
    streams = [
        Stream("positions", "joint_positions", log.stamps, log.positions),
        Stream("velocities", "joint_velocities", log.stamps, log.velocities),
    ]
    streams += [
        Stream("currents", "joint_torques", log.stamps - late[place], log.currents[:, [place[-1]]])
        for place in np.ndindex(late.shape)
    ]
    time, (positions, velocities, *currents) = on_one_clock(log.name, streams, rate_hz, MAX_GAP_S)
    stacked = np.stack([current[:, 0] for current in currents]).reshape(*late.shape, -1)
    return time, positions, velocities, np.ascontiguousarray(np.swapaxes(stacked, -1, -2))


def current_motion(
    log: DriveLog, tables: Mapping[str, pd.DataFrame], parameters: MotionParameters
) -> tuple[Motion, slice]:
    """A log's longest motion, with torques from the found gains and delays, and its place on the clock."""
    late = _of(tables["drives"], names.DELAY, parameters.train).to_numpy()
    _, positions, velocities, currents = log_on_clock(log, parameters.rate_hz, late)
    torques = currents * tables["gains"][names.FOUND].to_numpy()
    dt = 1.0 / parameters.rate_hz
    whole = smoothed_motion(log.name, positions, velocities, torques, dt, parameters.smoothing_hz)
    cut = longest_motion(log.name, whole.qd, parameters)
    return whole.part(cut), cut


def _of(drives: pd.DataFrame, quantity: str, log: str | None) -> pd.Series:
    """Values by joint number."""
    return drives[(drives["quantity"] == quantity) & (drives["log"] == log)].set_index("joint")["value"]


def found_gains(drives: pd.DataFrame, parameters: MotionParameters) -> pd.DataFrame:
    """Gains by joint: `joint`, `found` in N m/A, `assumed` (bool), `quoted`.

    `found` is the gain at rest, or of the joint assumed to be alike (`assumed`), or else the gain in the
    training log's motion.
    """
    own = parameters.drives
    assert own is not None
    moving = _of(drives, names.IN_MOTION, parameters.train)
    measured = _of(drives, names.AT_REST, own.rest).reindex(moving.index)
    substitute = pd.Series(own.assumed_gains, dtype=float).map(measured).reindex(moving.index)
    assumed = measured.isna() & substitute.notna()
    gains = measured.fillna(substitute).fillna(moving)
    return pd.DataFrame({"found": gains, "assumed": assumed, "quoted": own.quoted_gains}).reset_index()


def weighed_loads(
    tree: KinematicTree,
    motions: Mapping[str, Motion],
    gains: Mapping[str, np.ndarray],
    parameters: MotionParameters,
) -> dict[str, pd.DataFrame]:
    """Load from every pair of logs and from all pairs, with torques by every set of gains.

    `motions` have torques by the gains `FOUND`. Returns `loads`: `pair` (the loaded log or `ALL_PAIRS`),
    `gains`, number of `blocks`, `mass_kg` and `centre_{x,y,z}_m`. `load_draws`: `pair`, `gains`, `draw`,
    `mass_kg`.
    """
    assert parameters.load is not None
    pairs = parameters.load.pairs
    compared = {pair[1]: [pair] for pair in pairs} | ({names.ALL_PAIRS: list(pairs)} if pairs else {})
    work = []
    for gain, values in gains.items():
        ratio = values / gains[names.FOUND]
        scaled = {log: replace(motion, torque=motion.torque * ratio) for log, motion in motions.items()}
        for name, its in compared.items():
            work.append((name, gain, [(scaled[empty], scaled[loaded]) for empty, loaded in its]))
    length, draws, seed = parameters.drawing
    weigh = partial(identify_load, tree, friction=FRICTION, length=length, draws=draws, seed=seed)
    weighed = parallel_map(weigh, [both for _, _, both in work], "loads")
    rows, drawn = [], []
    for (name, gain, both), (load, masses) in zip(work, weighed, strict=True):
        count = sum(block_count(min(map(len, pair)), length) for pair in both)
        rows.append((name, gain, count, load[0], *(load[1:4] / load[0])))
        drawn += [(name, gain, draw, mass) for draw, mass in enumerate(masses[:, 0])]
    return {
        "loads": pd.DataFrame(rows, columns=["pair", "gains", "blocks", "mass_kg", *CENTRE]),
        "load_draws": pd.DataFrame(drawn, columns=["pair", "gains", "draw", "mass_kg"]),
    }


def followed_loads(robot: Robot, motions: Mapping[str, Motion], parameters: MotionParameters) -> pd.DataFrame:
    """Online estimate of each load: `log`, `stage` (`LEARNED`, ...), `since_s` its start, `learn_payload`."""
    assert parameters.load is not None
    follow = partial(_followed, robot=robot, motions=motions, parameters=parameters)
    followed = parallel_map(follow, parameters.load.pairs, "loads carried")
    if not followed:
        return pd.DataFrame(
            columns=["time_s", "nmse_fixed", "nmse_learned", "mass_kg", "log", "stage", "since_s"]
        )
    return pd.concat(followed, ignore_index=True)


def _followed(
    pair: tuple[str, str], robot: Robot, motions: Mapping[str, Motion], parameters: MotionParameters
) -> pd.DataFrame:
    """Online estimate over the training motion and another one without load, then with the load."""
    load, dt = parameters.load, 1.0 / parameters.rate_hz
    assert load is not None
    parts = [motions[log] for log in (pair[0], parameters.test, pair[1]) if log is not None]
    shared = load.model_dump(include={"structure", "batch", "memory_s", "iterations"})
    payload = PayloadLearningParameters(empty_s=len(parts[0]) * dt, **shared)
    learned = learn_payload((joined_motions(parts), dt), robot.tree, robot.inertias, payload)
    ends = dt * np.cumsum([len(part) for part in parts])
    place = np.minimum(np.searchsorted(ends, learned["time_s"]), len(parts) - 1)
    return learned.assign(
        log=pair[1],
        stage=np.array([names.LEARNED, names.EMPTY, names.CARRYING])[place],
        since_s=learned["time_s"] - np.concatenate([[0.0], ends])[place],
    )


def body_intervals(
    robot: Robot, motion: Motion, model: DynamicsModels, parameters: MotionParameters
) -> pd.DataFrame:
    """Parameters of a model with bootstrap intervals over blocks, by the t distribution.

    Returns `link`, `parameter`, `value`, `half_width` (95 %; NaN without draws), `urdf` (manufacturer's), in
    SI units.
    """
    from scipy.special import stdtrit

    length, _, seed = parameters.drawing
    draws, nothing = parameters.body_draws, np.full(len(robot.tree.names), np.nan)
    values, urdf, widths = _body_columns(model), _inertia_columns(robot.inertias), {}
    if draws:
        regressor = MotionRegressor(robot.tree, motion, True, model.friction)
        fits = drawn_fits(model, regressor, robot.inertias, parameters.iterations, length, draws, seed)
        quantile = stdtrit(draws - 1, 0.975)
        widths = {name: quantile * drawn.std(axis=0, ddof=1) for name, drawn in _body_columns(fits).items()}
    columns = {"half_width": widths, "urdf": urdf}
    tables = [
        pd.DataFrame({"link": robot.tree.names, "parameter": name, "value": value[0]}).assign(
            **{column: values.get(name, nothing) for column, values in columns.items()}
        )
        for name, value in values.items()
    ]
    return pd.concat(tables, ignore_index=True)


def _body_columns(model: DynamicsModels) -> dict[str, np.ndarray]:
    """Columns (M, n) of `_inertia_columns`, and of every friction term."""
    coefficients = np.moveaxis(model.friction_coefficients(), -1, 0)
    return _inertia_columns(model.inertias()) | dict(zip(model.friction, coefficients, strict=True))


def _inertia_columns(inertias: LinkInertias[np.ndarray]) -> dict[str, np.ndarray]:
    """Mass, centre of mass and inertia about it, (..., n) each, in the joint frames."""
    centre = np.moveaxis(inertias.first_moment / inertias.mass[..., None], -1, 0)
    return {"mass_kg": inertias.mass, **dict(zip(CENTRE, centre, strict=True))} | {
        f"i{'xyz'[row]}{'xyz'[place]}_kg_m2": inertias.inertia[..., row, place]
        for row, place in zip(*np.triu_indices(3), strict=True)
    }


def payload_check(robot: Robot, motion: Motion) -> dict[str, pd.DataFrame]:
    """Compare measured torques with the URDF's, under both signs, without and with a payload.

    For motion too slow to identify the links; the payload's mass and first moment are fitted by least
    squares, its rotational inertia and contact forces are neglected. Returns `payload_torques`: `sign` (1: as
    recorded, -1: reversed), `payload` (whether one was fitted), `joint`, `measured_n_m` and `model_n_m`
    (means), `left_n_m` (rms difference). `payloads`: `sign`, `mass_kg`, `centre_{x,y,z}_m` in the last
    joint's frame.
    """
    columns = torque_regressor(robot.tree, motion.q, motion.qd, motion.qdd)
    model = columns @ link_parameters(robot.inertias.tensors()).numpy()
    start = columns.shape[-1] - SYMMETRIC_COLUMNS
    carried = columns[..., start : start + PAYLOAD_COLUMNS]
    torques, payloads = [], []
    for sign in (1, -1):
        measured = sign * motion.torque
        left = (measured - model).ravel()
        payload, *_ = np.linalg.lstsq(carried.reshape(-1, PAYLOAD_COLUMNS), left, rcond=None)
        payloads.append((sign, payload[0], *(payload[1:] / payload[0])))
        for fitted, torque in ((False, model), (True, model + carried @ payload)):
            its = {
                "measured_n_m": sign * motion.torque.mean(axis=0),
                "model_n_m": torque.mean(axis=0),
                "left_n_m": np.sqrt(((measured - torque) ** 2).mean(axis=0)),
            }
            joints = np.arange(1, motion.joints + 1)
            torques.append(pd.DataFrame({"sign": sign, "payload": fitted, "joint": joints} | its))
    return {
        "payload_torques": pd.concat(torques, ignore_index=True),
        "payloads": pd.DataFrame(payloads, columns=["sign", "mass_kg", *CENTRE]),
    }
