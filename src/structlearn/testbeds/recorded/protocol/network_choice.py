"""Networks of every kind chosen alike: by the end of the motion that they learn the start of."""

from functools import partial
from itertools import product

import numpy as np
import pandas as pd

from structlearn.ground.metrics import nmse
from structlearn.ground.parallel import parallel_map
from structlearn.networks.torch_settings import one_thread
from structlearn.rigid_body.arm_identification import NETWORKS, NetworkTraining
from structlearn.rigid_body.dynamics_models import DynamicsModels, predicted_torques
from structlearn.rigid_body.learner import Kind, LearningParameters, Lesson, learner, shuffled_epochs
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.training_grid import FRICTIONS
from structlearn.rigid_body.tree import KinematicTree
from structlearn.testbeds.recorded.protocol.arm_parameters import NetworkChoiceParameters

Candidate = tuple[Kind, LearningParameters]


def choose_networks(
    tree: KinematicTree, motion: Motion, parameters: NetworkChoiceParameters, learning: LearningParameters
) -> tuple[dict[Kind, NetworkTraining], pd.DataFrame]:
    """Nodes, rate and epochs of each kind of network.

    Args:
        tree: the robot.
        motion: to learn from, in the order of time.
        parameters: what there is to choose from.
        learning: all that is not chosen.

    Returns:
        The choice by kind; and `kind`, `hidden`, `rate`, `epochs`, `nmse` (mean over joints and seeds on the
        end of the motion), `chosen`.
    """
    networks = learning.networks.model_copy(update={"batch": parameters.batch})
    settings = [
        learning.model_copy(update={"hidden": hidden, "networks": networks.model_copy(update={"rate": rate})})
        for hidden, rate in product(parameters.hidden, parameters.rates)
    ]
    work: list[Candidate] = sorted(product(NETWORKS, settings), key=lambda item: item[0] != "delan")
    parts = motion.split(parameters.train_share)
    results = parallel_map(partial(_tried, tree=tree, parts=parts, parameters=parameters), work, "networks")
    rows, chosen = [], dict[Kind, tuple[float, int, NetworkTraining]]()
    for (kind, setting), errors in zip(work, results, strict=True):
        hidden = "-".join(map(str, setting.hidden))
        for epochs, error in zip(sorted(parameters.epochs), errors, strict=True):
            rows.append((kind, hidden, setting.networks.rate, epochs, error, False))
            if kind not in chosen or error < chosen[kind][0]:
                training = NetworkTraining(setting, parameters.seeds, epochs)
                chosen[kind] = (error, len(rows) - 1, training)
    table = pd.DataFrame(rows, columns=["kind", "hidden", "rate", "epochs", "nmse", "chosen"])
    table.loc[[place for _, place, _ in chosen.values()], "chosen"] = True
    return {kind: training for kind, (_, _, training) in chosen.items()}, table


def _tried(
    candidate: Candidate,
    tree: KinematicTree,
    parts: tuple[Motion, Motion],
    parameters: NetworkChoiceParameters,
) -> list[float]:
    """Error on the second part after each number of epochs on the first."""
    (kind, learning), (first, rest) = candidate, parts
    terms = FRICTIONS[NETWORKS[kind][-1]]
    errors = []
    with one_thread():
        models = learner(
            kind, Lesson(tree, first, terms), "normalised", range(parameters.choice_seeds), learning
        )
        for epoch in shuffled_epochs(models, max(parameters.epochs)):
            if epoch in parameters.epochs:
                learned = DynamicsModels(kind, tree.names, terms, learning.hidden, models.state())
                torques = predicted_torques(learned, tree, rest)
                errors.append(float(np.mean([nmse(its, rest.torque) for its in torques])))
    return errors
