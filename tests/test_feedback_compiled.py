import numpy as np
import pytest
import torch
from feedback_skills import random_network
from hypothesis import given
from hypothesis import strategies as st
from primitives_movements import quick, rngs

from structlearn.feedback.compiled_pmnn import compiled_coupling, packed_hidden, readout
from structlearn.feedback.stacked_pmnn import StackedPhaseModulatedNetworks
from structlearn.networks.torch_settings import as_tensor
from structlearn.primitives import canonical, kernels

SHAPES = [(6, ()), (6, (4,)), (38, (100,)), (5, (7, 3)), (0, ()), (0, (4,))]


@pytest.mark.parametrize(("inputs", "hidden"), SHAPES)
@given(rng=rngs, batch=st.sampled_from([(), (1,), (5,), (2, 3)]))
@quick
def test_the_compiled_network_is_the_network(inputs, hidden, rng, batch):
    network = random_network(rng, inputs, hidden, size=10.0)
    modulation = kernels.features(*canonical.phase(rng.uniform(0.0, 1.0), 2.0))
    deviation = rng.normal(0.0, 100.0, (*batch, inputs))
    found = compiled_coupling(network)(deviation, modulation)
    expected = network.coupling(deviation, modulation)
    assert np.shape(found) == batch
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def test_where_the_phase_velocity_is_zero_so_is_the_coupling():
    network = random_network(np.random.default_rng(0), size=1e6)
    at_start = kernels.features(*canonical.phase(0.0, 2.0))
    assert compiled_coupling(network)(np.full(6, 1e3), at_start) == 0.0


def test_a_saturated_layer_neither_overflows_nor_loses_its_sign():
    network = random_network(np.random.default_rng(0))
    modulation = kernels.features(*canonical.phase(0.5, 2.0))
    for counts in (np.full(6, 1e7), np.full(6, -1e7)):
        found = compiled_coupling(network)(counts, modulation)
        np.testing.assert_allclose(found, network.coupling(counts, modulation), atol=1e-12)


def test_networks_that_are_packed_together_keep_their_places():
    rng = np.random.default_rng(1)
    networks = [
        None,
        random_network(rng, 6, (4,)),
        None,
        random_network(rng, 6, (3, 2)),
        random_network(rng, 0, ()),
    ]
    packed = packed_hidden(networks)
    np.testing.assert_array_equal(packed.first, [-1, 0, -1, 12 + 28, 12 + 28 + 12 + 21 + 8])
    np.testing.assert_array_equal(packed.layers, [0, 1, 0, 2, 0])
    np.testing.assert_array_equal(packed.sizes[3], [6, 3, 2])
    np.testing.assert_array_equal(packed.values[40:46], networks[3].input_mean)


def test_the_readout_is_linear_in_the_phase_features():
    network = random_network(np.random.default_rng(2), 6, ())
    modulation = kernels.unit_features(20)
    scale, offset = readout(network, modulation)
    deviation = np.random.default_rng(3).normal(size=(20, 6))
    layer = (deviation - network.input_mean) / network.input_scale
    found = np.sum(scale * layer, axis=1) + offset
    np.testing.assert_allclose(found, network.coupling(deviation, modulation), atol=1e-13)


def test_the_compiled_network_is_the_one_that_torch_trains():
    rng, seed = np.random.default_rng(4), torch.Generator().manual_seed(0)
    trained = StackedPhaseModulatedNetworks(2, 38, (100,), 25, 0.5, seed)
    mean, scale = rng.normal(0.0, 10.0, 38), rng.uniform(5.0, 30.0, 38)
    deviation, modulation = rng.normal(0.0, 30.0, (50, 38)), kernels.unit_features(50)
    standardised = as_tensor((deviation - mean) / scale).expand(2, -1, -1)
    with torch.no_grad():
        expected = 40.0 * trained.forward(standardised, as_tensor(modulation).expand(2, -1, -1)).numpy()
    for index in range(2):
        coupling = compiled_coupling(trained.to_network(index, mean, scale, 40.0))
        found = [coupling(row, features) for row, features in zip(deviation, modulation, strict=True)]
        np.testing.assert_allclose(found, expected[index], atol=1e-4)  # single precision
        assert np.ptp(found) > 1.0
