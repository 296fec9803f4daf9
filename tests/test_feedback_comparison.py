import numpy as np
import pandas as pd
import pytest
from committed import committed
from feedback_toy import toy_dataset

from structlearn.feedback import feedback_models
from structlearn.feedback.coupling_model import TrainingParameters
from structlearn.testbeds.scraping.page.feedback_results import dominant_features

QUICK = committed(TrainingParameters, "compare_models", steps=40, evaluate_every=20, batch_size=16)


@pytest.fixture(scope="module")
def table():
    return feedback_models.compare_representations({"turn": toy_dataset()}, QUICK)["turn"]


def test_each_stopping_is_the_lowest_of_its_own_part(table):
    keys = ["representation", "fold"]
    validation = table[table["stopping"] == "validation"].set_index(keys)
    optimistic = table[table["stopping"] == "generalization"].set_index(keys)
    assert (optimistic["generalization"] <= validation["generalization"]).all()
    assert (validation["validation"] <= optimistic["validation"]).all()


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


def test_the_dominant_features_are_those_with_the_largest_weights():
    weights = np.array([[0.1, -5.0, 2.0, 0.0], [3.0, 0.2, -0.1, -4.0]])
    found = dominant_features(weights, 2)
    np.testing.assert_array_equal(found, [[False, True, True, False], [True, False, False, True]])
    assert dominant_features(weights, 10).all()
