from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from committed import committed
from feedback_toy import toy_dataset

from structlearn.core.errors import InputError
from structlearn.feedback import feedback_models
from structlearn.feedback.corrected_paths import SAMPLES, corrected_paths, path_errors, unrolled_error
from structlearn.feedback.coupling_model import TrainingParameters, UnrolledTrainingParameters, train_final
from structlearn.feedback.feedback_models import FeedbackParameters, train_models
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork

FEW = FeedbackParameters(
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
    alone = train_final(PhaseModulatedNetwork, datasets["turn"], FEW.pointwise, FEW.hidden)
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


def test_one_demonstration_is_too_few():
    one = toy_dataset(demonstrations=1, settings=(0.0, 5.0, 10.0))
    with pytest.raises(InputError, match="at least two demonstration numbers"):
        train_models({"turn": one}, {"turn": one}, FEW)


def made_up(errors):
    """A table with given generalisation errors per representation and fold."""
    rows = [
        (name, fold, stopping, error)
        for stopping in feedback_models.STOPPINGS
        for name, values in errors.items()
        for fold, error in enumerate(values)
    ]
    return pd.DataFrame(rows, columns=["representation", "fold", "stopping", "generalization"])


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
