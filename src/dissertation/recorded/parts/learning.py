"""Parts of the torque of a simulated planar arm, predicted by models trained without some of its logs.

The parts are those of deep Lagrangian networks: a correct torque does not imply correct parts. Networks for
all choices of logs are trained as one stack; shorter sets of logs are filled up by repeating their samples.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from dissertation.recorded.parts.parameters import AUTHORS, RANDOM, PartsParameters
from structlearn.core.errors import InputError
from structlearn.networks.torch_settings import AdamParameters, one_thread, seeded
from structlearn.readers.joint_log import PartedLog, read_log_table
from structlearn.rigid_body.base_parameters import link_table
from structlearn.rigid_body.dynamics_models import DynamicsModels, predicted_torques, torque_parts
from structlearn.rigid_body.dynamics_training import SHARED, learn_annealed
from structlearn.rigid_body.identification import fit_planar_arm, planar_tree
from structlearn.rigid_body.motion import Motion, joined_motions
from structlearn.rigid_body.network_models import NetworkLearner
from structlearn.rigid_body.tree import KinematicTree
from structlearn.tasks.task_files import TaskFiles, write_tables

# Protocol, its seed or the number of the random choice, and the logs left out
Choice = tuple[str, int, tuple[str, ...]]


def learn(files: TaskFiles, folder: Path) -> None:
    """Write the tables of `learn_parts`."""
    logs = {log.name: log for log in read_log_table(files.recorded / "logs.parquet", PartedLog)}
    write_tables(learn_parts(logs, files.entry(PartsParameters)), folder)


def learn_parts(logs: Mapping[str, PartedLog], parameters: PartsParameters) -> dict[str, pd.DataFrame]:
    """Train all models.

    Returns `parts`: `model`, `protocol`, `draw` (a seed, or a random choice), `left_out`, `measure`,
    `error`: mean over samples of the sum of squares over joints in (N m)^2, for power in W^2.
    `planar`: `protocol`, `draw`, `length_m` between the first two joints, `possible` (all links physically
    consistent).

    Raises InputError: a named log is missing, or there are too few.
    """
    if len(logs) <= len(parameters.left_out) or set(parameters.left_out) - set(logs):
        left_out = ", ".join(parameters.left_out)
        raise InputError(f"{', '.join(logs)}: logs to leave out are {left_out}, and others")
    motions = {}
    for name, log in logs.items():
        motions[name] = Motion(log.positions, log.velocities, log.accelerations, log.torques)
    choices = characters_left_out(list(logs), parameters)
    learned_from = [
        joined_motions([motions[name] for name in logs if name not in its]) for _, _, its in choices
    ]
    rows: list[tuple[str, str, int, str, str, float]] = []
    arms, joints = [], learned_from[0].joints
    tree = planar_tree(np.zeros((joints - 1, 2)))
    for kind in parameters.hidden:
        for choice, network in zip(
            choices, learned_networks(kind, tree, learned_from, parameters), strict=True
        ):
            rows += [(kind, *row) for row in errors(network, tree, choice, logs, motions)]
    for choice, motion in zip(choices, learned_from, strict=True):
        protocol, draw, _ = choice
        if protocol == AUTHORS and draw:  # the fit needs no seed
            continue
        tree, model = fit_planar_arm(motion, parameters.iterations)
        rows += [("cov", *row) for row in errors(model, tree, choice, logs, motions)]
        links = link_table(tree, model.inertias(), model.inertias().of(0))
        possible = links[["positive_mass", "positive_definite", "triangle"]].all(axis=None)
        arms.append((protocol, draw, np.linalg.norm(tree.translation[1]), bool(possible)))
    columns = ["model", "protocol", "draw", "left_out", "measure", "error"]
    return {
        "parts": pd.DataFrame(rows, columns=columns),
        "planar": pd.DataFrame(arms, columns=["protocol", "draw", "length_m", "possible"]),
    }


def characters_left_out(names: Sequence[str], parameters: PartsParameters) -> list[Choice]:
    """The authors' choice once per seed, and random choices."""
    generator, count = np.random.default_rng(0), len(parameters.left_out)
    choices: list[Choice] = [(AUTHORS, seed, parameters.left_out) for seed in range(parameters.seeds)]
    for draw in range(parameters.splits):
        choices.append((RANDOM, draw, tuple(sorted(generator.choice(names, count, replace=False).tolist()))))
    return choices


def learned_networks(
    kind: Literal["mlp", "delan"], tree: KinematicTree, motions: Sequence[Motion], parameters: PartsParameters
) -> list[DynamicsModels]:
    """Train one network per motion, seeded by its index."""
    longest = max(map(len, motions))
    filled = [motion.part(np.arange(longest) % len(motion)) for motion in motions]
    hidden, generators = parameters.hidden[kind], [seeded(place) for place in range(len(motions))]
    decay = parameters.second_moment_decay
    adam = AdamParameters(rate=parameters.rate, batch=parameters.batch, second_moment_decay=decay)
    with one_thread():
        models = NetworkLearner(kind, filled, (), np.ones((1, motions[0].joints)), adam, hidden, generators)
        learn_annealed(models, parameters.epochs)
    found = []
    for at in (slice(place, place + 1) for place in range(len(motions))):
        state = {name: its if name in SHARED else its[at] for name, its in models.state().items()}
        found.append(DynamicsModels(kind, tree.names, (), hidden, state))
    return found


def errors(
    model: DynamicsModels,
    tree: KinematicTree,
    choice: Choice,
    logs: Mapping[str, PartedLog],
    motions: Mapping[str, Motion],
) -> list[tuple[str, int, str, str, float]]:
    """Rows of `parts` after the model, for the logs left out."""
    protocol, draw, left_out = choice
    motion = joined_motions([motions[name] for name in left_out])
    error = predicted_torques(model, tree, motion)[0] - motion.torque
    squares = {"torque": error**2, "power": (motion.qd * error).sum(axis=1, keepdims=True) ** 2}
    for part, found in torque_parts(model, tree, motion).items():
        squares[part] = (found[0] - np.concatenate([getattr(logs[name], part) for name in left_out])) ** 2
    where = (protocol, draw, " ".join(left_out))
    return [(*where, measure, float(its.sum(axis=1).mean())) for measure, its in squares.items()]
