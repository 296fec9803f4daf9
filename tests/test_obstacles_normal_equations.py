import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from structlearn.avoidance.avoidance_network import forward
from structlearn.avoidance.levenberg_marquardt import CHUNK_SAMPLES, Samples, initial_layers, normal_equations


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
    st.integers(1, 2 * CHUNK_SAMPLES),
)
def test_normal_equations_are_those_of_the_jacobian(seed, sizes, count):
    rng = np.random.default_rng(seed)
    layers = initial_layers(sizes, rng)
    samples = Samples(rng.normal(size=(count, sizes[0])), rng.normal(size=(count, sizes[-1])))
    products, gradient = normal_equations(layers, samples)
    j = jacobian(layers, samples.inputs)
    error = (forward(layers, samples.inputs) - samples.target).ravel()
    tolerance = 1e-4 * max(1.0, np.abs(j.T @ j).max())  # a kink may lie within the difference's step
    np.testing.assert_allclose(np.triu(products), np.triu(j.T @ j), atol=tolerance)
    np.testing.assert_allclose(gradient, j.T @ error, atol=1e-4 * max(1.0, np.abs(j.T @ error).max()))
