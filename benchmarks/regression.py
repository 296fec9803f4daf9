"""Regression that prunes (automatic relevance determination), beside scikit-learn's, from which it is taken.

The inputs are the hand-designed features of `avoidance.rai_2014`, 50 effects of an obstacle that a movement
passes, which are as correlated as they are there. scikit-learn goes over all samples in each of its
iterations; ours over their moments.
"""

from functools import partial

import numpy as np
from timing import Case, Contender

from structlearn.avoidance import features, rai_2014

SEED = 11
NOISE = 0.1  # of the target, relative to its size
EFFECTS = (4, 17, 31, 46)  # of the columns, those that the target is a sum of
SAME = 1e-6  # of the predictions; correlated weights would say little


def pruning(samples: int) -> Case:
    """Weights of one axis; predictions of all samples are compared."""
    inputs, target = _steering(samples)
    expected = _by_scikit(inputs, target)()

    def error(weights: np.ndarray) -> float:
        return float(np.abs(inputs @ (weights - expected)).max() / np.ptp(target))

    return Case(
        work=f"ARD regression, {samples} samples of {inputs.shape[1]} features",
        ours=Contender(lambda: rai_2014.pruning_regression(inputs, target), error),
        peers={"scikit-learn ARDRegression": lambda: Contender(_by_scikit(inputs, target), error)},
        tolerance=SAME,
        note=f"{np.count_nonzero(expected)} features are kept; no intercept; same rules to prune and to stop",
    )


def _steering(samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Effects (S, F) along y in units of their own size, and targets (S,) in units of theirs."""
    rng = np.random.default_rng(SEED)
    states = np.zeros((samples, len(features.NAMES)))
    states[:, features.SCALED_VELOCITY] = rng.normal((0.5, 0.0, 0.0), 0.1, (samples, 3))
    centre = rng.normal((0.3, 0.0, 0.0), 0.15, (samples, 3))
    states[:, features.TO_CENTRE] = centre
    points = centre[:, :, None] + rng.normal(0.0, 0.03, (samples, 3, features.CLOSEST_POINTS))
    states[:, features.TO_POINTS] = points.reshape(samples, -1)
    inputs = rai_2014.steering_features(states)[:, 1]
    inputs = inputs / np.sqrt(np.mean(inputs**2, axis=0))
    target = inputs[:, EFFECTS].sum(axis=1)
    target = target + NOISE * target.std() * rng.normal(size=samples)
    return inputs, target / np.sqrt(np.mean(target**2))


def _by_scikit(inputs: np.ndarray, target: np.ndarray):
    from sklearn.linear_model import ARDRegression

    model = ARDRegression(
        max_iter=rai_2014.ITERATIONS,
        tol=rai_2014.GAIN_TOLERANCE,
        threshold_lambda=rai_2014.PRUNED_PRECISION,
        fit_intercept=False,
    )
    return lambda: model.fit(inputs, target).coef_


CASES = (partial(pruning, 500), partial(pruning, 10_000))
