"""Inverse dynamics of one state by any kind of model: one compiled loop takes them all.

Known or learned bodies, or networks; learned ones are packed by `compiled_models`.
"""

from typing import NamedTuple

import numba
import numpy as np

from structlearn.rigid_body.compiled_dynamics import RigidBodies, newton_euler
from structlearn.rigid_body.compiled_networks import Networks, lagrangian_torques, perceptron_torques

BODIES, PERCEPTRON, LAGRANGIAN = range(3)


class InverseDynamics(NamedTuple):
    """A model of whatever kind, as arrays.

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
    return InverseDynamics(BODIES, bodies, Networks(*empty, places, places, 0.0, np.empty((3, 0))))


def networks_model(kind: int, networks: Networks) -> InverseDynamics:
    """Networks among all kinds of models."""
    frames, vectors = np.empty((0, 3, 3)), np.empty((0, 3))
    chain = (np.empty(0, dtype=np.int64), frames, vectors, vectors, np.empty(0, dtype=bool))
    nothing = RigidBodies(*chain, np.zeros(3), np.empty(0), vectors, frames, np.empty((3, 0)))
    return InverseDynamics(kind, nothing, networks)


@numba.njit(cache=True)
def model_torques(model: InverseDynamics, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Torques (n,) in N m of a model of any kind."""
    if model.kind == PERCEPTRON:
        return perceptron_torques(model.networks, q, qd, qdd)
    if model.kind == LAGRANGIAN:
        return lagrangian_torques(model.networks, q, qd, qdd)
    return newton_euler(model.bodies, q, qd, qdd)
