"""Any model as inverse dynamics of one state, for control loops: known or learned bodies, or networks."""

from typing import NamedTuple

import numba
import numpy as np

from structlearn.ground.errors import InputError
from structlearn.rigid_body.compiled_dynamics import (
    RigidBodies,
    friction_rows,
    inverse_dynamics,
    newton_euler,
)
from structlearn.rigid_body.compiled_networks import (
    Networks,
    lagrangian,
    lagrangian_torques,
    perceptron,
    perceptron_torques,
)
from structlearn.rigid_body.model_files import DynamicsModels
from structlearn.rigid_body.tree import KinematicTree, LinkInertias

BODIES, PERCEPTRON, LAGRANGIAN = range(3)


class InverseDynamics(NamedTuple):
    """A model of whatever kind, as arrays: one compiled loop runs with them all.

    Attributes:
        kind: `BODIES`, `PERCEPTRON` or `LAGRANGIAN`.
        bodies: of the first kind; without joints of the others.
        networks: of the others; without numbers of the first kind.
    """

    kind: int
    bodies: RigidBodies
    networks: Networks

    def __call__(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        """Torques (n,) in N m at position, velocity and acceleration of the joints, (n,) each."""
        return model_torques(self, q, qd, qdd)


def bodies_model(bodies: RigidBodies) -> InverseDynamics:
    """Rigid bodies among all kinds of models."""
    places = np.empty(0, dtype=np.int64)
    empty = (np.empty(0), places, np.empty((0, 0), dtype=np.int64), np.empty((0, 0, 0)))
    return InverseDynamics(BODIES, bodies, Networks(*empty, places, places, np.empty((3, 0))))


def networks_model(kind: int, networks: Networks) -> InverseDynamics:
    """Networks among all kinds of models."""
    frames, vectors = np.empty((0, 3, 3)), np.empty((0, 3))
    chain = (np.empty(0, dtype=np.int64), frames, vectors, vectors, np.empty(0, dtype=bool))
    nothing = RigidBodies(*chain, np.zeros(3), np.empty(0), vectors, frames, np.empty((3, 0)))
    return InverseDynamics(kind, nothing, networks)


def compiled_model(models: DynamicsModels, model: int, tree: KinematicTree) -> InverseDynamics:
    """One of M learned models, with its friction.

    Args:
        models: of one kind.
        model: which, from 0.
        tree: of the arm; the networks do not use it.

    Raises:
        InputError: the models were learned on an arm with other joints.
    """
    if models.joints != tree.names:
        raise InputError(
            f"models of kind {models.kind}: learned with the joints {', '.join(models.joints)}; the arm has "
            f"{', '.join(tree.names)}"
        )
    if models.kind in ("mlp", "mlp_scaled"):  # they need no friction beside them
        return networks_model(PERCEPTRON, perceptron(models.networks(), model))
    friction = friction_rows(models.friction_coefficients()[model], models.friction)
    if models.kind == "delan":
        return networks_model(LAGRANGIAN, lagrangian(models.networks(), model, friction))
    every = models.inertias()
    own = LinkInertias(every.mass[model], every.first_moment[model], every.inertia[model])
    return bodies_model(inverse_dynamics(tree, own, friction))


@numba.njit(cache=True)
def model_torques(model: InverseDynamics, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Torques (n,) in N m of a model of any kind."""
    if model.kind == PERCEPTRON:
        return perceptron_torques(model.networks, q, qd, qdd)
    if model.kind == LAGRANGIAN:
        return lagrangian_torques(model.networks, q, qd, qdd)
    return newton_euler(model.bodies, q, qd, qdd)
