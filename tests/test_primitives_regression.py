import numpy as np
from hypothesis import given
from primitives_movements import quick, rngs

from structlearn.primitives.canonical import phase, time_constant
from structlearn.primitives.kernels import centres_and_widths, features, forcing_weights


def feature_matrix(samples, count):
    return features(*phase(np.linspace(0.0, 1.0, samples), time_constant(1.0)), count)


def stacked(lengths, count):
    return np.concatenate([feature_matrix(samples, count) for samples in lengths])


@given(rngs)
@quick
def test_joint_weights_are_the_least_squares_of_the_stacked_demonstrations(rng):
    lengths, count = (120, 300, 120), 12
    targets = [rng.normal(size=(samples, 2)).cumsum(axis=0) for samples in lengths]
    expected = np.linalg.lstsq(stacked(lengths, count), np.concatenate(targets), rcond=None)[0]
    np.testing.assert_allclose(
        forcing_weights(targets, count=count), expected, rtol=1e-4, atol=1e-3
    )  # IV.5.4


@given(rngs)
@quick
def test_scales_weight_each_demonstration_and_axis(rng):
    lengths, count = (150, 150, 220), 12
    scales = rng.uniform(-2.0, 2.0, size=(3, 2))
    targets = [rng.normal(size=(samples, 2)).cumsum(axis=0) for samples in lengths]
    found = forcing_weights(targets, scales, count=count)
    for axis in range(2):
        matrix = np.concatenate(
            [scales[i, axis] * feature_matrix(samples, count) for i, samples in enumerate(lengths)]
        )
        expected = np.linalg.lstsq(matrix, np.concatenate(targets)[:, axis], rcond=None)[0]
        np.testing.assert_allclose(found[:, axis], expected, rtol=1e-4, atol=1e-3)


@given(rngs)
@quick
def test_local_weights_fit_each_kernel_alone(rng):
    lengths, count = (90, 140), 10
    targets = [rng.normal(size=(samples, 2)).cumsum(axis=0) for samples in lengths]
    found = forcing_weights(targets, None, "local", count)
    p = np.concatenate([phase(np.linspace(0, 1, n), time_constant(1.0))[0] for n in lengths])
    u = np.concatenate([phase(np.linspace(0, 1, n), time_constant(1.0))[1] for n in lengths])
    kernels = np.exp(-0.5 * centres_and_widths(count)[1] * (p[:, None] - centres_and_widths(count)[0]) ** 2)
    kernels /= kernels.sum(axis=1, keepdims=True)
    for i in range(count):  # weighted regression of f on u with weights psi_i
        root = np.sqrt(kernels[:, i])[:, None]
        expected = np.linalg.lstsq(root * u[:, None], root * np.concatenate(targets), rcond=None)[0][0]
        np.testing.assert_allclose(found[i], expected, rtol=1e-9)
