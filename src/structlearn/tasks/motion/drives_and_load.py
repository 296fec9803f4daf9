"""Drives known by motor currents, a load or payload, and intervals of an arm's links."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd

from structlearn.core import signals
from structlearn.core.metrics import block_count
from structlearn.core.parallel import parallel_map
from structlearn.readers.joint_log import DriveLog, on_clock
from structlearn.rigid_body.drives import current_delays, moving_gains, resting_gains
from structlearn.rigid_body.dynamics_models import DynamicsModels
from structlearn.rigid_body.identification import drawn_fits, identify_load
from structlearn.rigid_body.inertia_learner import MotionRegressor
from structlearn.rigid_body.motion import Motion, excited, joined, smoothed_motion
from structlearn.rigid_body.online_learning import PayloadLearningParameters, learn_payload
from structlearn.rigid_body.regressor import SYMMETRIC_COLUMNS, link_parameters, torque_regressor
from structlearn.rigid_body.training_grid import FRICTIONS
from structlearn.rigid_body.tree import KinematicTree, LinkInertias, Robot
from structlearn.tasks.motion.motion_parameters import MotionParameters

AT_REST, IN_MOTION, DELAY = "gain at rest", "gain in motion", "delay"
"""Quantities of drives, in N m/A and s."""

FOUND, QUOTED = "found", "quoted"
"""Gains that a load is weighed with."""

BOTH = "all pairs"
"""Of the load from all pairs of logs at once."""

LEARNED, EMPTY, CARRYING = "empty, learned from", "empty, another motion", "with the load"
"""What the arm does while the load is followed, in their order."""

FRICTION = FRICTIONS["offset"]
"""Sensors of torques or currents need not be zeroed."""

PAYLOAD_COLUMNS = 4
"""Mass and first moment of a link."""


@dataclass(frozen=True)
class Drives:
    """Drives that were found.

    Attributes:
        tables: see `drives_of`.
        gains: (n,) N m/A by name: `FOUND` and `QUOTED`.
        motion: a log's longest motion, with torques by the gains found, and where it stands on the clock.
    """

    tables: dict[str, pd.DataFrame]
    gains: dict[str, np.ndarray]
    motion: Callable[[DriveLog], tuple[Motion, slice]]


def drives_of(tree: KinematicTree, logs: Mapping[str, DriveLog], parameters: MotionParameters) -> Drives:
    """Gains from the log at rest, delays of the currents from the training log.

    Gains in motion and delays are also those of the test, to see whether they come back.

    Returns:
        Its tables are `drives`: `quantity` (`AT_REST`, ...), `log`, `blocks` it rests on, `joint`, `value` in
        N m/A or s. `drive_draws`: the same with `draw` of the bootstrap, without `blocks`. `gains`: see
        `found_gains`. `delay_curves`: `log`, `delay_s`, `joint`, `squares` over the least.
    """
    own = parameters.drives
    assert own is not None
    assert parameters.train is not None
    assert parameters.test is not None
    found, curves, counts = {}, [], {}
    if own.rest is not None:
        rest = logs[own.rest]
        found[AT_REST, rest.name] = resting_gains(
            rest.desired_currents, rest.target_torques, *parameters.drawing
        )
        counts[rest.name] = block_count(len(rest.stamps), parameters.block)
    first, last = own.delays_s
    delays = first + own.delay_step_s * np.arange(round((last - first) / own.delay_step_s) + 1)
    tried = np.repeat(delays[:, None], len(tree.names), axis=1)
    for name in (parameters.train, parameters.test):
        log = logs[name]
        slow, shortest = parameters.rest_rad_s or 0.0, round(parameters.rest_s * parameters.rate_hz)
        cut = excited(name, log.velocities, slow, shortest)
        found[IN_MOTION, name] = moving_gains(
            log.desired_currents[cut], log.target_torques[cut], log.velocities[cut], *parameters.drawing
        )
        _, positions, velocities, currents = on_clock(log, parameters.rate_hz, tried)
        states, cut = _cut(name, positions, velocities, currents[0], parameters)
        counts[name] = block_count(len(states), parameters.block)
        smooth = [
            signals.low_pass(its, 1.0 / parameters.rate_hz, parameters.smoothing_hz)[cut] for its in currents
        ]
        late, drawn_late, squares = current_delays(
            tree, states, np.stack(smooth), delays, FRICTION, *parameters.drawing
        )
        found[DELAY, name] = late, drawn_late
        curves.append(_long({"log": name}, squares, "delay_s", delays, "squares"))
    drives = pd.concat(
        [
            _long({"quantity": key[0], "log": key[1], "blocks": counts[key[1]]}, its[0][None])
            for key, its in found.items()
        ],
        ignore_index=True,
    )
    draws = np.arange(parameters.draws)
    drawn = [_long({"quantity": key[0], "log": key[1]}, its[1], "draw", draws) for key, its in found.items()]
    gains = found_gains(drives, parameters)
    used, late = gains["found"].to_numpy(), _of(drives, DELAY, parameters.train)

    def motion(log: DriveLog) -> tuple[Motion, slice]:
        _, positions, velocities, currents = on_clock(log, parameters.rate_hz, late)
        return _cut(log.name, positions, velocities, currents * used, parameters)

    tables = {"drives": drives, "drive_draws": pd.concat(drawn, ignore_index=True), "gains": gains}
    tables["delay_curves"] = pd.concat(curves, ignore_index=True)
    return Drives(tables, {FOUND: used, QUOTED: gains["quoted"].to_numpy()}, motion)


def _cut(
    name: str,
    positions: np.ndarray,
    velocities: np.ndarray,
    torques: np.ndarray,
    parameters: MotionParameters,
) -> tuple[Motion, slice]:
    dt = 1.0 / parameters.rate_hz
    whole = smoothed_motion(name, positions, velocities, torques, dt, parameters.smoothing_hz)
    rest = round(parameters.rest_s * parameters.rate_hz)
    cut = excited(name, whole.qd, parameters.rest_rad_s or 0.0, rest)
    return whole.part(cut), cut


def _long(
    keys: dict[str, str | int],
    values: np.ndarray,
    row_name: str | None = None,
    rows: np.ndarray | None = None,
    value_name: str = "value",
) -> pd.DataFrame:
    """Values (R, n) as rows with `joint`."""
    count, joints = values.shape
    columns = {} if rows is None else {row_name: np.repeat(rows, joints)}
    columns |= {"joint": np.tile(np.arange(1, joints + 1), count), value_name: values.ravel()}
    return pd.DataFrame(keys | columns)


def _of(drives: pd.DataFrame, quantity: str, log: str | None) -> np.ndarray:
    """(n,) of the joints in their order."""
    return drives.loc[(drives["quantity"] == quantity) & (drives["log"] == log), "value"].to_numpy()


def found_gains(drives: pd.DataFrame, parameters: MotionParameters) -> pd.DataFrame:
    """`joint`, `found` (N m/A at rest, or of the joint that stands in), `assumed` (bool), `quoted`.

    Where a joint shows none at rest and none stands in, it is the gain in the training log's motion.
    """
    own = parameters.drives
    assert own is not None
    moving = _of(drives, IN_MOTION, parameters.train)
    measured = np.full_like(moving, np.nan)
    assumed = np.zeros(len(moving), dtype=bool)
    if own.rest is not None:
        measured = _of(drives, AT_REST, own.rest)
        stands_in = {joint: measured[other - 1] for joint, other in own.assumed_gains.items()}
        stand_in = np.array([stands_in.get(joint, np.nan) for joint in range(1, len(measured) + 1)])
        assumed = np.isnan(measured) & ~np.isnan(stand_in)
        measured = np.where(assumed, stand_in, measured)
    found = np.where(np.isnan(measured), moving, measured)
    columns = {"joint": np.arange(1, len(found) + 1), "found": found, "assumed": assumed}
    return pd.DataFrame(columns | {"quoted": own.quoted_gains})


def weighed_loads(
    tree: KinematicTree,
    motions: Mapping[str, Motion],
    gains: Mapping[str, np.ndarray],
    parameters: MotionParameters,
) -> dict[str, pd.DataFrame]:
    """The load from every pair and from all, with torques by every set of gains (motions have those found).

    Returns:
        `loads`: `pair` (the loaded log or `BOTH`), `gains`, `blocks` it rests on, `mass_kg` and
        `centre_{x,y,z}_m`. `load_draws`: `pair`, `gains`, `draw`, `mass_kg`.
    """
    assert parameters.load is not None
    pairs = parameters.load.pairs
    asked = {pair[1]: [pair] for pair in pairs} | ({BOTH: list(pairs)} if pairs else {})
    work = [
        (name, gain, [tuple(_scaled(motions[log], values / gains[FOUND]) for log in pair) for pair in its])
        for gain, values in gains.items()
        for name, its in asked.items()
    ]
    length, draws, seed = parameters.drawing
    weigh = partial(identify_load, tree, friction=FRICTION, length=length, draws=draws, seed=seed)
    found = parallel_map(weigh, [both for _, _, both in work], "loads")
    rows, drawn = [], [pd.DataFrame(columns=["pair", "gains", "draw", "mass_kg"])] * (not work)
    for (name, gain, both), (load, masses) in zip(work, found, strict=True):
        count = sum(block_count(min(map(len, pair)), length) for pair in both)
        rows.append((name, gain, count, load[0], *(load[1:4] / load[0])))
        keys = {"pair": name, "gains": gain, "draw": np.arange(draws), "mass_kg": masses[:, 0]}
        drawn.append(pd.DataFrame(keys))
    columns = ["pair", "gains", "blocks", "mass_kg", *(f"centre_{axis}_m" for axis in "xyz")]
    return {
        "loads": pd.DataFrame(rows, columns=columns),
        "load_draws": pd.concat(drawn, ignore_index=True),
    }


def _scaled(motion: Motion, factors: np.ndarray) -> Motion:
    return Motion(motion.q, motion.qd, motion.qdd, motion.torque * factors)


def followed_loads(robot: Robot, motions: Mapping[str, Motion], parameters: MotionParameters) -> pd.DataFrame:
    """Each load found over time: `log`, `stage` (`LEARNED`, ...), `since_s` its start, of `learn_payload`."""
    assert parameters.load is not None
    follow = partial(_followed, robot=robot, motions=motions, parameters=parameters)
    found = parallel_map(follow, parameters.load.pairs, "loads carried")
    names = ["time_s", "nmse_fixed", "nmse_learned", "mass_kg", "log", "stage", "since_s"]
    return pd.concat(found, ignore_index=True) if found else pd.DataFrame(columns=names)


def _followed(
    pair: tuple[str, str], robot: Robot, motions: Mapping[str, Motion], parameters: MotionParameters
) -> pd.DataFrame:
    """The load after the motion that the empty arm was learned from, and another one."""
    load, dt = parameters.load, 1.0 / parameters.rate_hz
    assert load is not None
    assert parameters.test is not None
    parts = {LEARNED: motions[pair[0]], EMPTY: motions[parameters.test], CARRYING: motions[pair[1]]}
    payload = PayloadLearningParameters(
        structure=load.structure,
        empty_s=len(parts[LEARNED]) * dt,
        batch=load.batch,
        memory_s=load.memory_s,
        iterations=load.iterations,
    )
    learned = learn_payload((joined(list(parts.values())), dt), robot.tree, robot.inertias, payload)
    ends = dt * np.cumsum([len(part) for part in parts.values()])
    place = np.minimum(np.searchsorted(ends, learned["time_s"]), len(parts) - 1)
    return learned.assign(
        log=pair[1],
        stage=np.array(list(parts))[place],
        since_s=learned["time_s"] - np.concatenate([[0.0], ends])[place],
    )


def body_intervals(
    robot: Robot, motion: Motion, model: DynamicsModels, parameters: MotionParameters
) -> pd.DataFrame:
    """Parameters of a model with intervals: of fits to blocks drawn anew, by the t distribution.

    Returns:
        `link`, `parameter`, `value`, `half_width` (95 %), `urdf` (the maker's), in SI units.
    """
    from scipy.special import stdtrit

    length, _, seed = parameters.drawing
    regressor = MotionRegressor(robot.tree, motion, True, model.friction)
    fits = drawn_fits(
        *(model, regressor, robot.inertias, parameters.iterations, length, parameters.body_draws, seed)
    )
    drawn, values = _body_columns(fits), _body_columns(model)
    urdf = _inertia_columns(robot.inertias)
    quantile = stdtrit(parameters.body_draws - 1, 0.975)
    tables = [
        pd.DataFrame(
            {
                "link": robot.tree.names,
                "parameter": name,
                "value": value[0],
                "half_width": quantile * drawn[name].std(axis=0, ddof=1),
                "urdf": urdf.get(name, np.full(len(robot.tree.names), np.nan)),
            }
        )
        for name, value in values.items()
    ]
    return pd.concat(tables, ignore_index=True)


def _body_columns(model: DynamicsModels) -> dict[str, np.ndarray]:
    """(M, n) of what `_inertia_columns` has, and of every term of friction."""
    coefficients = model.friction_coefficients()
    rubbing = {term: coefficients[..., place] for place, term in enumerate(model.friction)}
    return _inertia_columns(model.inertias()) | rubbing


def _inertia_columns(inertias: LinkInertias[np.ndarray]) -> dict[str, np.ndarray]:
    """Mass, centre of mass and inertia about it (..., n), in the frame of the joint."""
    centre = inertias.first_moment / inertias.mass[..., None]
    columns = {"mass_kg": inertias.mass}
    columns |= {f"centre_{axis}_m": centre[..., place] for place, axis in enumerate("xyz")}
    return columns | {
        f"i{'xyz'[row]}{'xyz'[place]}_kg_m2": inertias.inertia[..., row, place]
        for row, place in zip(*np.triu_indices(3), strict=True)
    }


def payload_check(robot: Robot, motion: Motion) -> dict[str, pd.DataFrame]:
    """Measured torques beside the URDF's, under both signs, without and with a payload at the last link.

    The payload's mass and first moment are fitted by least squares: for motion that is too slow to identify
    the links, and for its rotational inertia. Forces of contact are neglected.

    Returns:
        `payload_torques`: `sign` (1: as recorded, -1: reversed), `payload` (whether one was fitted), `joint`,
        `measured_n_m` and `model_n_m` (means), `left_n_m` (root mean square of the difference). `payloads`:
        `sign`, `mass_kg`, `centre_{x,y,z}_m` in the last joint's frame.
    """
    columns = torque_regressor(robot.tree, motion.q, motion.qd, motion.qdd)
    model = columns @ link_parameters(robot.inertias.tensors()).numpy()
    start = columns.shape[-1] - SYMMETRIC_COLUMNS
    carried, measured = columns[..., start : start + PAYLOAD_COLUMNS], motion.torque
    torques, payloads = [], []
    for sign in (1, -1):
        left = (sign * measured - model).ravel()
        payload, *_ = np.linalg.lstsq(carried.reshape(-1, PAYLOAD_COLUMNS), left, rcond=None)
        payloads.append((sign, payload[0], *(payload[1:] / payload[0])))
        for fitted, torque in ((False, model), (True, model + carried @ payload)):
            its = {
                "measured_n_m": sign * measured.mean(axis=0),
                "model_n_m": torque.mean(axis=0),
                "left_n_m": np.sqrt(((sign * measured - torque) ** 2).mean(axis=0)),
            }
            joints = np.arange(1, motion.joints + 1)
            torques.append(pd.DataFrame({"sign": sign, "payload": fitted, "joint": joints} | its))
    names = ["sign", "mass_kg", *(f"centre_{axis}_m" for axis in "xyz")]
    return {
        "payload_torques": pd.concat(torques, ignore_index=True),
        "payloads": pd.DataFrame(payloads, columns=names),
    }
