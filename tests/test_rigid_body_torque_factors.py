import numpy as np

from structlearn.ground.metrics import nmse
from structlearn.rigid_body.torque_factors import torque_factors


def test_errors_are_those_of_the_data_set():
    rng = np.random.default_rng(0)
    regressor = rng.normal(size=(200, 3, 5))
    regressor[:, 1, :2] = 0.0  # links before the joint
    torque = rng.normal(size=(200, 3))
    parameters = rng.normal(size=(4, 5))
    factors = torque_factors(regressor, torque)
    expected = [nmse(regressor @ values, torque) for values in parameters]
    np.testing.assert_allclose(factors.nmse(parameters), expected, rtol=1e-12)


def test_small_errors_beside_large_torques_keep_their_digits():
    rng = np.random.default_rng(0)
    regressor = rng.normal(size=(500, 1, 2)) * [1e3, 1e-3]
    true = np.array([1.0, 1.0])
    factors = torque_factors(regressor, regressor @ true)
    wrong = np.array([1.0, 1.0 + 1e-4])  # a torque error of 1e-7 on 1e3
    error = 1e-8 * (regressor[..., 1] ** 2).mean() / factors.variance[0]
    np.testing.assert_allclose(factors.nmse(wrong), [error], rtol=1e-4)


def test_fewer_samples_than_parameters():
    regressor = np.arange(6.0).reshape(2, 1, 3)
    factors = torque_factors(regressor, np.array([[1.0], [2.0]]))
    np.testing.assert_allclose(factors.nmse(np.zeros(3)), [2.5 / 0.25])
