"""Learned models as inverse dynamics of one state, for control loops."""

from collections.abc import Sequence

import numpy as np

from structlearn.ground.errors import InputError
from structlearn.networks.compiled_layers import Layers, layer_values, pack
from structlearn.rigid_body.any_model import (
    LAGRANGIAN,
    PERCEPTRON,
    InverseDynamics,
    bodies_model,
    networks_model,
)
from structlearn.rigid_body.compiled_dynamics import friction_rows, inverse_dynamics
from structlearn.rigid_body.compiled_networks import Networks
from structlearn.rigid_body.dynamics_models import DynamicsModels
from structlearn.rigid_body.lagrangian import SMALLEST_INERTIA, StackedLagrangianNetworks
from structlearn.rigid_body.multilayer_perceptron import SCALING, StackedPerceptrons
from structlearn.rigid_body.tree import KinematicTree, LinkInertias


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
    networks = None if models.structured else models.networks()
    if isinstance(networks, StackedPerceptrons):  # they need no friction beside them
        return networks_model(PERCEPTRON, perceptron(networks, model))
    friction = friction_rows(models.friction_coefficients()[model], models.friction)
    if isinstance(networks, StackedLagrangianNetworks):
        return networks_model(LAGRANGIAN, lagrangian(networks, model, friction))
    every = models.inertias()
    own = LinkInertias(every.mass[model], every.first_moment[model], every.inertia[model])
    return bodies_model(inverse_dynamics(tree, own, friction))


def perceptron(networks: StackedPerceptrons, model: int) -> Networks:
    """One of M perceptrons as inverse dynamics of one state.

    Args:
        networks: trained.
        model: which, from 0.
    """
    layers = networks.network.layers_of(model)
    mean, scale, out_mean, out_scale = (getattr(networks, name).double().numpy() for name in SCALING)
    # Standardising is linear and becomes part of the first and the last layer.
    (weights, biases), inner = layers[0], layers[1:]
    turned = np.ascontiguousarray(weights.T) / scale[:, None]
    layers = [(turned.T, biases - mean @ turned), *inner]
    weights, biases = layers[-1]
    layers[-1] = (weights * out_scale[:, None], biases * out_scale + out_mean)
    nowhere = np.empty(0, dtype=np.int64)
    return _packed([layers], nowhere, nowhere, 0.0, np.zeros((3, len(out_mean))))


def lagrangian(
    networks: StackedLagrangianNetworks, model: int, friction: np.ndarray | None = None
) -> Networks:
    """One of M deep Lagrangian networks as inverse dynamics of one state.

    Args:
        networks: trained.
        model: which, from 0.
        friction: (3, n) rows of friction (`friction_rows`) that act beside the network; None: none.
    """
    layers = [part.layers_of(model) for part in (networks.inertia, networks.potential)]
    places = (networks.row.argmax(dim=1).numpy(), networks.column.argmax(dim=1).numpy())
    rubbing = np.zeros((3, networks.joints)) if friction is None else friction
    return _packed(layers, *places, SMALLEST_INERTIA, rubbing)


def _packed(
    layers: Sequence[Layers],
    rows: np.ndarray,
    columns: np.ndarray,
    least_inertia: float,
    friction: np.ndarray,
) -> Networks:
    inputs = [np.shape(own[0][0])[1] for own in layers]
    packed = pack([(np.zeros(n), np.ones(n), own) for n, own in zip(inputs, layers, strict=True)])
    memory = np.stack([layer_values(packed.sizes)] * len(layers))
    return Networks(
        packed.values, packed.first, packed.sizes, memory, rows, columns, least_inertia, np.array(friction)
    )
