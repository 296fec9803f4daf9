import numpy as np
from committed import committed
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from structlearn.avoidance import levenberg_marquardt as lm
from structlearn.avoidance.avoidance_network import forward

KEY = "obstacle_training.per_setting.training"
SIZES = (3, 6, 4, 2)


def chosen(**changes):
    return committed(lm.LevenbergMarquardtParameters, KEY, **changes)


def problem(count=80, noise=0.05, seed=0):
    rng = np.random.default_rng(seed)
    inputs = rng.uniform(-1.0, 1.0, (count, 3))
    clean = np.stack([np.sin(2.0 * inputs[:, 0]) * inputs[:, 1], np.abs(inputs[:, 2])], axis=1)
    return lm.Samples(inputs, clean + noise * rng.normal(size=clean.shape))


def test_minima_are_as_good_as_scipys(monkeypatch):
    for name, value in (("TOLERANCE", 1e-7), ("PATIENCE", 150), ("FIRST_DAMPING", 10.0)):
        monkeypatch.setattr(lm, name, value)
    samples = problem()
    parameters = chosen(rule="validation", iterations=150)
    found, reference = [], []
    for seed in range(4):  # a start may end in a poor local minimum, of either
        layers = lm.initial_layers(SIZES, np.random.default_rng(seed))
        shapes = [layer.shape for layer in layers]
        ends = np.cumsum([layer.size for layer in layers])[:-1]

        def residuals(weights, shapes=shapes, ends=ends):
            parts = np.split(weights, ends)
            moved = [part.reshape(shape) for part, shape in zip(parts, shapes, strict=True)]
            return (forward(moved, samples.inputs) - samples.target).ravel()

        start = np.concatenate([layer.ravel() for layer in layers])
        reference.append(
            2.0 * least_squares(residuals, start, method="lm", max_nfev=3000).cost / samples.target.size
        )
        trained = lm.levenberg_marquardt(layers, samples, parameters, samples)
        found.append(lm.squared_error(trained, samples) / samples.target.size)
    assert min(found) < 1.2 * min(reference)
    assert np.median(found) < 1.5 * np.median(reference)


def test_linear_problem_is_solved_in_closed_form(monkeypatch):
    monkeypatch.setattr(lm, "FIRST_DAMPING", 1e-9)
    rng = np.random.default_rng(0)
    samples = lm.Samples(rng.normal(size=(50, 3)), rng.normal(size=(50, 2)))
    inputs = np.hstack([samples.inputs, np.ones((50, 1))])
    best, *_ = np.linalg.lstsq(inputs, samples.target, rcond=None)
    start = lm.initial_layers((3, 2), rng)
    parameters = chosen(rule="validation")
    (found,) = lm.levenberg_marquardt(start, samples, parameters, samples)
    np.testing.assert_allclose(found, best, atol=1e-6)


def test_validation_keeps_the_weights_that_did_best_there(monkeypatch):
    samples, held = problem(30, noise=0.3), problem(300, noise=0.0, seed=1)
    parameters = chosen(rule="validation", iterations=80)
    layers = lm.initial_layers((3, 20, 10, 2), np.random.default_rng(0))
    stopped = lm.levenberg_marquardt(layers, samples, parameters, held)
    monkeypatch.setattr(lm, "PATIENCE", 80)
    best = lm.levenberg_marquardt(layers, samples, parameters, held)
    overfitted = lm.levenberg_marquardt(layers, samples, parameters, samples)
    errors = [lm.squared_error(found, held) for found in (best, stopped, overfitted)]
    assert errors[0] <= errors[1] < errors[2]


def test_evidence_finds_the_noise_and_does_not_overfit(monkeypatch):
    monkeypatch.setattr(lm, "PATIENCE", 60)
    samples, held = problem(60, noise=0.3), problem(400, noise=0.0, seed=1)
    layers = lm.initial_layers((3, 20, 10, 2), np.random.default_rng(0))
    regular = lm.levenberg_marquardt(layers, samples, chosen(iterations=60))
    free = lm.levenberg_marquardt(layers, samples, chosen(rule="validation"), samples)
    assert lm.squared_error(regular, held) < 0.5 * lm.squared_error(free, held)
    errors = [lm.squared_error(found, samples) / samples.target.size for found in (free, regular)]
    assert errors[0] < errors[1] < 2.0 * 0.3**2


def test_dead_nodes_and_too_few_samples_do_no_harm():
    layers = lm.initial_layers((3, 20, 10, 2), np.random.default_rng(0))
    layers[0][-1] = -100.0  # no node of the first layer is ever active
    samples = problem(5)
    found = lm.levenberg_marquardt(layers, samples, chosen(iterations=20))
    assert all(np.isfinite(layer).all() for layer in found)


def jacobian(layers, inputs, step=1e-6):
    """(S * O, P) by central differences, weight by weight."""
    columns = []
    for place, layer in enumerate(layers):
        for index in np.ndindex(layer.shape):
            sides = []
            for sign in (1.0, -1.0):
                moved = [one.copy() for one in layers]
                moved[place][index] += sign * step
                sides.append(forward(moved, inputs))
            columns.append(((sides[0] - sides[1]) / (2.0 * step)).ravel())
    return np.stack(columns, axis=1)


@settings(max_examples=10, deadline=None)
@given(
    st.integers(0, 1000),
    st.lists(st.integers(1, 6), min_size=2, max_size=5),
    st.integers(1, 2 * lm.CHUNK_SAMPLES),
)
def test_normal_equations_are_those_of_the_jacobian(seed, sizes, count):
    rng = np.random.default_rng(seed)
    layers = lm.initial_layers(sizes, rng)
    samples = lm.Samples(rng.normal(size=(count, sizes[0])), rng.normal(size=(count, sizes[-1])))
    products, gradient = lm.normal_equations(layers, samples)
    j = jacobian(layers, samples.inputs)
    error = (forward(layers, samples.inputs) - samples.target).ravel()
    tolerance = 1e-4 * max(1.0, np.abs(j.T @ j).max())  # a kink may lie within the difference's step
    np.testing.assert_allclose(np.triu(products), np.triu(j.T @ j), atol=tolerance)
    np.testing.assert_allclose(gradient, j.T @ error, atol=1e-4 * max(1.0, np.abs(j.T @ error).max()))
