"""Identification of the arm of a task from its joint logs (III.4)."""

import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np
import pandas as pd

from structlearn.core.errors import InputError, MissingInputError
from structlearn.core.metrics import blocks, nmse
from structlearn.core.parallel import parallel_map
from structlearn.networks.torch_settings import AdamParameters, one_thread
from structlearn.readers.joint_log import JointLog, Log, signals_of
from structlearn.readers.urdf_file import urdf_path
from structlearn.rigid_body import model_comparison
from structlearn.rigid_body.base_parameters import base_parameters, fit_base
from structlearn.rigid_body.dynamics_models import (
    DynamicsModels,
    predicted_torques,
    rigid_body_torques,
    write_dynamics_models,
)
from structlearn.rigid_body.dynamics_training import (
    Kind,
    LearningParameters,
    TrainingData,
    learner,
    shuffled_epochs,
)
from structlearn.rigid_body.friction import FRICTIONS, friction_columns
from structlearn.rigid_body.log_fitness import fitness_lines, identified_table, log_fitness
from structlearn.rigid_body.log_limits import possible_samples
from structlearn.rigid_body.model_comparison import NETWORKS, TRAIN, Models, NetworkTraining
from structlearn.rigid_body.motion import Motion, joined_motions, measured_motion
from structlearn.rigid_body.robot import Robot, read_urdf
from structlearn.rigid_body.tree import KinematicTree, joint_order
from structlearn.tasks.motion import drives_and_load
from structlearn.tasks.motion.differing_motion import differing_errors, differing_motion
from structlearn.tasks.motion.drives_and_load import FRICTION, longest_motion
from structlearn.tasks.motion.parameters import (
    BLOCK_S,
    FOUND,
    GRAVITY_SHARE,
    QUOTED,
    TEST_EVERY,
    MotionParameters,
    NetworkChoiceParameters,
    read_task_logs,
)
from structlearn.tasks.motion.repeated_motion import repeat_lines, repeats
from structlearn.tasks.task_files import TaskFiles, is_public, leave_out, local_path, write_tables

TEST = "test"  # test part, unless it is a named log

LOAD = "(?<!un)(?<!no)(?<!no.)load"  # in a log's name; not `unload` or `no_load`

CARRIES = re.compile(f"{LOAD}|mass", re.IGNORECASE)  # in names of logs with something at the flange

# At the end of a name: the load of known mass; other masses are unknown
THE_LOAD = re.compile(f"{LOAD}$", re.IGNORECASE)

Pieces = dict[str, list[tuple[str, Motion]]]  # pieces of motions, each with its log, by part


def learn(files: TaskFiles, folder: Path) -> None:
    """Write the tables of `learn_motion`, models and the identified URDF."""
    parameters = files.entry(MotionParameters)
    logs = read_task_logs(files.recorded / "logs.parquet", parameters)
    try:
        robot, urdf = read_task_arm(parameters)
        _, tables = learn_motion(robot, logs, parameters, urdf, folder)
        if "fitness" in tables:
            lines = [*fitness_lines(tables["fitness"]), *repeat_lines(tables["repeats"])]
            print("Fit to identify the arm from?", *lines, sep="\n")
        for line in tables["impossible"]["text"] if "impossible" in tables else ():
            print(f"left out: {line}", file=sys.stderr)
    except InputError as error:
        if not is_public(parameters.source):
            raise
        rmtree(folder)
        leave_out(folder, str(error))


def read_task_arm(parameters: MotionParameters) -> tuple[Robot, Path]:
    """Robot with its URDF's inertias, and the URDF's path: a file, or one of `pybullet_data`.

    In a public set, the URDF may be in any subfolder.
    """
    assert parameters.urdf is not None, "the entry has no URDF"
    path = local_path(parameters.urdf)
    if is_public(parameters.urdf) and not path.is_file():
        path = next(iter(sorted(path.parent.rglob(path.name))), path)
    urdf = urdf_path(str(path))
    return read_urdf(urdf, parameters.locked_joints), urdf


def learn_motion(
    robot: Robot, logs: Mapping[str, Any], parameters: MotionParameters, source: Path, folder: Path
) -> tuple[Models, dict[str, pd.DataFrame]]:
    """Identify an arm, and write models, its URDF and tables to a folder.

    Without structures, nothing is learned: the torques of all logs are checked against the URDF.
    `logs`: `JointLog` by name, or `DriveLog` if the parameters have drives; `source`: the robot's URDF.

    Returns the models by kind and friction, and tables by name; `joint` counts from 1. `motions`: `log`,
    `part`, `start_s` and `end_s` of what is used, `length_s`, `learned_s` and `tested_s`. `repeats`: test
    motions found in the training motion. `differing`: `differing_errors`, with `learned_s`, `tested_s` and
    `halved` (whether the model was learned from half of the training motion). `errors`, `blocks`, `norms`,
    `links`, `traces`, `written`: of `model_comparison`. `gravity`: of `gravity_check`. `base`: `parameter`
    (its formula), `value`, `low`, `high` (95 %), `urdf`; `fitness` and `determined`: of
    `rigid_body.log_fitness`. `excitation`: one row, `condition` and `parameters`. `choice`: of
    `choose_networks`. `bodies` and tables on drives and loads: of `drives_and_load`. Without structures:
    `gravity`, and the tables of `drives_and_load.payload_check`. `impossible`: of `log_limits`, if any.

    Raises InputError: a log lacks a joint, is too short, has no motion or a constant torque, or many of its
    samples are impossible.
    MissingInputError: logs are named, but fewer than two motions are without load.
    """
    ordered = {name: in_tree_order(robot.tree, log) for name, log in logs.items()}
    logs, impossible = possible_samples(robot, ordered)
    models: Models = {}
    if parameters.structures:
        models, tables = _identified(robot, logs, parameters, source, folder)
    else:
        motion = joined_motions([cut_motion(log, parameters)[0] for log in logs.values()])
        tables = {"gravity": gravity_check(robot, motion, parameters)}
        tables |= drives_and_load.payload_check(robot, motion)
    if len(impossible):
        tables["impossible"] = impossible
    write_tables(tables, folder)
    return models, tables


def _identified(
    robot: Robot, logs: Mapping[str, Any], parameters: MotionParameters, source: Path, folder: Path
) -> tuple[Models, dict[str, pd.DataFrame]]:
    effort = robot.model.effortLimit
    if parameters.joint_weights == "limit" and (effort <= 0.0).any():
        name = robot.tree.names[int(np.argmin(effort))]
        raise InputError(f"{source}: joint '{name}' has no effort limit, which `joint_weights: limit` needs")
    if parameters.train is not None:
        parameters = logs_that_are_there(logs, parameters)
    moving = logs if parameters.train is None else moving_logs(logs, parameters)
    tables: dict[str, pd.DataFrame] = {}
    gains = {FOUND: np.ones(len(robot.tree.names))}
    if parameters.drives is None:
        cuts = {name: cut_motion(log, parameters) for name, log in moving.items()}
    else:
        tables = drives_and_load.drive_tables(robot.tree, logs, parameters)
        gains = {name: tables["gains"][name].to_numpy() for name in (FOUND, QUOTED)}
        cuts = {name: drives_and_load.current_motion(log, tables, parameters) for name, log in moving.items()}
    motions = {name: motion for name, (motion, _) in cuts.items()}
    pieces = held_out_pieces(motions, parameters)
    parts = joined_parts(", ".join(logs), pieces, parameters)
    tables["repeats"] = repeats(pieces, parameters.rate_hz)
    tables["motions"] = _motion_table(
        moving, {name: cut for name, (_, cut) in cuts.items()}, pieces, parameters
    )
    networks: dict[Kind, NetworkTraining] = {}
    if parameters.networks is not None:
        networks, tables["choice"] = choose_networks(robot.tree, parts[TRAIN], parameters.networks)
    identify = partial(
        model_comparison.identify_arm,
        robot,
        iterations=parameters.iterations,
        limits=effort.copy() if parameters.joint_weights == "limit" else None,
        prior=parameters.prior,
    )
    frictions = tuple(dict.fromkeys((*model_comparison.LEARNED_FRICTIONS, parameters.judged_friction)))
    models, torques = identify(parts, parameters.structures, frictions, networks)
    if parameters.load is not None:
        tables |= drives_and_load.weighed_loads(robot.tree, motions, gains, parameters)
        tables["carried"] = drives_and_load.followed_loads(robot, motions, parameters)
    key = "cov", parameters.judged_friction
    judged = models[key]
    used = {name for named in pieces.values() for name, _ in named}
    others = [motion for name, motion in motions.items() if name not in used and not CARRIES.search(name)]
    if (differing := differing_motion(pieces, others, parameters.block)) is not None:
        half = differing.train
        learned = judged if half is None else identify({TRAIN: half}, ("cov",), key[1:], {})[0][key]
        tables["differing"] = differing_errors(robot.tree, learned, differing).assign(
            learned_s=len(half or parts[TRAIN]) / parameters.rate_hz,
            tested_s=len(differing.test) / parameters.rate_hz,
            halved=half is not None,
        )
    stride = max(1, round(parameters.rate_hz / parameters.traces_hz))
    first = list(parts)[1]
    tables |= fitness_tables(robot, parts[TRAIN], [log.time for log in moving.values()], parameters) | {
        "errors": model_comparison.error_table(torques, parts),
        "blocks": model_comparison.block_table(torques, parts, parameters.block),
        "norms": model_comparison.block_norms(torques, parts, parameters.block),
        "bodies": drives_and_load.body_intervals(robot, parts[TRAIN], judged, parameters),
        "links": model_comparison.body_table(models, robot),
        "traces": model_comparison.torque_traces(torques, first, parts[first], parameters.rate_hz, stride),
        "written": model_comparison.write_identified(source, folder / "identified.urdf", robot, judged),
    }
    for (kind, friction), model in models.items():
        write_dynamics_models(model, folder / f"models/{kind}_{friction}.safetensors")
    return models, tables


def joined_parts(logs: str, pieces: Pieces, parameters: MotionParameters) -> dict[str, Motion]:
    """Motion of each part: `TRAIN`, the part verdicts are about, others. Raises InputError: too short."""
    parts = {name: joined_motions([piece for _, piece in named]) for name, named in pieces.items()}
    learned_s, tested_s = (len(motion) / parameters.rate_hz for motion in list(parts.values())[:2])
    if min(map(len, list(parts.values())[:2])) < parameters.block:
        raise InputError(
            f"{logs}: {learned_s:.1f} s to learn from and {tested_s:.1f} s to test on are too short for "
            f"blocks of {BLOCK_S:g} s"
        )
    return parts


def fitness_tables(
    robot: Robot, motion: Motion, stamps: Sequence[np.ndarray], parameters: MotionParameters
) -> dict[str, pd.DataFrame]:
    """Base parameters of the training motion, and fitness of its logs for learning."""
    base = base_parameters(robot.tree)
    fit = fit_base(robot.tree, base, motion, FRICTION, *parameters.drawing)
    formulas, values = base.formulas(robot.tree), base.values(robot.inertias)
    bounds = {"value": fit.parameters, "low": fit.low, "high": fit.high, "urdf": values}
    clock_hz = (parameters.rate_hz, parameters.smoothing_hz)
    return {
        "gravity": gravity_check(robot, motion, parameters),
        "base": pd.DataFrame({"parameter": formulas} | bounds),
        "fitness": log_fitness(robot, stamps, motion, clock_hz, fit, FRICTION),
        "determined": identified_table(formulas, fit),
        "excitation": pd.DataFrame({"condition": [fit.condition], "parameters": [len(base.columns)]}),
    }


def in_tree_order(tree: KinematicTree, log: Log) -> Log:
    """Sort a log's columns into the robot's joint order."""
    if log.joints == tuple(tree.names):
        return log
    order = joint_order(tree, log.joints, log.name)
    columns: dict[str, Any] = {name: getattr(log, name)[:, order] for name in signals_of(type(log))}
    return replace(log, joints=tuple(tree.names), **columns)


def cut_motion(log: JointLog, parameters: MotionParameters) -> tuple[Motion, slice]:
    """Longest motion of a log, and its place on the clock."""
    whole = measured_motion(
        *(log.name, log.time, log.positions, log.velocities, log.torques),
        *(parameters.rate_hz, parameters.smoothing_hz),
    )
    cut = longest_motion(log.name, whole.qd, parameters)
    return whole.part(cut), cut


def moving_logs(logs: Mapping[str, Log], parameters: MotionParameters) -> dict[str, Log]:
    """Logs in which every joint moves; errors on resting logs would be meaningless."""
    slow = parameters.rest_rad_s or 0.0
    return {name: log for name, log in logs.items() if np.abs(log.velocities).max(axis=0).min() > slow}


def logs_that_are_there(logs: Mapping[str, Log], parameters: MotionParameters) -> MotionParameters:
    """Adapt parameters to the available logs, with every pair of logs without and with the load.

    If the named training log is missing, it becomes the longest motion without load; a missing test log, the
    longest of the others. A log with the load is paired with the log of its name without load, or with the
    training log. Without a log at rest, drives have none.

    Raises MissingInputError: fewer than two motions are without load.
    """
    moving = moving_logs(logs, parameters)
    empty = [name for name in moving if not CARRIES.search(name)]
    named = [name for name in (parameters.train, parameters.test) if name in empty]
    others = sorted(set(empty) - set(named), key=lambda name: (-moving[name].time[-1], name))
    if len(empty) < 2:
        raise MissingInputError(
            f"of {len(logs)} logs {len(empty)} are motions of all joints without a load, and two are needed: "
            "one to learn from and another one to test on"
        )
    train = parameters.train if parameters.train in named else others.pop(0)
    test = parameters.test if parameters.test in named else others.pop(0)
    update: dict[str, object] = {"train": train, "test": test}
    if parameters.drives is not None:
        slow, rest = parameters.rest_rad_s or 0.0, parameters.drives.rest
        resting = [name for name, log in logs.items() if np.abs(log.velocities).max() <= slow]
        rest = rest if rest in resting else next(iter(resting), None)
        update["drives"] = parameters.drives.model_copy(update={"rest": rest})
    if parameters.load is not None:
        pairs = [pair for pair in parameters.load.pairs if set(pair) <= set(moving)]
        known = {pair[1] for pair in pairs}
        for loaded in (name for name in moving if THE_LOAD.search(name) and name not in known):
            stem = THE_LOAD.sub("", loaded)
            pairs.append((next((name for name in (stem, f"{stem}unload") if name in empty), train), loaded))
        update["load"] = parameters.load.model_copy(update={"pairs": tuple(pairs)})
    return parameters.model_copy(update=update)


def held_out_pieces(motions: Mapping[str, Motion], parameters: MotionParameters) -> Pieces:
    """Split motions into training (`TRAIN`) and test pieces.

    Named logs are parts of their own, including those without load that no parameter names. Otherwise the
    last log is the test part. A single log (or the first, if `train_share` is given) is split into its
    start for training and the rest, or into blocks of time.
    """
    names = list(motions)
    if parameters.train is not None:
        test = [name for name in names if name != parameters.train and not CARRIES.search(name)]
        test.sort(key=lambda name: name != parameters.test)
        learned = {TRAIN: [(parameters.train, motions[parameters.train])]}
        return learned | {name: [(name, motions[name])] for name in test}
    if parameters.train_share is not None:
        start, rest = motions[names[0]].split(parameters.train_share)
        return {TRAIN: [(names[0], start)], TEST: [(names[0], rest)]}
    if len(names) > 1:
        return {TRAIN: list(motions.items())[:-1], TEST: list(motions.items())[-1:]}
    motion, name = motions[names[0]], names[0]
    pieces = [(name, motion.part(piece)) for piece in blocks(np.arange(len(motion)), parameters.block)]
    kept = [piece for place, piece in enumerate(pieces) if place % TEST_EVERY != TEST_EVERY - 1]
    return {TRAIN: kept, TEST: pieces[TEST_EVERY - 1 :: TEST_EVERY] or [(name, motion.part(slice(0, 0)))]}


def _motion_table(
    logs: Mapping[str, Any], cuts: Mapping[str, slice], pieces: Pieces, parameters: MotionParameters
) -> pd.DataFrame:
    words = {(True, True): "both", (True, False): "learned from", (False, True): "tested on"}
    rows, rate_hz = [], parameters.rate_hz
    for name, cut in cuts.items():
        seconds = {
            part: sum(len(piece) for log, piece in cuts if log == name) / rate_hz
            for part, cuts in pieces.items()
        }
        learned, tested = seconds.pop(TRAIN), sum(seconds.values())
        unused = "with the load" if CARRIES.search(name) else "neither"
        row = {"log": name, "part": words.get((learned > 0, tested > 0), unused)}
        row |= {"start_s": cut.start / rate_hz, "end_s": cut.stop / rate_hz}
        rows.append(row | {"length_s": logs[name].time[-1], "learned_s": learned, "tested_s": tested})
    return pd.DataFrame(rows)


def gravity_check(robot: Robot, motion: Motion, parameters: MotionParameters) -> pd.DataFrame:
    """Check whether measured torques contain the gravity of the URDF's links.

    Least squares explain each joint's torque by gravity, the other torques of the URDF's links, and friction.
    A share of one means gravity in N m with the expected sign; zero means that the driver compensates
    gravity, a negative share that the sign is reversed, and any other value suggests another unit. Returns
    `joint`, `name`, `gravity_n_m`, `torque_n_m` (std), `share`, `holds` (`yes`, `no`, `doubtful`; `not
    tested` if gravity hardly varies), `limit_n_m` (of the URDF).
    """
    still = Motion(motion.q, *np.zeros((3, *motion.q.shape)))
    gravity = rigid_body_torques(robot.tree, robot.inertias, still)
    moving = rigid_body_torques(robot.tree, robot.inertias, motion) - gravity
    friction = friction_columns(motion.q, motion.qd, FRICTION)
    parts = np.concatenate([gravity[..., None], moving[..., None], friction], axis=2)
    each = list(zip(parts.swapaxes(0, 1), motion.torque.T, strict=True))
    share = np.array([np.linalg.lstsq(columns, torque, rcond=None)[0][0] for columns, torque in each])
    varies, least = np.array([column.std() for column in gravity.T]), GRAVITY_SHARE
    cases = [varies < parameters.gravity_n_m, (least <= share) & (share <= 1.0 / least), share < 1.0 - least]
    return pd.DataFrame(
        {
            "joint": np.arange(1, motion.joints + 1),
            "name": robot.tree.names,
            "gravity_n_m": varies,
            "torque_n_m": [torque.std() for _, torque in each],
            "share": share,
            "holds": np.select(cases, ["not tested", "yes", "no"], "doubtful"),
            "limit_n_m": robot.model.effortLimit.copy(),
        }
    )


def choose_networks(
    tree: KinematicTree, motion: Motion, parameters: NetworkChoiceParameters
) -> tuple[dict[Kind, NetworkTraining], pd.DataFrame]:
    """Choose nodes, rate and epochs of each kind of network by the error on the end of the training motion.

    Returns the choice by kind; and `kind`, `hidden`, `rate`, `epochs`, `nmse` (mean over joints and seeds on
    the end of the motion; NaN if there is only one candidate), `chosen`.
    """
    settings, decay = [], parameters.second_moment_decay
    for hidden, rate in product(parameters.hidden, parameters.rates):
        adam = AdamParameters(rate=rate, batch=parameters.batch, second_moment_decay=decay)
        settings.append(LearningParameters(hidden=hidden, networks=adam, structures=adam, threshold=1.0))
    work = sorted(product(NETWORKS, settings), key=lambda item: item[0] != "delan")  # longest first
    results = [[np.nan]] * len(work)
    if len(settings) * len(parameters.epochs) > 1:
        parts = motion.split(parameters.train_share)
        tried = partial(_tried, tree=tree, parts=parts, parameters=parameters)
        results = parallel_map(tried, work, "networks")
    rows: list[tuple[str, str, float, int, float]] = []
    chosen: dict[Kind, tuple[float, int, NetworkTraining]] = {}
    for (kind, setting), errors in zip(work, results, strict=True):
        nodes = "-".join(map(str, setting.hidden))
        for epochs, error in zip(sorted(parameters.epochs), errors, strict=True):
            if kind not in chosen or error < chosen[kind][0]:
                chosen[kind] = error, len(rows), NetworkTraining(setting, parameters.seeds, epochs)
            rows.append((kind, nodes, setting.networks.rate, epochs, error))
    table = pd.DataFrame(rows, columns=["kind", "hidden", "rate", "epochs", "nmse"])
    table["chosen"] = table.index.isin([place for _, place, _ in chosen.values()])
    return {kind: training for kind, (_, _, training) in chosen.items()}, table


def _tried(
    candidate: tuple[Kind, LearningParameters],
    tree: KinematicTree,
    parts: tuple[Motion, Motion],
    parameters: NetworkChoiceParameters,
) -> list[float]:
    """Error on the second part after each number of epochs on the first part."""
    (kind, learning), (first, rest) = candidate, parts
    terms = FRICTIONS[NETWORKS[kind][-1]]
    errors = []
    with one_thread():
        data, seeds = TrainingData(tree, first, terms), range(parameters.choice_seeds)
        models = learner(kind, data, "normalised", seeds, learning)
        for epoch in shuffled_epochs(models, max(parameters.epochs)):
            if epoch in parameters.epochs:
                learned = DynamicsModels(kind, tree.names, terms, learning.hidden, models.state())
                torques = predicted_torques(learned, tree, rest)
                errors.append(float(np.mean([nmse(predicted, rest.torque) for predicted in torques])))
    return errors
