"""Studies: what they vary is data, and what they found is quoted only with its parameters."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from structlearn.ground.errors import InputError
from structlearn.reporting.studies import (
    RESULTS,
    digests,
    read_description,
    read_study,
    repeats,
    studies_page,
    study_names,
    upstream_parameters,
    write_study,
)

DESCRIPTION = """
question: Does more help?
target: learn
reads: [reports/toy/details.json]
keys: [cost_*]
shown: {cost_a: cost}
variants: {less: {learn.steps: 1}, more: {learn.steps: 9}}
repeats: [{learn.seed: 0}, {learn.seed: 1}]
minutes: 3
"""
PIPELINE = {
    "stages": {
        "record": {"params": ["people", "robot.mass"], "outs": ["data/raw"]},
        "learn": {"params": ["learn"], "deps": ["data/raw/one.mcap", "src"], "outs": [{"data/model": {}}]},
        "report": {"params": ["drawing"], "deps": ["data/model"], "metrics": [{"reports/m.json": {}}]},
        "front": {"deps": ["reports/m.json"], "params": ["titles"]},
    }
}
TABLE = pd.DataFrame(
    {"variant": ["less", "less", "more", "more"], "repeat": [0, 1, 0, 1], "cost_a": [4.0, 6.0, 1.0, 2.0]}
)


@pytest.fixture
def toy(tmp_path):
    folder = tmp_path / "studies/toy"
    folder.mkdir(parents=True)
    (folder / "steps.yaml").write_text(DESCRIPTION)
    (tmp_path / "params.yaml").write_text(
        "learn: {steps: 4, seed: 0}\npeople: {tuning: [1], test: [11, 12]}\n"
    )
    return tmp_path


def test_a_description_is_checked(toy):
    folder = toy / "studies"
    assert study_names(folder) == ["toy/steps"]
    assert read_description("toy/steps", folder).variants["more"] == {"learn.steps": 9}
    with pytest.raises(InputError, match=r"no such study; there are toy/steps"):
        read_description("toy/other", folder)
    (folder / "toy/steps.yaml").write_text(DESCRIPTION + "color: red\n")
    with pytest.raises(InputError, match="color"):
        read_description("toy/steps", folder)
    (folder / "toy/steps.yaml").write_text(DESCRIPTION + "target: front\n")
    with pytest.raises(InputError, match=r"steps\.yaml: key 'target' stands twice"):
        read_description("toy/steps", folder)


def test_repeats_over_a_population_are_its_test_seeds(toy):
    text = DESCRIPTION.replace(
        "[{learn.seed: 0}, {learn.seed: 1}]", "{population: people, seeds: [record.seed, sensor.seed]}"
    )
    (toy / "studies/toy/steps.yaml").write_text(text)
    found = repeats(read_description("toy/steps", toy / "studies"), toy / "params.yaml")
    assert found == [{"record.seed": 11, "sensor.seed": 11}, {"record.seed": 12, "sensor.seed": 12}]


def test_a_stage_depends_on_the_parameters_of_all_before_it():
    assert upstream_parameters(PIPELINE, "record") == ["people", "robot"]
    assert upstream_parameters(PIPELINE, "front") == ["drawing", "learn", "people", "robot", "titles"]


def test_a_study_is_quoted_only_with_its_parameters(toy):
    parameters, results = toy / "params.yaml", toy / "results"
    assert read_study("toy/steps", results, parameters) is None
    write_study(TABLE, digests(parameters, ["learn", "absent"]), results / "toy/steps")
    study = read_study("toy/steps", results, parameters)
    np.testing.assert_array_equal(study.values("less", "cost_a"), [4.0, 6.0])
    parameters.write_text("people: {}\nlearn: {seed: 0, steps: 4}\n")
    assert read_study("toy/steps", results, parameters) is not None  # what it depends on is as before
    (results / "toy/steps/table.csv").write_text("variant,cost_a\nless\nmore,1,2,3\n")
    with pytest.raises(InputError, match=r"table\.csv: not a table"):
        read_study("toy/steps", results, parameters)
    parameters.write_text("learn: {seed: 0, steps: 5}\n")
    assert read_study("toy/steps", results, parameters) is None


def test_the_page_has_a_row_per_variant_with_its_interval(toy):
    description = read_description("toy/steps", toy / "studies")
    page = studies_page({"toy/steps": (description, TABLE)})
    assert "Does more help?" in page
    assert "make study NAME=toy/steps" in page
    assert "1.5 [-4.85, 7.85]" in page.replace(
        "\N{MINUS SIGN}", "-"
    )  # t of one degree of freedom: 12.706 * 0.5


@pytest.mark.parametrize("name", study_names())
def test_every_study_names_what_is_there(name, root: Path):
    description = read_description(name)
    pipeline = yaml.safe_load((root / "dvc.yaml").read_text())
    parameters = yaml.safe_load((root / "params.yaml").read_text())
    assert description.target in pipeline["stages"]
    for changes in [*description.variants.values(), *repeats(description, root / "params.yaml")]:
        for key in changes:
            value = parameters
            for part in key.split("."):
                assert part in value, f"{key} is no parameter"
                value = value[part]


@pytest.mark.parametrize("name", [name for name in study_names() if (RESULTS / name / "study.json").exists()])
def test_every_result_was_made_with_the_parameters_and_variants_of_now(name, root: Path):
    description, study = read_description(name), read_study(name)
    assert study is not None, f"make study NAME={name}: parameters have changed since"
    assert set(study.table["variant"]) == set(description.variants)
    assert set(description.shown) <= set(study.table)
    assert json.loads((RESULTS / name / "study.json").read_text())
    assert f"{name}/table.csv" in (RESULTS / "index.html").read_text()
