from dataclasses import replace

import numpy as np
from committed import committed
from feedback_skills import random_network
from feedback_toy import toy_dataset

from structlearn.feedback.coupling_dataset import leave_one_out
from structlearn.feedback.coupling_model import TrainingParameters
from structlearn.feedback.models.autoencoded import autoencoder
from structlearn.feedback.models.pca import principal_components
from structlearn.primitives import canonical

QUICK = committed(TrainingParameters, "compare_models", steps=400, evaluate_every=100, batch_size=32)
FOLDS = leave_one_out(toy_dataset(), (0.075, 0.075), 1, seed=0)
SAMPLES = len(toy_dataset().target)


def spanned(stds, seed=0):
    """Deviations that vary with given stds along orthogonal directions of 38 channels."""
    rng = np.random.default_rng(seed)
    directions, _ = np.linalg.qr(rng.normal(size=(38, len(stds))))
    return rng.normal(size=(SAMPLES, len(stds))) * stds @ directions.T + 5.0, directions


def jobs(deviation, folds=FOLDS):
    return [(replace(toy_dataset(), deviation=deviation), fold) for fold in folds]


def dimensions(encoders):
    return [encoder.dimensions for encoder in encoders]


def test_principal_components_keep_as_many_as_the_variance_needs():
    deviation, _ = spanned([10.0, 5.0, 3.0, 0.3, 0.2])  # the last two: 0.1 % of the variance
    assert dimensions(principal_components(jobs(deviation))) == [3, 3, 3, 3]
    assert dimensions(principal_components(jobs(deviation), 0.9)) == [2, 2, 2, 2]
    assert dimensions(principal_components(jobs(deviation), 0.9999)) == [5, 5, 5, 5]


def test_a_fold_with_fewer_components_is_filled_with_zeros():
    deviation, _ = spanned([10.0, 5.0])
    deviation[FOLDS[2].generalization] += np.outer(
        np.resize([60.0, -60.0], len(FOLDS[2].generalization)), np.eye(38)[0]
    )
    encoders = principal_components(jobs(deviation))
    assert dimensions(encoders) == [3, 3, 2, 3]
    assert all(encoder.code.shape == (SAMPLES, 3) for encoder in encoders)
    assert np.abs(encoders[2].code[:, 2]).max() == 0.0
    assert np.abs(encoders[0].code[:, 2]).max() > 1.0


def test_an_autoencoder_finds_a_curve_that_one_principal_component_cannot_show():
    angle = np.random.default_rng(0).uniform(0.0, 5.0, SAMPLES)
    curve = np.column_stack([np.cos(angle), np.sin(angle), 0.1 * angle])
    parameters = QUICK.model_copy(update={"steps": 1000, "learning_rate": 3e-3})

    def unlikeness(code):  # of neighbours in the code, which should be neighbours on the curve
        return np.quantile(np.abs(np.diff(angle[np.argsort(code)])), 0.9)

    (component,) = principal_components(jobs(curve, FOLDS[:1]), 0.1)
    assert component.code.shape == (SAMPLES, 1)
    for encoder in autoencoder(jobs(curve, FOLDS[:2]), np.array([1, 1]), parameters):
        assert encoder.code.shape == (SAMPLES, 1)
        assert unlikeness(encoder.code[:, 0]) < 0.2 * unlikeness(component.code[:, 0])


def test_autoencoders_have_codes_of_their_own_width():
    deviation, _ = spanned([10.0, 5.0, 3.0])
    narrow, wide = autoencoder(jobs(deviation, FOLDS[:2]), np.array([1, 3]), QUICK)
    assert narrow.code.shape == wide.code.shape == (SAMPLES, 3)
    assert np.abs(narrow.code[:, 1:]).max() == 0.0
    assert np.ptp(wide.code, axis=0).min() > 0.1


def test_encoders_that_are_folded_into_a_network_give_it_their_code():
    deviation, _ = spanned([10.0, 5.0, 3.0])
    for encoders in (
        principal_components(jobs(deviation, FOLDS[:1])),
        autoencoder(jobs(deviation, FOLDS[:1]), np.array([3]), QUICK),
    ):
        (encoder,) = encoders
        network = random_network(np.random.default_rng(0), 3, ())
        phase = canonical.phase(np.linspace(0.1, 0.9, SAMPLES), 2.0)
        scale = np.full(38, encoder.scale)
        found = network.behind(encoder.mean, scale, encoder.layers).coupling(deviation, *phase)
        np.testing.assert_allclose(found, network.coupling(encoder.code, *phase), atol=1e-4, rtol=1e-4)
