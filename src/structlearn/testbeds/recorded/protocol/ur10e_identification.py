"""A UR10e known by its motors' currents: drives, dynamics learned from one motion, the load it carries."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd

from structlearn.ground import signals
from structlearn.ground.block_bootstrap import block_count
from structlearn.ground.parallel import parallel_map
from structlearn.recordings.joint_log import DriveLog, on_clock
from structlearn.rigid_body.arm_identification import (
    TRAIN,
    WRITTEN,
    Identified,
    body_table,
    error_table,
    friction_table,
    identify_arm,
    trace_table,
)
from structlearn.rigid_body.drives import current_delays, moving_gains, resting_gains
from structlearn.rigid_body.dynamics_models import DynamicsModels
from structlearn.rigid_body.identification import drawn_fits, identify_load
from structlearn.rigid_body.inertia_learner import MotionRegressor
from structlearn.rigid_body.learner import LearningParameters
from structlearn.rigid_body.motion import Motion, block_table, excited, smoothed_motion
from structlearn.rigid_body.online_learning import PayloadLearningParameters, learn_payload
from structlearn.rigid_body.training_grid import FRICTIONS
from structlearn.rigid_body.tree import KinematicTree, LinkInertias, Robot
from structlearn.testbeds.recorded.protocol.arm_parameters import RecordedUr10eParameters
from structlearn.testbeds.recorded.protocol.network_choice import choose_networks
from structlearn.testbeds.recorded.protocol.ur10e_logs import CARRIES, logs_that_are_there, moving_logs

AT_REST, IN_MOTION, DELAY = "gain at rest", "gain in motion", "delay"
"""Quantities of drives, in N m/A and s."""

FOUND, QUOTED = "found", "quoted"
"""Gains that a load is weighed with."""

BOTH = "all pairs"
"""Of the load from all pairs of logs at once."""

LEARNED, EMPTY, CARRYING = "empty, learned from", "empty, another motion", "with the load"
"""What the arm does while the load is followed, in their order."""

FRICTION = FRICTIONS["offset"]
"""Of an arm whose drives and load are looked for: sensors of currents need not be zeroed."""

TRACE_STRIDE = 10
"""Every so manieth sample of a test is kept for figures: 10 Hz."""


@dataclass(frozen=True)
class Ur10eResults:
    """Tables of the recorded arm; `joint` counts from 1, a `draw` is one of the bootstrap over blocks.

    Attributes:
        drives: `quantity` (`AT_REST`, ...), `log`, `blocks` it rests on, `joint`, `value` in N m/A or s.
        drive_draws: the same with `draw`, without `blocks`.
        gains: `joint`, `found` (at rest or assumed), `assumed` (bool), `quoted`.
        delay_curves: `log`, `delay_s`, `joint`, `squares` over the least.
        motions: `log`, `part`, `start_s`, `end_s` of what is kept of a log, `length_s` of the log.
        errors: of `error_table`; a part is `TRAIN` or the name of a log.
        blocks: of `block_table`.
        friction: of `friction_table`.
        links: of `body_table`.
        traces: of `trace_table` on the test.
        choice: of `choose_networks`.
        loads: `pair` (the loaded log or `BOTH`), `gains` (`FOUND` or `QUOTED`), `blocks` it rests on,
            `mass_kg` and `centre_{x,y,z}_m`.
        load_draws: `pair`, `gains`, `draw`, `mass_kg`.
        carried: `log`, `stage` (`LEARNED`, ...), `since_s` its start, and what `follow_payload` gives.
        bodies: of the written model: `link`, `parameter`, `value`, `half_width` (95 %), `urdf` (the maker's),
            in SI units.
    """

    drives: pd.DataFrame
    drive_draws: pd.DataFrame
    gains: pd.DataFrame
    delay_curves: pd.DataFrame
    motions: pd.DataFrame
    errors: pd.DataFrame
    blocks: pd.DataFrame
    friction: pd.DataFrame
    links: pd.DataFrame
    traces: pd.DataFrame
    choice: pd.DataFrame
    loads: pd.DataFrame
    load_draws: pd.DataFrame
    carried: pd.DataFrame
    bodies: pd.DataFrame


def identify_ur10e(
    robot: Robot,
    logs: Mapping[str, DriveLog],
    parameters: RecordedUr10eParameters,
    learning: LearningParameters,
) -> tuple[Identified, Ur10eResults]:
    """Drives, then dynamics, then the load.

    Gains come from the log at rest and delays from the training log; models are learned from the training log
    alone, and asked about every other log without load in which the arm moves.

    Args:
        robot: with the maker's inertias.
        logs: by name.
        parameters: see there; other logs may take the place of those it names (`logs_that_are_there`).
        learning: of the networks, where `parameters` chooses nothing.

    Raises:
        InputError: a log cannot be put on one clock, or its torques do not vary.
        MissingInputError: there are not enough logs.
    """
    parameters = logs_that_are_there(logs, parameters)
    drives, drive_draws, delay_curves = _drives(robot.tree, logs, parameters)
    gains = found_gains(drives, parameters)
    late = _of(drives, DELAY, parameters.train)
    found, quoted = gains["found"].to_numpy(), gains["quoted"].to_numpy()
    pairs, moving = parameters.load_pairs, moving_logs(logs, parameters)
    asked = [name for name in moving if name != parameters.train and not CARRIES.search(name)]
    asked.sort(key=lambda name: name != parameters.test)

    cuts = {name: _motion(log, found, late, parameters) for name, log in moving.items()}
    motions = {name: motion for name, (motion, _) in cuts.items()}
    parts = {TRAIN: motions[parameters.train]} | {name: motions[name] for name in asked}
    networks, choice = choose_networks(robot.tree, parts[TRAIN], parameters.networks, learning)
    identified = identify_arm(robot, parts, parameters.iterations, networks)
    loads, load_draws = _loads(robot.tree, motions, pairs, {FOUND: found, QUOTED: quoted}, found, parameters)
    follow = partial(_carried, robot=robot, motions=motions, parameters=parameters)
    carried = parallel_map(follow, pairs, "loads carried")
    rate = parameters.rate_hz
    return identified, Ur10eResults(
        drives=drives,
        drive_draws=drive_draws,
        gains=gains,
        delay_curves=delay_curves,
        motions=_motion_table(logs, {name: cut for name, (_, cut) in cuts.items()}, parts, parameters),
        errors=error_table(identified, parts),
        blocks=block_table(identified.torques, parts, parameters.block),
        friction=friction_table(identified),
        links=body_table(identified, robot),
        traces=trace_table(identified, parameters.test, parts[parameters.test], rate, TRACE_STRIDE),
        choice=choice,
        loads=loads,
        load_draws=load_draws,
        carried=pd.concat(carried, ignore_index=True) if carried else _nothing_carried(),
        bodies=_bodies(robot, parts[TRAIN], identified.models[WRITTEN], parameters),
    )


def _drives(
    tree: KinematicTree, logs: Mapping[str, DriveLog], parameters: RecordedUr10eParameters
) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Values, draws and curves; in motion also of the test, to see whether they come back."""
    draws, seed = parameters.intervals.draws, parameters.intervals.seed
    bootstrap = parameters.block, draws, seed
    found, curves, counts = {}, [], {}
    if parameters.rest is not None:
        rest = logs[parameters.rest]
        found[AT_REST, rest.name] = resting_gains(rest.desired_currents, rest.target_torques, *bootstrap)
        counts[rest.name] = block_count(len(rest.stamps), parameters.block)
    first, last = parameters.delays_s
    delays = first + parameters.delay_step_s * np.arange(round((last - first) / parameters.delay_step_s) + 1)
    tried = np.repeat(delays[:, None], len(tree.names), axis=1)
    for name in (parameters.train, parameters.test):
        log = logs[name]
        cut = excited(
            name, log.velocities, parameters.rest_rad_s, round(parameters.rest_s * parameters.rate_hz)
        )
        found[IN_MOTION, name] = moving_gains(
            log.desired_currents[cut], log.target_torques[cut], log.velocities[cut], *bootstrap
        )
        _, positions, velocities, currents = on_clock(log, parameters.rate_hz, tried)
        states, cut = _cut(name, positions, velocities, currents[0], parameters)
        counts[name] = block_count(len(states), parameters.block)
        smooth = [
            signals.low_pass(its, 1.0 / parameters.rate_hz, parameters.cutoff_hz)[cut] for its in currents
        ]
        late, drawn_late, squares = current_delays(
            tree, states, np.stack(smooth), delays, FRICTION, *bootstrap
        )
        found[DELAY, name] = late, drawn_late
        curves.append(_long({"log": name}, squares, "delay_s", delays, "squares"))
    values = [
        _long({"quantity": key[0], "log": key[1], "blocks": counts[key[1]]}, its[0][None])
        for key, its in found.items()
    ]
    drawn = [
        _long({"quantity": key[0], "log": key[1]}, its[1], "draw", np.arange(draws))
        for key, its in found.items()
    ]
    return tuple(pd.concat(tables, ignore_index=True) for tables in (values, drawn, curves))


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


def _of(drives: pd.DataFrame, quantity: str, log: str) -> np.ndarray:
    """(n,) of the joints in their order."""
    chosen = (drives["quantity"] == quantity) & (drives["log"] == log)
    return drives.loc[chosen, "value"].to_numpy()


def found_gains(drives: pd.DataFrame, parameters: RecordedUr10eParameters) -> pd.DataFrame:
    """Gain of every joint: that at rest, or that of the joint which stands in, and the quoted one.

    Where a joint shows none at rest and none stands in, it is the gain in the training log's motion.
    """
    moving = _of(drives, IN_MOTION, parameters.train)
    measured = np.full_like(moving, np.nan)
    assumed = np.zeros(len(moving), dtype=bool)
    if parameters.rest is not None:
        measured = _of(drives, AT_REST, parameters.rest)
        stands_in = {joint: measured[other - 1] for joint, other in parameters.assumed_gains.items()}
        stand_in = np.array([stands_in.get(joint, np.nan) for joint in range(1, len(measured) + 1)])
        assumed = np.isnan(measured) & ~np.isnan(stand_in)
        measured = np.where(assumed, stand_in, measured)
    found = np.where(np.isnan(measured), moving, measured)
    columns = {"joint": np.arange(1, len(found) + 1), "found": found, "assumed": assumed}
    return pd.DataFrame(columns | {"quoted": parameters.quoted_gains})


def _motion(
    log: DriveLog, gains: np.ndarray, delays_s: np.ndarray, parameters: RecordedUr10eParameters
) -> tuple[Motion, slice]:
    """What is excited of a log, with torques of its currents, and where it stands on the clock."""
    _, positions, velocities, currents = on_clock(log, parameters.rate_hz, delays_s)
    return _cut(log.name, positions, velocities, currents * gains, parameters)


def _cut(
    name: str,
    positions: np.ndarray,
    velocities: np.ndarray,
    torques: np.ndarray,
    parameters: RecordedUr10eParameters,
) -> tuple[Motion, slice]:
    whole = smoothed_motion(
        name, positions, velocities, torques, 1.0 / parameters.rate_hz, parameters.cutoff_hz
    )
    rest = round(parameters.rest_s * parameters.rate_hz)
    cut = excited(name, whole.qd, parameters.rest_rad_s, rest)
    return whole.part(cut), cut


def _motion_table(
    logs: Mapping[str, DriveLog],
    cuts: Mapping[str, slice],
    parts: Mapping[str, Motion],
    parameters: RecordedUr10eParameters,
) -> pd.DataFrame:
    def part(name: str) -> str:
        if name == parameters.train:
            return "learned from"
        return "asked about" if name in parts else "with the load"

    rows = [
        (name, part(name), cut.start / parameters.rate_hz, cut.stop / parameters.rate_hz, logs[name].time[-1])
        for name, cut in cuts.items()
    ]
    return pd.DataFrame(rows, columns=["log", "part", "start_s", "end_s", "length_s"])


def _loads(
    tree: KinematicTree,
    motions: Mapping[str, Motion],
    pairs: Sequence[tuple[str, str]],
    gains: Mapping[str, np.ndarray],
    used: np.ndarray,
    parameters: RecordedUr10eParameters,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The load from every pair and from all, with torques by every set of gains (`motions` have `used`)."""
    blocks = parameters.intervals
    asked = {pair[1]: [pair] for pair in pairs} | ({BOTH: list(pairs)} if pairs else {})
    work = [
        (name, gain, [tuple(_scaled(motions[log], values / used) for log in pair) for pair in chosen])
        for gain, values in gains.items()
        for name, chosen in asked.items()
    ]
    weigh = partial(
        identify_load,
        tree,
        friction=FRICTION,
        length=parameters.block,
        draws=blocks.draws,
        seed=blocks.seed,
    )
    found = parallel_map(weigh, [both for _, _, both in work], "loads")
    rows, drawn = [], []
    for (name, gain, both), (load, draws) in zip(work, found, strict=True):
        count = sum(block_count(min(map(len, pair)), parameters.block) for pair in both)
        rows.append((name, gain, count, load[0], *(load[1:4] / load[0])))
        keys = {"pair": name, "gains": gain, "draw": np.arange(blocks.draws), "mass_kg": draws[:, 0]}
        drawn.append(pd.DataFrame(keys))
    centre = [f"centre_{axis}_m" for axis in "xyz"]
    loads = pd.DataFrame(rows, columns=["pair", "gains", "blocks", "mass_kg", *centre])
    columns = ["pair", "gains", "draw", "mass_kg"]
    return loads, pd.concat(drawn, ignore_index=True) if drawn else pd.DataFrame(columns=columns)


def _scaled(motion: Motion, factors: np.ndarray) -> Motion:
    return Motion(motion.q, motion.qd, motion.qdd, motion.torque * factors)


def _carried(
    pair: tuple[str, str], robot: Robot, motions: Mapping[str, Motion], parameters: RecordedUr10eParameters
) -> pd.DataFrame:
    """The load found over time: after the motion that the empty arm was learned from, and another one."""
    chosen, dt = parameters.carried, 1.0 / parameters.rate_hz
    parts = {
        LEARNED: motions[pair[0]],
        EMPTY: motions[parameters.test],
        CARRYING: motions[pair[1]],
    }
    joined = Motion(
        *(
            np.concatenate([getattr(part, name) for part in parts.values()])
            for name in ("q", "qd", "qdd", "torque")
        )
    )
    payload = PayloadLearningParameters(
        structure=chosen.structure,
        empty_s=len(parts[LEARNED]) * dt,
        batch=chosen.batch,
        memory_s=chosen.memory_s,
        iterations=chosen.iterations,
    )
    learned = learn_payload((joined, dt), robot.tree, robot.inertias, payload)
    ends = dt * np.cumsum([len(part) for part in parts.values()])
    place = np.minimum(np.searchsorted(ends, learned["time_s"]), len(parts) - 1)
    return learned.assign(
        log=pair[1],
        stage=np.array(list(parts))[place],
        since_s=learned["time_s"] - np.concatenate([[0.0], ends])[place],
    )


def _nothing_carried() -> pd.DataFrame:
    names = ["time_s", "nmse_fixed", "nmse_learned", "mass_kg", "log", "stage", "since_s"]
    return pd.DataFrame(columns=names)


def _bodies(
    robot: Robot, motion: Motion, model: DynamicsModels, parameters: RecordedUr10eParameters
) -> pd.DataFrame:
    """Parameters of the written model with intervals: of fits to blocks drawn anew, by the t distribution."""
    from scipy.special import stdtrit

    friction = model.friction
    regressor = MotionRegressor(robot.tree, motion, True, friction)
    fits = drawn_fits(
        model,
        regressor,
        robot.inertias,
        parameters.iterations,
        parameters.block,
        parameters.body_draws,
        parameters.intervals.seed,
    )
    drawn = _columns(fits.inertias()) | _rubbing(fits.friction_coefficients(), friction)
    values = _columns(model.inertias()) | _rubbing(model.friction_coefficients(), friction)
    urdf = _columns(robot.inertias)
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


def _columns(inertias: LinkInertias[np.ndarray]) -> dict[str, np.ndarray]:
    """Mass, centre of mass and inertia about it (..., n), in the frame of the joint."""
    centre = inertias.first_moment / inertias.mass[..., None]
    columns = {"mass_kg": inertias.mass}
    columns |= {f"centre_{axis}_m": centre[..., place] for place, axis in enumerate("xyz")}
    rows, places = np.triu_indices(3)
    return columns | {
        f"i{'xyz'[row]}{'xyz'[place]}_kg_m2": inertias.inertia[..., row, place]
        for row, place in zip(rows, places, strict=True)
    }


def _rubbing(coefficients: np.ndarray, terms: Sequence[str]) -> dict[str, np.ndarray]:
    """(..., n) of each term."""
    return {term: coefficients[..., place] for place, term in enumerate(terms)}
