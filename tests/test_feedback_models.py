from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from committed import committed
from feedback_skills import random_network
from feedback_toy import toy_dataset

from dissertation.scraping.protocol import feedback_models
from dissertation.scraping.protocol.feedback_models import FinalModelParameters, train_models
from structlearn.feedback.corrected_paths import SAMPLES, corrected_paths, path_errors, unrolled_error
from structlearn.feedback.coupling_dataset import leave_one_out
from structlearn.feedback.trainers import TrainingParameters, UnrolledTrainingParameters, train_final
from structlearn.feedback.training.autoencoded import autoencoder
from structlearn.feedback.training.pca import principal_components
from structlearn.primitives import canonical

FEW = FinalModelParameters(
    network="pmnn",
    hidden=(8,),
    pointwise=committed(TrainingParameters, "compare_models", steps=200, evaluate_every=100, seed=1),
    unrolled=committed(UnrolledTrainingParameters, "train_feedback.unrolled", steps=60, seed=1),
    validation_share=0.25,
)


@pytest.fixture(scope="module")
def datasets():
    return {"turn": toy_dataset(seed=0), "scrape": toy_dataset(seed=1, channels=4)}


@pytest.fixture(scope="module")
def level():
    """Nothing is to be corrected, whatever is felt."""
    sets = {"turn": toy_dataset(seed=2, settings=(0.0,))}
    sets["scrape"] = toy_dataset(seed=3, settings=(0.0,), channels=4)
    return {name: replace(one, target=np.zeros(len(one.target))) for name, one in sets.items()}


@pytest.fixture(scope="module")
def trained(datasets, level):
    return train_models(datasets, level, FEW)


def test_the_pointwise_model_is_that_of_all_demonstrations(trained, datasets):
    alone = train_final("pmnn", datasets["turn"], FEW.pointwise, FEW.hidden)
    for name, array in dict(trained["pointwise"])["turn"].arrays().items():
        np.testing.assert_array_equal(array, alone.arrays()[name])


def test_what_has_seen_the_level_board_asks_for_less_there(trained, level):
    for name, dataset in level.items():
        text, ours = (dict(trained[model])[name] for model in ("pointwise", "level"))
        coupling = (
            one.coupling(dataset.deviation, dataset.phase, dataset.phase_velocity) for one in (text, ours)
        )
        before, after = (np.mean(one**2) for one in coupling)
        assert after < 0.5 * before


def test_path_errors_are_in_degrees_by_model_primitive_and_demonstration(trained, datasets):
    table = path_errors(datasets, {model: dict(networks) for model, networks in trained.items()})
    keys = table[["model", "primitive", "setting_deg", "demonstration"]]
    assert len(keys.drop_duplicates()) == len(table) == 3 * 2 * 3 * 4
    paths = corrected_paths(datasets["turn"], SAMPLES)
    exact = np.degrees(unrolled_error(dict(trained["unrolled"])["turn"], paths))
    rows = table[(table["model"] == "unrolled") & (table["primitive"] == "turn")]
    np.testing.assert_allclose(rows["error_deg"], exact)
    np.testing.assert_array_equal(rows["setting_deg"], paths.setting)


def made_up(errors):
    """A table with given generalisation errors per representation and fold."""
    table = pd.DataFrame(errors).rename_axis("fold").reset_index()
    table = table.melt("fold", var_name="representation", value_name="generalization")
    return pd.concat([table.assign(stopping=stopping) for stopping in feedback_models.STOPPINGS])


def test_orderings_are_told_in_pairs_over_the_folds():
    rng = np.random.default_rng(0)
    level = rng.uniform(0.1, 0.9, 15)  # folds differ far more than models
    errors = {
        "pmnn_100": level,
        "pmnn_6": level + 0.05 + 0.01 * rng.normal(size=15),
        "pca": level - 0.05 + 0.01 * rng.normal(size=15),
        "autoencoder": level + 0.02 * np.resize([-1.0, 1.0], 15),
    }
    found = feedback_models.paired_orderings(made_up(errors)).set_index(["stopping", "better", "worse"])
    assert len(found) == 2 * 5
    for stopping in feedback_models.STOPPINGS:
        rows = found.loc[stopping]
        assert rows["verdict"].to_dict() == {
            ("pmnn_100", "pmnn_6"): "better",
            ("pmnn_100", "pca"): "worse",
            ("pmnn_100", "autoencoder"): "undecided",
            ("pmnn_6", "pca"): "worse",
            ("pmnn_6", "autoencoder"): "worse",
        }
        assert rows.loc[("pmnn_100", "pmnn_6"), "p_value"] == pytest.approx(2 / 2**15)  # all 15 agree
        assert rows.loc[("pmnn_100", "pmnn_6"), "difference"] == pytest.approx(0.05, abs=0.01)
    same = feedback_models.paired_orderings(made_up({"pmnn_100": level, "pmnn_0": level}))
    assert same["verdict"].eq("undecided").all()
    assert same["p_value"].eq(1.0).all()


QUICK = committed(TrainingParameters, "compare_models", steps=400, evaluate_every=100, batch_size=32)
FOLDS = leave_one_out(toy_dataset(), 1, seed=0)
ROWS = len(toy_dataset().target)


def spanned(stds, seed=0):
    """Deviations that vary with given stds along orthogonal directions of 38 channels."""
    rng = np.random.default_rng(seed)
    directions, _ = np.linalg.qr(rng.normal(size=(38, len(stds))))
    return rng.normal(size=(ROWS, len(stds))) * stds @ directions.T + 5.0, directions


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
    assert all(encoder.code.shape == (ROWS, 3) for encoder in encoders)
    assert np.abs(encoders[2].code[:, 2]).max() == 0.0
    assert np.abs(encoders[0].code[:, 2]).max() > 1.0


def test_an_autoencoder_finds_a_curve_that_one_principal_component_cannot_show():
    angle = np.random.default_rng(0).uniform(0.0, 5.0, ROWS)
    curve = np.column_stack([np.cos(angle), np.sin(angle), 0.1 * angle])
    parameters = QUICK.model_copy(update={"steps": 1000, "learning_rate": 3e-3})

    def unlikeness(code):  # of neighbours in the code, which should be neighbours on the curve
        return np.quantile(np.abs(np.diff(angle[np.argsort(code)])), 0.9)

    (component,) = principal_components(jobs(curve, FOLDS[:1]), 0.1)
    assert component.code.shape == (ROWS, 1)
    for encoder in autoencoder(jobs(curve, FOLDS[:2]), np.array([1, 1]), parameters):
        assert encoder.code.shape == (ROWS, 1)
        assert unlikeness(encoder.code[:, 0]) < 0.2 * unlikeness(component.code[:, 0])


def test_autoencoders_have_codes_of_their_own_width():
    deviation, _ = spanned([10.0, 5.0, 3.0])
    narrow, wide = autoencoder(jobs(deviation, FOLDS[:2]), np.array([1, 3]), QUICK)
    assert narrow.code.shape == wide.code.shape == (ROWS, 3)
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
        phase = canonical.phase(np.linspace(0.1, 0.9, ROWS), 2.0)
        scale = np.full(38, encoder.scale)
        found = network.compose_encoder(encoder.mean, scale, encoder.layers).coupling(deviation, *phase)
        np.testing.assert_allclose(found, network.coupling(encoder.code, *phase), atol=1e-4, rtol=1e-4)
