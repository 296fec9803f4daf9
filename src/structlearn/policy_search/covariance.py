"""Covariance of a search distribution after an update (algorithm IV.4, lines 8 and 10).

    Sigma_ml = sum_t w_t sum_k P_k,t (theta_k - m_t)(theta_k - m_t)^T

m_t is the old mean in the text and the weighted mean of time step t in the author's public code. Around the
old mean the estimate does not shrink on its own (weights that do not depend on the samples return the old
covariance on average) and grows along a direction in which all good samples lie, as in CMA-ES. Around the
new mean a finite number of samples always shrinks it, most of all along the direction of progress: a long
search with a full covariance then stops early even on a quadratic function. So the default is as in the text.

38 samples cannot estimate the 325 unknowns of a covariance of 25 weights; `full` takes chance for shape, and
on a well-conditioned quadratic function it stalls. So by default only the size follows the estimate.
"""

from typing import Literal

import numpy as np
from pydantic import Field
from scipy.linalg import solve_triangular

from structlearn.ground.errors import InputError
from structlearn.ground.params import Parameters

RIDGE = 1e-12
"""Of the mean variance, added to the variance of a full estimate: it stays positive definite in floating
point where one direction has become very much narrower than another."""


class CovarianceParameters(Parameters):
    """How the covariance follows the good samples.

    Attributes:
        mode: `rescaled`: the old covariance times (tr(Sigma_old^-1 Sigma_ml) / D)^(1 / damping);
            `full`: Sigma_ml; `kept`: the old covariance.
        centre: around which mean Sigma_ml is taken.
        damping: of `rescaled`; 1 is none.
        eigenvalue_floor: of `rescaled` and `full`: smallest ratio of new to old variance in any direction.
            Without it `full` gives up every direction that the samples happen to miss; near 1 it lets the
            covariance grow, because then chance only widens.
    """

    mode: Literal["rescaled", "full", "kept"]
    centre: Literal["old_mean", "new_mean"]
    damping: float = Field(ge=1)
    eigenvalue_floor: float = Field(gt=0, le=1)


def factor(covariance: np.ndarray) -> np.ndarray:
    """Lower Cholesky factor of a covariance.

    Args:
        covariance: (D, D) symmetric.

    Returns:
        (D, D) L with L L^T = covariance.

    Raises:
        InputError: the covariance is not positive definite.
    """
    try:
        return np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError as error:
        raise InputError("the covariance of the search distribution is not positive definite") from error


def moments(probabilities: np.ndarray, time_weights: np.ndarray, centre: str) -> np.ndarray:
    """Weights of pairs of samples in the covariance: Sigma_ml = sum_kl M_kl d_k d_l^T, d_k = theta_k - theta.

    Around the old mean theta, M is diagonal. Around the means of the time steps, theta + sum_k P_k,t d_k,
    it is less by sum_t w_t P_k,t P_l,t.

    Args:
        probabilities: (K, T) weights of the samples, sum over the samples 1.
        time_weights: (T,) weights of the time steps, sum 1.
        centre: `old_mean` or `new_mean`.

    Returns:
        (K, K) symmetric, positive semi-definite but for rounding.
    """
    weighted = probabilities * time_weights
    diagonal = np.diag(weighted.sum(axis=1))
    if centre == "old_mean":
        return diagonal
    # summed over time by numpy: the last bits of a long matrix product depend on the number of threads
    return diagonal - np.einsum("kt,lt->kl", weighted, probabilities)


def adapted(
    old: np.ndarray, deviations: np.ndarray, weights: np.ndarray, parameters: CovarianceParameters
) -> np.ndarray:
    """New covariance.

    It is found in coordinates in which the old covariance is the unit matrix, so that a linear change of the
    policy's parameters changes nothing.

    Args:
        old: (D, D) covariance that the samples were drawn with.
        deviations: (K, D) samples minus the old mean.
        weights: (K, K) of `moments`.
        parameters: which of the estimate is taken over.

    Returns:
        (D, D) symmetric and positive definite.

    Raises:
        InputError: the old covariance is not positive definite.
    """
    if parameters.mode == "kept":
        return old
    root = factor(old)
    white = solve_triangular(root, deviations.T, lower=True, check_finite=False)  # (D, K)
    if parameters.mode == "rescaled":
        mean_ratio = np.sum((white @ weights) * white) / len(old)
        ratio = max(mean_ratio, 0.0) ** (1.0 / parameters.damping)
        return max(ratio, parameters.eigenvalue_floor) * old
    ratios, directions = np.linalg.eigh(white @ weights @ white.T)
    spread = (root @ directions) * np.sqrt(np.maximum(ratios, parameters.eigenvalue_floor))
    full = spread @ spread.T
    full[np.diag_indices_from(full)] += RIDGE * np.trace(full) / len(full)
    return full
