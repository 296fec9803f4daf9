"""Learning dynamics from 6000 samples of the iiwa: step of training, torques and epoch of DeLaN.

A step of training is torques of the whole set, their squared error and its gradient to the free parameters
of cov.
"""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import torch
from arm_motions import SAMPLES, SEED, iiwa, relative_error
from timing import Case, Contender
from torch.nn import functional

from structlearn.rigid_body.inertia_parameters import (
    STRUCTURES,
    link_inertias,
    sample_parameters,
    structure_gradient,
    structure_theta,
)
from structlearn.rigid_body.network_models import SMALLEST_INERTIA, StackedLagrangianNetworks
from structlearn.rigid_body.regressor import link_parameters, torque_regressor

SAME = 1e-9
BATCH = 256
HIDDEN = (32, 64, 32)
SINGLE = 1e-4  # of single precision


def training_step() -> Case:
    """Forward and gradient through the parameterisation, by torch and by the compiled reverse pass."""
    robot, motion = iiwa()
    joints = len(robot.tree.names)
    free = _free(joints).detach().numpy()[None]
    torques = torch.from_numpy(np.random.default_rng(SEED).normal(size=motion[0].shape)).flatten()
    columns = torch.from_numpy(torque_regressor(robot.tree, *motion)).flatten(0, 1).T.contiguous()
    cov, friction, squared = STRUCTURES.index("cov"), np.empty((1, joints, 0)), np.empty(0, dtype=bool)

    def compiled() -> np.ndarray:
        error = structure_theta(cov, free, friction, squared) @ columns.numpy() - torques.numpy()
        slope = 2.0 / error.size * (error @ columns.numpy().T)
        return structure_gradient(cov, free, friction, squared, slope)[0][0]

    expected = compiled()
    return Case(
        work=f"inverse dynamics forward + gradient, {SAMPLES} samples",
        ours=Contender(compiled, lambda found: relative_error(found, expected)),
        peers={
            "autograd, same form": lambda: Contender(
                step_by_regressor(joints, columns, torques), lambda found: relative_error(found, expected)
            )
        },
        aim_ms=5.0,
        tolerance=SAME,
        note="the regressor is computed beforehand and stored by columns",
    )


def step_by_regressor(joints: int, columns: torch.Tensor, torques: torch.Tensor) -> Callable[[], np.ndarray]:
    """A step of training by the regressor's columns (10 n, B n) for measured torques (B n,)."""
    free = _free(joints)

    def run() -> np.ndarray:
        found = link_parameters(link_inertias("cov", free)) @ columns
        return _gradient((found - torques).square().mean(), free)

    return run


def _free(joints: int) -> torch.Tensor:
    """Free parameters of cov for as many links."""
    return sample_parameters("cov", joints, [torch.Generator().manual_seed(SEED)])[0].requires_grad_()


def lagrangian_torques() -> Case:
    """Torques of the whole set by one network in single precision."""
    network, batches = _lagrangian()
    everything = partial(_torques, batches, network.torques)
    expected = everything()
    return Case(
        work=f"DeLaN torques, {SAMPLES} samples",
        ours=Contender(everything, lambda found: relative_error(found, expected)),
        peers={
            "autograd, same form": lambda: Contender(
                partial(_torques, batches, partial(torques_by_autograd, network)),
                lambda found: relative_error(found, expected),
            )
        },
        tolerance=SINGLE,
        note=f"batches of {BATCH}; one closed form, whose derivatives by the time and the positions are "
        "written out in ours, and torch's in the other",
    )


def lagrangian_epoch() -> Case:
    """Forward and gradient of all batches of an epoch, of one network in single precision."""
    network, batches = _lagrangian()
    expected = _summed_gradient(network, batches, network.torques)
    return Case(
        work=f"DeLaN epoch, {SAMPLES} samples, forward + gradient",
        ours=Contender(
            lambda: _summed_gradient(network, batches, network.torques),
            lambda found: relative_error(found, expected),
        ),
        peers={
            "autograd, same form": lambda: Contender(
                lambda: _summed_gradient(network, batches, partial(torques_by_autograd, network)),
                lambda found: relative_error(found, expected),
            )
        },
        aim_ms=130.0,
        tolerance=SINGLE,
        note=f"batches of {BATCH}; the same torques with their gradient, without the optimiser's step",
    )


def _lagrangian() -> tuple[StackedLagrangianNetworks, list[list[torch.Tensor]]]:
    """A network, and q, qd, qdd (n, B) of each batch."""
    _, motion = iiwa()
    batches = [
        [part.T.contiguous() for part in parts]
        for parts in zip(*[torch.from_numpy(values).float().split(BATCH) for values in motion], strict=True)
    ]
    joints = motion[0].shape[1]
    return StackedLagrangianNetworks.initial(joints, HIDDEN, [torch.Generator().manual_seed(SEED)]), batches


def torques_by_autograd(
    network: StackedLagrangianNetworks, q: torch.Tensor, qd: torch.Tensor, qdd: torch.Tensor
) -> torch.Tensor:
    """Torques (n, B) by the closed form of `network_models`, with torch's derivatives, which share L's pass.

    dL/dt by forward mode along the motion. The gradient of the energy by backward mode for the batch: samples
    do not act on each other, so that the gradient of a sum has each sample's own.
    """
    training = torch.is_grad_enabled()

    def factor(q: torch.Tensor) -> torch.Tensor:
        """L (B, n, n)."""
        raw = network.inertia.forward(q[None])[0]
        entries = torch.cat([functional.softplus(raw[: len(q)]), raw[len(q) :]])
        return torch.einsum("ei,ej,eb->bij", network.row, network.column, entries)

    with torch.enable_grad():
        at = q.detach().requires_grad_()
        lower, rate = torch.func.jvp(factor, (at,), (qd,))
        momentum = torch.einsum("bij,ib->bj", lower, qd)  # L^T qd
        energy = network.potential_energy(at).sum() - 0.5 * momentum.square().sum()
        (slope,) = torch.autograd.grad(energy, at, create_graph=training, retain_graph=True)
    bracket = torch.einsum("bij,ib->bj", lower, qdd) + torch.einsum("bij,ib->bj", rate, qd)
    inertial = torch.einsum("bij,bj->ib", lower, bracket) + torch.einsum("bij,bj->ib", rate, momentum)
    return inertial + SMALLEST_INERTIA * qdd + slope


def _torques(batches: Sequence[list[torch.Tensor]], torques: Callable[..., torch.Tensor]) -> np.ndarray:
    """(n, N) of all batches, without gradients."""
    with torch.no_grad():
        return torch.cat([torques(*batch).reshape(len(batch[0]), -1) for batch in batches], dim=1).numpy()


def _summed_gradient(
    network: StackedLagrangianNetworks,
    batches: list[list[torch.Tensor]],
    torques: Callable[..., torch.Tensor],
) -> np.ndarray:
    """Of the mean squared torques of each batch, to all weights that act."""
    variables = network.parameters()
    total = 0.0
    for batch in batches:
        gradients = torch.autograd.grad(torques(*batch).square().mean(), variables, allow_unused=True)
        total = total + torch.cat([part.flatten() for part in gradients if part is not None])
    return total.numpy()


def _gradient(loss: torch.Tensor, free: torch.Tensor) -> np.ndarray:
    return torch.autograd.grad(loss, free)[0].numpy()


CASES = (training_step, lagrangian_torques, lagrangian_epoch)
