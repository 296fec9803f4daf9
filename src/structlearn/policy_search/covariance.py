"""Covariance of a search distribution after an update (algorithm IV.4, lines 8 and 10).

    Sigma_ml = sum_t w_t sum_k P_k,t (theta_k - theta)(theta_k - theta)^T

Around the old mean theta, as here and in the text, the estimate does not shrink on its own (weights that do
not depend on the samples return the old covariance on average) and grows along a direction in which all good
samples lie, as in CMA-ES.

A few rollouts cannot estimate the 325 unknowns of a covariance of 25 weights: `full`, the text, takes chance
for shape. They can tell 25 variances: `per_weight` lets each follow, `rescaled` only their common size.
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
    """How the covariance follows the good samples."""

    # `per_weight`: the old covariance, each parameter's standard deviation times the root of (sum_k w_k,d
    # (theta_k,d - theta_d)^2 / Sigma_dd)^(1 / damping); `rescaled`: the old covariance times
    # (tr(Sigma_old^-1 Sigma_ml) / D)^(1 / damping); `full`: Sigma_ml, as in the text; `kept`: the old
    # covariance
    mode: Literal["per_weight", "rescaled", "full", "kept"]
    damping: float = Field(ge=1)  # of `per_weight` and `rescaled`; 1 is none
    # of all but `kept`: smallest ratio of new to old variance of a parameter or in any direction. Without it
    # `full` gives up every direction that the samples happen to miss; near 1 it lets the covariance grow,
    # because then chance only widens.
    eigenvalue_floor: float = Field(gt=0, le=1)


def factor(covariance: np.ndarray) -> np.ndarray:
    """Lower Cholesky factor of a covariance.

    `covariance`: (D, D) symmetric. Returns (D, D) L with L L^T = covariance. Raises InputError: the
    covariance is not positive definite.
    """
    try:
        return np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError as error:
        raise InputError("the covariance of the search distribution is not positive definite") from error


def adapted(
    old: np.ndarray, deviations: np.ndarray, weights: np.ndarray, parameters: CovarianceParameters
) -> np.ndarray:
    """New covariance.

    `rescaled` and `full` find it in coordinates in which the old covariance is the unit matrix, so that a
    linear change of the policy's parameters changes nothing; they weigh a sample alike in all parameters.

    `old`: (D, D) covariance that the samples were drawn with. `deviations`: (K, D) samples minus the old
    mean. `weights`: (K, D) of the samples in each parameter, sum over the samples 1. Returns (D, D) symmetric
    and positive definite. Raises InputError: the old covariance is not positive definite.
    """
    if parameters.mode == "kept":
        return old
    root, floor = factor(old), parameters.eigenvalue_floor
    if parameters.mode == "per_weight":
        ratios = np.sum(weights * deviations**2, axis=0) / np.diag(old)
        scale = np.sqrt(np.maximum(ratios ** (1.0 / parameters.damping), floor))
        return scale[:, None] * old * scale
    shared = weights.mean(axis=1)  # (K,), all of a sample's weights where the text averages
    white = solve_triangular(root, deviations.T, lower=True, check_finite=False)  # (D, K)
    if parameters.mode == "rescaled":
        ratio = np.sum(white * white * shared) / len(old)
        return max(ratio ** (1.0 / parameters.damping), floor) * old
    ratios, directions = np.linalg.eigh((white * shared) @ white.T)
    spread = (root @ directions) * np.sqrt(np.maximum(ratios, floor))
    full = spread @ spread.T
    full[np.diag_indices_from(full)] += RIDGE * np.trace(full) / len(full)
    return full
