"""Results: one long table; findings on it; rows of a study whose parameters are those of this run."""

import numpy as np
import pandas as pd
import pytest
import yaml

from dissertation.evidence.results import (
    Register,
    Results,
    joined_results,
    long_table,
    parameters_of,
    with_study,
)
from dissertation.evidence.studies import Study, StudyProvenance, digests
from structlearn.reporting.evidence import maximum, mean
from structlearn.reporting.findings import Findings

KEYS = {"person": int, "model": str}
VALUES = {"cut": {"length": 2}, "train": {"seed": 1, "steps": 9}, "draw": 0}
STAGES = {
    "toy_cut": {"params": ["cut"], "outs": ["data/cuts"]},
    "toy_train": {
        "params": ["train.steps"],
        "deps": ["data/cuts"],
        "outs": [{"data/model": {"cache": False}}],
    },
    "toy_test": {"deps": ["data/model"], "outs": ["data/scores"]},
}


def table(people, offset=0.0):
    """Two quantities of some people: an error of cuts, and costs of two models."""
    index = pd.Index(people, name="person")
    costs = pd.MultiIndex.from_product([people, ["none", "ours"]], names=["person", "model"])
    worth = pd.Series([2.0 if model == "none" else 1.0 + 0.1 * person for person, model in costs], costs)
    parts = [
        long_table("toy_cut", "error", pd.Series(index.to_numpy(float), index) + offset, "ms"),
        long_table("toy_test", "cost", worth, "rad"),
    ]
    return joined_results(parts, KEYS)


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A folder with a pipeline and its parameters."""
    (tmp_path / "dvc.yaml").write_text(yaml.safe_dump({"stages": STAGES}))
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(VALUES))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def study_of(people, values=VALUES):
    made = {"parameters": digests(values, ["cut", "train"], ["train.seed"]), "seeds": ["train.seed"]}
    return Study(table(people), StudyProvenance(**made, cells={}, check=None))


def register():
    its = Register()

    @its.finding(mean, unit="ms")
    def cut_error(results):
        return results.each("error")

    @its.finding(mean)
    def saved(results):
        costs = results.wide("cost", "model")
        return {"ours": costs["none"] - costs["ours"]} if len(costs) else {"ours": None}

    its.finding(maximum, name="largest_error")(lambda results: results.each("error"))
    return its


def found(population):
    find = Findings("people")
    register().evaluate(find, population)
    return find


def test_a_table_of_results_has_each_row_once():
    its = table([1, 2])
    assert list(its) == ["stage", "quantity", "value", "unit", "person", "model"]
    assert its["model"].tolist() == ["", "", "none", "ours", "none", "ours"]
    with pytest.raises(ValueError, match="two results have the same keys"):
        joined_results([its, its], KEYS)
    with pytest.raises(ValueError, match="unknown keys \\['fold'\\]"):
        joined_results([its.assign(fold=1)], KEYS)


def test_one_value_per_person():
    results = Results(table([1, 2, 3]), "person", population=[2, 3])
    assert results.each("error").to_dict() == {2: 2.0, 3: 3.0}
    assert list(results.wide("cost", "model")) == ["none", "ours"]
    assert results.each("absent").empty
    with pytest.raises(ValueError, match="several values of cost for one person"):
        results.each("cost")


def test_a_stage_rests_on_the_parameters_of_those_before_it():
    assert parameters_of(STAGES)["toy_test"] == {"cut", "train"}


def test_the_study_counts_and_the_person_tuned_on_does_not(project):
    population = with_study(table([1]), study_of([1, 2, 3, 4]), "person", tested=[])
    assert not population.moved
    find = found(population)
    assert find["cut_error"].value == 3.0
    assert find["cut_error"].n == 3
    assert find["saved"]["ours"].value == pytest.approx(0.7)


def test_rows_that_rest_on_another_parameter_show_this_run_and_the_study_beside(project):
    other = VALUES | {"train": {"seed": 5, "steps": 10}}
    population = with_study(table([1]), study_of([2, 3, 4], other), "person", tested=[])
    assert population.moved
    find = found(population)
    assert find["cut_error"].n == 3
    assert not find["cut_error"].remark
    saved = find["saved"]["ours"]
    assert saved.value == pytest.approx(0.9)
    assert np.isinf(saved.high)
    assert saved.remark.startswith("one person; 0.7 [")
    assert saved.remark.endswith("with other parameters")


def test_the_seeds_of_a_study_are_not_its_parameters(project):
    same = VALUES | {"train": {"seed": 5, "steps": 9}}
    assert not with_study(table([1]), study_of([2], same), "person", tested=[]).moved


def test_without_a_study_one_person_decides_nothing():
    find = found(with_study(table([1]), None, "person", tested=[]))
    assert find["largest_error"].remark == "one person"
    assert np.isinf(find["largest_error"].low)
