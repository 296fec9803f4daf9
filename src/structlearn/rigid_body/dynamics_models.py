"""Learned dynamics models: reading and writing, inertias, friction, torques, compiled inverse dynamics."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

from structlearn.core.artefacts import holding, read_description, read_tensors, write_tensors
from structlearn.core.errors import InputError
from structlearn.networks.compiled_layers import Layers, layer_values, pack
from structlearn.rigid_body.compiled_dynamics import (
    LAGRANGIAN,
    NO_ROBOT,
    PERCEPTRON,
    InverseDynamics,
    Networks,
    friction_rows,
    inverse_dynamics,
)
from structlearn.rigid_body.dynamics_training import KINDS, Kind
from structlearn.rigid_body.friction import FrictionTerm, friction_coefficients, friction_columns
from structlearn.rigid_body.inertia_parameters import STRUCTURES, Structure, link_inertias
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.network_models import (
    SCALING,
    SMALLEST_INERTIA,
    StackedLagrangianNetworks,
    StackedPerceptrons,
)
from structlearn.rigid_body.regressor import link_parameters, torque_regressor
from structlearn.rigid_body.tree import KinematicTree, LinkInertias

HEADING = "dynamics_models"


@dataclass(frozen=True)
class DynamicsModels:
    """M learned models of one kind, e.g. one per seed.

    Tensors of the state have a leading axis of models. Structures have free parameters `inertia` (M, n, k)
    and `friction` (M, n, t); networks have weights and `friction`.
    """

    kind: Kind
    joints: tuple[str, ...]  # names, in the order of states and torques
    friction: tuple[FrictionTerm, ...]  # learned terms of joint friction
    hidden: tuple[int, ...]  # width of each hidden layer; empty for structures
    state: Mapping[str, np.ndarray]

    @property
    def structured(self) -> bool:
        """Whether these are rigid-body models, not networks."""
        return self.kind in STRUCTURES

    @property
    def structure(self) -> Structure:
        """Parameterisation of the inertias."""
        assert self.kind in STRUCTURES, "networks have no inertias"
        return self.kind

    def inertias(self) -> LinkInertias[np.ndarray]:
        """Mass (M, n), first moment and inertia of the links; structures only."""
        return link_inertias(self.structure, torch.from_numpy(self.state["inertia"])).arrays()

    def friction_coefficients(self) -> np.ndarray:
        """(M, n, t) coefficients of the friction terms; t = 0 if no friction was learned."""
        free = self.state["friction"]
        if not self.friction:
            return np.zeros((len(free), len(self.joints), 0))
        return friction_coefficients(torch.from_numpy(free), self.friction).double().numpy()

    def networks(self) -> StackedPerceptrons | StackedLagrangianNetworks:
        """All M networks, without friction."""
        network = StackedLagrangianNetworks if self.kind == "delan" else StackedPerceptrons
        return network.from_arrays({name: torch.from_numpy(values) for name, values in self.state.items()})


def write_dynamics_models(models: DynamicsModels, path: str | Path) -> None:
    """Publish models as safetensors: the state, and a JSON description of the other fields."""
    description = {name: getattr(models, name) for name in ("kind", "joints", "friction", "hidden")}
    write_tensors(models.state, path, json.dumps({HEADING: description}, sort_keys=True))


def read_dynamics_models(path: str | Path) -> DynamicsModels:
    """Read models written by `write_dynamics_models`.

    Raises:
        InputError: the file is missing, is not such a file, or holds a value that is not finite.
    """
    state = read_tensors(path)
    with holding(path, "dynamics models"):
        description = json.loads(read_description(path))[HEADING]
        fields = {name: tuple(description[name]) for name in ("joints", "friction", "hidden")}
        models = DynamicsModels(description["kind"], **fields, state=state)
        expected = "inertia" if models.structured else None
        if models.kind not in KINDS or "friction" not in state or (expected and expected not in state):
            raise KeyError(expected or models.kind)
        return models


def rigid_body_torques(tree: KinematicTree, inertias: LinkInertias, motion: Motion) -> np.ndarray:
    """Torques (M, N, n) in N m of inertias with mass (M, n), or (N, n) for mass (n,); no friction."""
    columns = torque_regressor(tree, motion.q, motion.qd, motion.qdd, symmetric=False)
    theta = link_parameters(inertias.tensors(), symmetric=False).numpy()
    return np.moveaxis(columns @ theta.T, -1, 0) if theta.ndim == 2 else columns @ theta


def predicted_torques(models: DynamicsModels, tree: KinematicTree, motion: Motion) -> np.ndarray:
    """Torques (M, N, n) in N m of M learned models on a motion, including friction."""
    if models.structured:
        torques = rigid_body_torques(tree, models.inertias(), motion)
    else:
        states = (
            torch.tensor(np.ascontiguousarray(values.T), dtype=torch.float32)
            for values in (motion.q, motion.qd, motion.qdd)
        )
        with torch.no_grad():
            torques = np.swapaxes(models.networks().torques(*states).double().numpy(), 1, 2)
    if models.friction:
        columns = friction_columns(motion.q, motion.qd, models.friction)
        torques = torques + np.einsum("njt,mjt->mnj", columns, models.friction_coefficients())
    return torques


def torque_parts(models: DynamicsModels, tree: KinematicTree, motion: Motion) -> dict[str, np.ndarray]:
    """Inertial, Coriolis (and centrifugal) and gravity torques (M, N, n) in N m, without friction."""
    rest = np.zeros_like(motion.qd)
    frictionless = replace(models, friction=())
    gravity, moving, accelerating = (
        predicted_torques(frictionless, tree, replace(motion, qd=qd, qdd=qdd))
        for qd, qdd in ((rest, rest), (motion.qd, rest), (rest, motion.qdd))
    )
    return {"inertial": accelerating - gravity, "coriolis": moving - gravity, "gravity": gravity}


def compiled_model(models: DynamicsModels, model: int, tree: KinematicTree) -> InverseDynamics:
    """Compiled inverse dynamics of one of M learned models, including its friction.

    Raises:
        InputError: the models were learned on an arm with other joints.
    """
    if models.joints != tree.names:
        raise InputError(
            f"models of kind {models.kind}: learned with the joints {', '.join(models.joints)}; the arm has "
            f"{', '.join(tree.names)}"
        )
    friction = friction_rows(models.friction_coefficients()[model], models.friction)
    if models.structured:
        return inverse_dynamics(tree, models.inertias().of(model), friction)
    networks, rows, columns = models.networks(), np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    if isinstance(networks, StackedPerceptrons):
        kind, layers = PERCEPTRON, [_with_scales(networks, model)]
    else:
        kind, layers = LAGRANGIAN, [part.layers_of(model) for part in (networks.inertia, networks.potential)]
        rows, columns = (place.argmax(dim=1).numpy() for place in (networks.row, networks.column))
    inputs = [np.shape(own[0][0])[1] for own in layers]
    packed = pack([(np.zeros(n), np.ones(n), own) for n, own in zip(inputs, layers, strict=True)])
    memory = np.stack([layer_values(packed.sizes)] * len(layers))
    return InverseDynamics(
        kind, NO_ROBOT, Networks(*packed, memory, rows, columns, SMALLEST_INERTIA), friction
    )


def _with_scales(networks: StackedPerceptrons, model: int) -> Layers:
    """Layers of one perceptron, with the standardisation folded into its first and last layer."""
    layers = networks.network.layers_of(model)
    mean, scale, out_mean, out_scale = (getattr(networks, name).double().numpy() for name in SCALING)
    (weights, biases), inner = layers[0], layers[1:]
    turned = np.ascontiguousarray(weights.T) / scale[:, None]
    layers = [(turned.T, biases - mean @ turned), *inner]
    weights, biases = layers[-1]
    return [*layers[:-1], (weights * out_scale[:, None], biases * out_scale + out_mean)]
