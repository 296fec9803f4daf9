"""mp_pytorch at the rows of `primitives`, in its fastest documented way.

`ProDMP`, batched over all movements, the only fit it has; unrolled both in this integral form (a matrix
product, no feedback possible) and as its `DMP` (batched Euler steps); in single precision, its default and
twice as quick as double. It keeps its own gains.

Every public function builds a contender and raises ImportError when the library is absent.
"""

from collections.abc import Sequence

import numpy as np
from primitive_inputs import AXES, DT, SAMPLES, path_error
from timing import Contender

from structlearn.primitives import transformation
from structlearn.primitives.kernels import KERNEL_COUNT
from structlearn.primitives.trajectory import Trajectory


def fit(paths: Sequence[Trajectory], mean: np.ndarray) -> Contender:
    """Weights of one `ProDMP` from all demonstrations, whose mean is (T, D)."""
    import torch

    primitive = _torch_primitive("prodmp")
    times = torch.from_numpy(np.stack([path.time for path in paths])).float()
    positions = torch.from_numpy(np.stack([path.position for path in paths])).float()

    def error(learned: dict) -> float:
        means = {name: value.mean(dim=0) for name, value in learned.items()}
        return path_error(primitive.get_traj_pos(times=times[0], **means), mean)

    return Contender(lambda: primitive.learn_mp_params_from_trajs(times, positions), error)


def unroll(paths: Sequence[Trajectory], reference: np.ndarray, kind: str) -> Contender:
    """Batched unroll without feedback; reference (B, T, D), kind "dmp" or "prodmp"."""
    import torch

    primitive = _torch_primitive(kind)
    times = torch.from_numpy(np.stack([path.time for path in paths])).float()
    positions = torch.from_numpy(reference).float()
    params = _torch_params(primitive, times, positions)
    initial = {
        "init_time": times[:, 0],
        "init_pos": positions[:, 0],
        "init_vel": torch.zeros_like(positions[:, 0]),
    }

    def run() -> tuple:
        path = primitive.get_traj_pos(times=times, params=params, **initial)
        return path, primitive.get_traj_vel()

    return Contender(run, lambda unrolled: path_error(unrolled[0].numpy(), reference))


def _torch_primitive(kind: str):
    """`DMP` or `ProDMP` of mp_pytorch with the kernels' number and the gains of our system."""
    import torch
    from mp_pytorch.mp import MPFactory

    torch.set_num_threads(1)
    options = {
        "num_basis": KERNEL_COUNT,
        "basis_bandwidth_factor": 3,
        "num_basis_outside": 0,
        "alpha": transformation.ALPHA,
        "alpha_phase": 3.0,
        "dt": DT,
    }
    return MPFactory.init_mp(kind, options, num_dof=AXES, tau=DT * (SAMPLES - 1))


def _torch_params(primitive, times, positions):
    """Weights and goals that reproduce the positions; mp_pytorch's `DMP` has no fit of its own."""
    import torch
    from mp_pytorch.mp import ProDMP

    if isinstance(primitive, ProDMP):
        return primitive.learn_mp_params_from_trajs(times, positions)["params"]
    tau, alpha, positions = float(primitive.tau), primitive.alpha, positions.double()
    velocity = torch.gradient(positions, spacing=DT, dim=-2)[0]
    goal = positions[:, -1:]
    targets = tau**2 * torch.gradient(velocity, spacing=DT, dim=-2)[0] - alpha * (
        primitive.beta * (goal - positions) - tau * velocity
    )
    features = primitive.phase_gn.phase(times[0])[:, None] * primitive.basis_gn.basis(times[0])
    weights = torch.linalg.pinv(features.double()) @ targets  # (B, N, D)
    return torch.cat([weights, goal], dim=-2).transpose(-1, -2).reshape(len(positions), -1).float()
