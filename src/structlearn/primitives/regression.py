"""Forcing weights by linear regression on the targets of all demonstrations (IV.5.4).

The features depend on the time only through the fraction of the movement that has passed, so demonstrations
with the same number of samples share them, and all axes and demonstrations go through one matrix product.
"""

from collections.abc import Iterable, Sequence
from typing import Literal

import numpy as np

from structlearn.primitives.kernels import KERNEL_COUNT, unit_features

Regression = Literal["joint", "local"]

RIDGE = 1e-8
"""Ridge of the joint regression, relative to the mean diagonal of the normal equations: it only settles the
first kernel, which the vanishing phase velocity hides."""


def forcing_weights(
    targets: Sequence[np.ndarray],
    scales: np.ndarray | None = None,
    method: Regression = "joint",
    count: int = KERNEL_COUNT,
) -> np.ndarray:
    """Weights of the forcing term from one or several demonstrations.

    `targets`: per demonstration (T_l, D) forcing targets on a uniform clock from start to end. `scales`:
    (L, D) amplitude of each demonstration's forcing term relative to the primitive's; None: 1. `method`:
    `joint`: ridge least squares over all kernels, as in the text. `local`: each kernel alone, weighted by its
    activation (locally weighted regression). Returns (N, D) weights theta that minimise sum_l |scale_l
    features theta - target_l|^2.
    """
    if scales is None:
        scales = np.ones((len(targets), targets[0].shape[1]))
    groups: dict[int, tuple[np.ndarray, np.ndarray]] = {}  # samples -> sum scale^2 (D,), sum scale target
    for target, scale in zip(targets, scales, strict=True):
        squared, scaled = groups.get(len(target), (0.0, 0.0))
        groups[len(target)] = (squared + scale**2, scaled + scale * target)
    solve = _joint if method == "joint" else _local
    return solve([(unit_features(samples, count), *sums) for samples, sums in sorted(groups.items())])


Groups = list[tuple[np.ndarray, np.ndarray, np.ndarray]]
"""Per length: features (T, N), summed squared scales (D,), summed scaled targets (T, D)."""


def _total(terms: Iterable[np.ndarray]) -> np.ndarray:
    return sum(terms, start=np.zeros(()))


def _joint(groups: Groups) -> np.ndarray:
    normal = _total(np.multiply.outer(squared, features.T @ features) for features, squared, _ in groups)
    moment = _total(features.T @ scaled for features, _, scaled in groups)  # (N, D)
    ridge = RIDGE * np.trace(normal, axis1=1, axis2=2) / normal.shape[1]
    normal += ridge[:, None, None] * np.eye(normal.shape[1])  # (D, N, N)
    return np.linalg.solve(normal, moment.T[..., None])[..., 0].T


def _local(groups: Groups) -> np.ndarray:
    """Theta_i = sum psi_i u f / sum psi_i u^2: `features` are psi u with psi normalised, u their sum."""
    numerator = _total(features.T @ scaled for features, _, scaled in groups)
    denominator = _total(
        np.outer(features.T @ features.sum(axis=1), squared) for features, squared, _ in groups
    )
    return numerator / denominator
