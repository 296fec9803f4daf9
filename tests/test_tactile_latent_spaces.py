"""Latent spaces alone: units of a set, training without dynamics."""

from dataclasses import replace

import numpy as np
import pytest
from committed import committed
from tactile_toy import toy_dataset, toy_geodesics

from structlearn.tactile.latent_comparison import learn_spaces, own_units, seen_in
from structlearn.tactile.latent_evaluation import latent_errors
from structlearn.tactile.latent_parameters import LatentSpaceParameters, LatentTrainingParameters
from structlearn.tactile.touch_dataset import TEST, TRAIN

FEW = committed(
    LatentSpaceParameters,
    "recorded_latent_touch.spaces",
    seeds=2,
    training=committed(LatentTrainingParameters, "train_latent.training", steps=400, batch_size=32),
    pair_pool=2000,
    evaluation_pairs=500,
)


@pytest.fixture(scope="module")
def touches():
    samples = toy_dataset(contacts=10, samples=150)
    samples = replace(samples, split=np.where(samples.contact % 5 == 4, TEST, TRAIN))
    return samples, toy_geodesics(samples, bins=2, size=300)


@pytest.fixture(scope="module")
def learned(touches):
    units = own_units(*touches)
    return units, learn_spaces(*touches, units, FEW)


def test_a_set_has_the_units_of_its_training_samples(touches):
    samples, geodesics = touches
    units = own_units(samples, geodesics)
    rows = samples.split == TRAIN
    seen = units.signals(samples.signals[rows].astype(float))
    np.testing.assert_allclose(seen.mean(axis=0), 0.0, atol=1e-4)
    np.testing.assert_allclose(seen.std(axis=0), 1.0, atol=1e-4)
    distances = geodesics.distance.astype(float) / units.length
    assert np.mean(distances**2) == pytest.approx(1.0)


def test_counts_of_another_scale_look_the_same(touches, learned):
    samples, geodesics = touches
    units, models = learned
    weaker = (0.2 * samples.signals).astype(np.float32)
    other = replace(samples, signals=weaker, pressure=0.2 * samples.pressure)
    seen = {"own": seen_in(units, samples, geodesics, TRAIN, 500)}
    seen["other"] = seen_in(own_units(other, geodesics), other, geodesics, TRAIN, 500)
    errors = latent_errors(models, seen).set_index(["split", "structure", "seed"])
    names = ["reconstruction", "distances", "pressure"]
    np.testing.assert_allclose(errors.loc["own", names], errors.loc["other", names], rtol=1e-3)
