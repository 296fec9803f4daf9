"""Phase kernels, the forcing term they span (eq. IV.6, IV.7), and its weights by regression (IV.5.4).

    f(p, u) = u sum_i psi_i(p) theta_i / sum_j psi_j(p)        psi_i(p) = exp(-h_i (p - c_i)^2 / 2)

The centres are equally spaced in time, so every part of the movement has the same resolution. The same
kernels modulate the phase-modulated neural network.

The features depend on time only through the elapsed fraction of the movement. Demonstrations with the same
number of samples therefore share them in the regression, and all axes and demonstrations go through one
matrix product.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, Self

import numpy as np

from structlearn.primitives.canonical import TAU_PER_DURATION, phase

KERNEL_COUNT = 25
OVERLAP = 0.55  # width of a kernel in units of the distance to the next centre
SMALLEST_EXPONENT = -700.0
"""exp(-700) is negligible beside the nearest kernel's 1, and exp is three times slower when it underflows."""


@lru_cache
def centres_and_widths(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Centres c_i = p(t_i) (N,), falling from 1, and widths h_i = 1 / (OVERLAP (c_{i+1} - c_i))^2 (N,).

    The last width equals the one before. `count`: number of kernels N, at least 2.
    """
    centres, _ = phase(np.linspace(0.0, 1.0, count), TAU_PER_DURATION)
    gaps = np.diff(centres)
    widths = 1.0 / (OVERLAP * np.append(gaps, gaps[-1])) ** 2
    centres.flags.writeable = widths.flags.writeable = False
    return centres, widths


def features(p: np.ndarray | float, u: np.ndarray | float, count: int = KERNEL_COUNT) -> np.ndarray:
    """Features (..., N) of the forcing term, u psi_i(p) / sum_j psi_j(p) (eq. IV.6): f = features @ weights.

    `p`: (...) phase. `u`: (...) phase velocity.
    """
    centres, widths = centres_and_widths(count)
    values = np.subtract.outer(centres, p)  # (N, ...), in place: temporaries would cost more than the exp
    values *= values
    values *= np.reshape(-0.5 * widths, (count, *[1] * np.ndim(p)))
    values -= values.max(axis=0)  # avoids 0 / 0 far from all centres
    np.exp(np.maximum(values, SMALLEST_EXPONENT, out=values), out=values)
    values *= u / values.sum(axis=0)
    return np.moveaxis(values, 0, -1)


SHARED_BYTES = 2**28
"""Memory for features that movements of equal length share: those of 1300 lengths of 1 s at 1 kHz, or of 20
lengths of a minute. A cache by number of lengths would be too small for short ones or too large for long."""

shared_features: dict[tuple[int, float, int], np.ndarray] = {}  # the last used is last


def sampled_features(samples: int, step: float, count: int = KERNEL_COUNT) -> np.ndarray:
    """Features (T, N) at T samples of a movement, read-only; movements of equal length share the array.

    `step`: sampling interval / tau, dimensionless.
    """
    values = shared_features.pop((samples, step, count), None)
    if values is None:
        values = features(*phase(step * np.arange(samples), 1.0), count)
        values.flags.writeable = False
        held = values.nbytes + sum(others.nbytes for others in list(shared_features.values()))
        for key in list(shared_features):
            if held <= SHARED_BYTES:
                break
            held -= shared_features.pop(key, values[:0]).nbytes
    shared_features[samples, step, count] = values
    return values


def unit_features(samples: int, count: int = KERNEL_COUNT) -> np.ndarray:
    """Features (samples, N) at equally spaced times from start to end, for any duration; read-only."""
    return sampled_features(samples, 1.0 / (TAU_PER_DURATION * (samples - 1)), count)


Regression = Literal["joint", "local"]

RIDGE = 1e-8
"""Ridge of the joint regression, relative to the mean diagonal of the normal equations: it only determines
the first kernel's weight, since the phase velocity vanishes there."""


def forcing_weights(
    targets: Sequence[np.ndarray],
    scales: np.ndarray | None = None,
    method: Regression = "joint",
    count: int = KERNEL_COUNT,
) -> np.ndarray:
    """Weights theta (N, D) that minimise sum_l |scale_l features theta - target_l|^2.

    `targets`: per demonstration (T_l, D) forcing targets on a uniform clock from start to end. `scales`:
    (L, D) amplitude of each demonstration's forcing term relative to the primitive's; None: 1. `method`:
    `joint`: ridge least squares over all kernels, as in the text; `local`: each kernel by itself, weighted by
    its activation (locally weighted regression).
    """
    if scales is None:
        scales = np.ones((len(targets), targets[0].shape[1]))
    groups: dict[int, tuple[np.ndarray, np.ndarray]] = {}  # samples -> sum scale^2 (D,), sum scale target
    for target, scale in zip(targets, scales, strict=True):
        squared, scaled = groups.get(len(target), (0.0, 0.0))
        groups[len(target)] = (squared + scale**2, scaled + scale * target)
    normal, moment = np.zeros(()), np.zeros(())
    for samples, (squared, scaled) in sorted(groups.items()):
        shared = unit_features(samples, count)
        normal = normal + np.multiply.outer(squared, shared.T @ shared)
        moment = moment + shared.T @ scaled
    return _solved(normal, moment, method)


@dataclass(frozen=True)
class NormalEquations:
    """Normal equations of L demonstrations: primitives of any of them need no second pass over the samples.

    Those that are used are summed anew for each primitive, in L N^2 operations, which is little beside the
    samples. What is left out could be subtracted from the sum of all instead, but where it is most of that
    sum (scaled axes weigh by the square of the reach), the difference would lose digits.
    """

    gram: np.ndarray  # (L, N, N) features^T features
    moment: np.ndarray  # (L, N, D) features^T target

    @classmethod
    def of(cls, targets: Sequence[np.ndarray], count: int = KERNEL_COUNT) -> Self:
        """`targets`, `count`: as in `forcing_weights`."""
        grams, moments = {}, []
        for target in targets:
            shared = unit_features(len(target), count)
            if len(target) not in grams:
                grams[len(target)] = shared.T @ shared
            moments.append(shared.T @ target)
        return cls(np.stack([grams[len(target)] for target in targets]), np.stack(moments))

    def weights(self, used: np.ndarray, scales: np.ndarray | None, method: Regression) -> np.ndarray:
        """As `forcing_weights`, of the demonstrations in a mask (L,); `scales`: theirs."""
        of_all = np.zeros((len(used), self.moment.shape[2]))  # 0: not used, and no copy of the others
        of_all[used] = 1.0 if scales is None else scales
        normal = np.tensordot(of_all.T**2, self.gram, axes=1)
        return _solved(normal, np.einsum("ld,lnd->nd", of_all, self.moment), method)


def _solved(normal: np.ndarray, moment: np.ndarray, method: Regression) -> np.ndarray:
    """Weights (N, D) from summed normal equations (D, N, N) and moments (N, D)."""
    if method == "local":  # theta_i = sum psi_i u f / sum psi_i u^2, and the features psi u sum up to u
        return moment / normal.sum(axis=2).T
    ridge = RIDGE * np.trace(normal, axis1=1, axis2=2) / normal.shape[1]
    normal = normal + ridge[:, None, None] * np.eye(normal.shape[1])
    return np.linalg.solve(normal, moment.T[..., None])[..., 0].T
