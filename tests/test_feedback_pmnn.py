from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from structlearn.feedback import coupling_model
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork
from structlearn.ground import artefacts
from structlearn.ground.errors import InputError
from structlearn.primitives import canonical, kernels

INPUTS, KERNELS = 4, 5


def random_network(sizes=(7,), seed=0):
    rng = np.random.default_rng(seed)
    widths = (INPUTS, *sizes)
    pairs = list(pairwise(widths))
    return PhaseModulatedNetwork(
        input_mean=rng.normal(size=INPUTS),
        input_scale=rng.uniform(0.5, 2.0, INPUTS),
        hidden=tuple((rng.normal(size=(after, before)), rng.normal(size=after)) for before, after in pairs),
        phase_weights=rng.normal(size=(KERNELS, widths[-1])),
        phase_biases=rng.normal(size=KERNELS),
        output_weights=rng.normal(size=KERNELS),
    )


def by_hand(network, deviation, modulation):
    """Equations IV.27-IV.30 for one sample, node by node."""
    layer = [(x - m) / s for x, m, s in zip(deviation, network.input_mean, network.input_scale, strict=True)]
    for weights, biases in network.hidden:
        rows = zip(weights, biases, strict=True)
        layer = [np.tanh(sum(w * h for w, h in zip(row, layer, strict=True)) + bias) for row, bias in rows]
    coupling = 0.0
    for kernel in range(KERNELS):
        unit = sum(w * h for w, h in zip(network.phase_weights[kernel], layer, strict=True))
        unit += network.phase_biases[kernel]
        coupling += network.output_weights[kernel] * modulation[kernel] * unit
    return coupling


@pytest.mark.parametrize("sizes", [(), (7,), (6, 3), (100,)])
@pytest.mark.parametrize("scale", [1.0, 1e6])
def test_coupling_is_the_equation_node_by_node(sizes, scale):
    """Also where layers saturate."""
    rng, network = np.random.default_rng(1), random_network(sizes)
    deviation, phase = (
        scale * rng.normal(size=(2, 3, INPUTS)),
        canonical.phase(np.array([0.2, 0.5, 0.9]), 2.0),
    )
    found = network.coupling(deviation, *phase)
    modulation = kernels.features(*phase, KERNELS)
    assert found.shape == (2, 3)
    for index in np.ndindex(2, 3):
        expected = by_hand(network, deviation[index], modulation[index[1]])
        np.testing.assert_allclose(found[index], expected, rtol=1e-11)
        one = network.coupling(deviation[index], phase[0][index[1]], phase[1][index[1]])
        assert one.shape == ()
        np.testing.assert_allclose(one, expected, rtol=1e-11)


@given(
    st.integers(0, 100),
    st.lists(st.floats(-1e6, 1e6), min_size=INPUTS, max_size=INPUTS),
    st.floats(-9.0, 0.0),
    st.floats(0.0, 1.0),
)
def test_where_the_phase_rests_there_is_no_coupling(seed, deviation, u, p):
    network = random_network((3,), seed)
    assert network.coupling(np.array(deviation), p, 0.0) == 0.0
    one, two = (network.coupling(np.array(deviation), p, factor * u) for factor in (1.0, 2.0))
    np.testing.assert_allclose(two, 2.0 * one)  # proportional to the phase velocity


@pytest.mark.parametrize("description", ["a network", "[1]", "{}", '{"coupling_models": {"turn": "pmnn"}}'])
def test_foreign_files_are_named(tmp_path, description):
    artefacts.write_tensors({"layer.weights": np.ones(3)}, tmp_path / "n.safetensors", description)
    with pytest.raises(InputError, match=r"n\.safetensors: holds no feedback networks"):
        coupling_model.read_networks(tmp_path / "n.safetensors")
