"""Learned models as inverse dynamics of one state, for control loops."""

from structlearn.ground.errors import InputError
from structlearn.rigid_body import compiled_networks
from structlearn.rigid_body.compiled_dynamics import InverseDynamics, friction_rows, inverse_dynamics
from structlearn.rigid_body.model_files import DynamicsModels
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
    if models.kind in ("mlp", "mlp_scaled"):  # they need no friction beside them
        return compiled_networks.perceptron(models.networks(), model)
    friction = friction_rows(models.friction_coefficients()[model], models.friction)
    if models.kind == "delan":
        return compiled_networks.lagrangian(models.networks(), model, friction)
    every = models.inertias()
    own = LinkInertias(every.mass[model], every.first_moment[model], every.inertia[model])
    return inverse_dynamics(tree, own, friction)
