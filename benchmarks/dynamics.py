"""Dynamics of 6000 samples of the iiwa: state by state, the regressor, a step of training, an epoch of DeLaN.

Pinocchio computes the same regressor sample by sample; its order of the inertia's entries differs. A step of
training is torques of the whole set, their squared error and its gradient to the free parameters of cov.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pybullet_data
import torch
from timing import Case, Contender

from structlearn.rigid_body import compiled_dynamics
from structlearn.rigid_body.inertia_parameters import draw, link_inertias
from structlearn.rigid_body.network_models import StackedLagrangianNetworks
from structlearn.rigid_body.newton_euler import inverse_dynamics
from structlearn.rigid_body.regressor import link_parameters, torque_regressor
from structlearn.rigid_body.tree import Robot, read_urdf

IIWA = Path(pybullet_data.getDataPath()) / "kuka_iiwa" / "model.urdf"
SEED = 7
SAMPLES = 6000
SAME = 1e-9
BATCH = 256
HIDDEN = (32, 64, 32)
# of the inertia: xx, xy, yy, xz, yz, zz where ours has xx, xy, xz, yy, yz, zz
PINOCCHIO_ENTRIES = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]


def state_by_state() -> Case:
    """Torques of one state after the other, each a call from Python, as a controller makes it."""
    robot, motion = iiwa()
    torques = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)
    expected = _in_a_loop(_pinocchio_rnea(robot), motion)()
    return Case(
        work=f"inverse dynamics, {SAMPLES} states one by one",
        ours=Contender(_in_a_loop(torques, motion), lambda found: _error(found, expected)),
        peers={
            "Pinocchio rnea": lambda: _one_by_one(_pinocchio_rnea(robot), motion, expected),
            "MuJoCo mj_inverse": lambda: _one_by_one(_mujoco_inverse(), motion, expected),
        },
        tolerance=1e-6,  # MuJoCo turns the URDF's inertias into principal axes
        note="a call from Python for each state: numba unpacks the model's arrays each time, which compiled "
        "callers (simulators, the controller) do not pay for",
    )


def _one_by_one(
    torques: Callable[..., np.ndarray], motion: tuple[np.ndarray, ...], expected: np.ndarray
) -> Contender:
    return Contender(_in_a_loop(torques, motion), lambda found: _error(found, expected))


def _in_a_loop(
    torques: Callable[..., np.ndarray], motion: tuple[np.ndarray, ...]
) -> Callable[[], np.ndarray]:
    def run() -> np.ndarray:
        found = np.empty_like(motion[0])
        for sample, state in enumerate(zip(*motion, strict=True)):
            found[sample] = torques(*state)
        return found

    return run


def _pinocchio_rnea(robot: Robot) -> Callable[..., np.ndarray]:
    import pinocchio

    data = robot.model.createData()
    return lambda *state: pinocchio.rnea(robot.model, data, *state)


def _mujoco_inverse() -> Callable[..., np.ndarray]:
    """MuJoCo reads the same URDF, without its shapes, and without the damping that it gives the joints."""
    import mujoco

    root = ElementTree.parse(IIWA).getroot()
    for link in root.iter("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    model = mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))
    model.dof_damping[:], model.dof_frictionloss[:] = 0.0, 0.0
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(model)

    def torques(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        data.qpos, data.qvel, data.qacc = q, qd, qdd
        mujoco.mj_inverse(model, data)
        return data.qfrc_inverse

    return torques


def regressor() -> Case:
    """Y of the whole set, computed once before a training."""
    robot, motion = iiwa()
    expected = _pinocchio_regressor(robot, motion)()
    columns = (10 * np.arange(len(robot.tree.names))[:, None] + PINOCCHIO_ENTRIES).ravel()
    return Case(
        work=f"regressor, {SAMPLES} samples of the iiwa",
        ours=Contender(
            lambda: torque_regressor(robot.tree, *motion), lambda found: _error(found, expected[..., columns])
        ),
        peers={
            "Pinocchio": lambda: Contender(
                _pinocchio_regressor(robot, motion), lambda found: _error(found, expected)
            )
        },
        aim_ms=30.0,
        tolerance=SAME,
        note="once per data set; Pinocchio in a Python loop over samples",
    )


def training_step() -> Case:
    """Forward and gradient through the parameterisation, by the regressor and by the recursion."""
    robot, motion = iiwa()
    free = _free(len(robot.tree.names))
    torques = torch.from_numpy(np.random.default_rng(SEED).normal(size=motion[0].shape))
    columns = torch.from_numpy(torque_regressor(robot.tree, *motion)).flatten(0, 1).T.contiguous()
    states = [torch.from_numpy(values) for values in motion]

    def by_recursion() -> np.ndarray:
        found = inverse_dynamics(robot.tree, link_inertias("cov", free), *states)
        return _gradient((found - torques).square().mean(), free)

    expected = by_recursion()
    return Case(
        work=f"inverse dynamics forward + gradient, {SAMPLES} samples",
        ours=Contender(
            step_by_regressor(len(robot.tree.names), columns, torques.flatten()),
            lambda found: _error(found, expected),
        ),
        peers={"our recursion": lambda: Contender(by_recursion, lambda found: _error(found, expected))},
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
    return draw("cov", joints, [torch.Generator().manual_seed(SEED)])[0].requires_grad_()


def lagrangian_epoch() -> Case:
    """Forward and gradient of all batches of an epoch, of one network in single precision."""
    _, motion = iiwa()
    batches = [
        [part.T.contiguous() for part in parts]
        for parts in zip(*[torch.from_numpy(values).float().split(BATCH) for values in motion], strict=True)
    ]
    network = StackedLagrangianNetworks.initial(
        motion[0].shape[1], HIDDEN, [torch.Generator().manual_seed(SEED)]
    )
    expected = _summed_gradient(network, batches, network.torques)
    return Case(
        work=f"DeLaN epoch, {SAMPLES} samples, forward + gradient",
        ours=Contender(
            lambda: _summed_gradient(network, batches, network.torques), lambda found: _error(found, expected)
        ),
        peers={
            "torch.func, as defined": lambda: Contender(
                lambda: _summed_gradient(network, batches, partial(_torques_by_jacobian, network)),
                lambda found: _error(found, expected),
            )
        },
        aim_ms=130.0,
        tolerance=1e-4,  # single precision
        note=f"batches of {BATCH}; without the optimiser's step",
    )


def _torques_by_jacobian(
    network: StackedLagrangianNetworks, q: torch.Tensor, qd: torch.Tensor, qdd: torch.Tensor
) -> torch.Tensor:
    """The definition: H(q) qdd + Hdot qd - d(qd^T H qd)/dq / 2 + dV/dq, one sample at a time under vmap."""

    def one(q: torch.Tensor, qd: torch.Tensor, qdd: torch.Tensor) -> torch.Tensor:
        slopes = torch.func.jacfwd(lambda q: network.inertia_matrix(q[:, None])[0, 0])(q)  # (n, n, n)
        gravity = torch.func.grad(lambda q: network.potential_energy(q[:, None])[0, 0])(q)
        centrifugal = 0.5 * torch.einsum("ijk,i,j->k", slopes, qd, qd)
        inertia = network.inertia_matrix(q[:, None])[0, 0]
        return inertia @ qdd + torch.einsum("ijk,k,j->i", slopes, qd, qd) - centrifugal + gravity

    return torch.func.vmap(one)(q.T, qd.T, qdd.T).T


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


def iiwa(samples: int = SAMPLES) -> tuple[Robot, tuple[np.ndarray, ...]]:
    """The robot, and positions, velocities and accelerations (samples, n) of its joints."""
    robot = read_urdf(IIWA)
    motion = np.random.default_rng(SEED).normal(size=(3, samples, len(robot.tree.names)))
    return robot, tuple(motion)


def _pinocchio_regressor(robot: Robot, motion: tuple[np.ndarray, ...]) -> Callable[[], np.ndarray]:
    import pinocchio

    data = robot.model.createData()

    def run() -> np.ndarray:
        samples, joints = motion[0].shape
        found = np.empty((samples, joints, 10 * joints))
        for sample, state in enumerate(zip(*motion, strict=True)):
            found[sample] = pinocchio.computeJointTorqueRegressor(robot.model, data, *state)
        return found

    return run


def _gradient(loss: torch.Tensor, free: torch.Tensor) -> np.ndarray:
    return torch.autograd.grad(loss, free)[0].numpy()


def _error(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(found - expected).max() / np.abs(expected).max())


CASES = (state_by_state, regressor, training_step, lagrangian_epoch)
