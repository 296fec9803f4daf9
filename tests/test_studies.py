"""Studies: what they vary is data, and what they found is quoted with its parameters, and by whose code."""

import importlib.util
import json
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from structlearn.core.errors import InputError
from structlearn.reporting.document import UNKNOWN_COMMIT, source_commit
from structlearn.reporting.studies import (
    RESULTS,
    Made,
    Rerun,
    Study,
    digests,
    provenance,
    read_study,
    rests_on,
    stored_study,
)


def program(path):
    """A program of `benchmarks` as a module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


commands = program(Path(__file__).parents[1] / "benchmarks/study.py")

DESCRIPTION = """
question: Does more help?
target: learn
reads: [reports/toy/findings.csv]
keys: [cost_*]
shown: {cost_a: cost}
variants: {less: {learn.steps: 1}, more: {learn.steps: 9}}
repeats: [{learn.seed: 0}, {learn.seed: 1}]
minutes: 3
"""
TABLE = pd.DataFrame(
    {"variant": ["less", "less", "more", "more"], "repeat": [0, 1, 0, 1], "cost_a": [4.0, 6.0, 1.0, 2.0]}
)


MADE = Made(parameters={}, commit="a1b2c3d", processor="", added={}, beside={}, rerun=None)
RERUN = Rerun(
    commit="e4f5a6b",
    processor="here",
    exact=True,
    covers="recordings of the first person",
    compared=3,
    in_table=2,
    different=[],
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
    assert commands.study_names(folder) == ["toy/steps"]
    assert commands.read_description("toy/steps", folder).variants["more"] == {"learn.steps": 9}
    with pytest.raises(InputError, match=r"no such study; there are toy/steps"):
        commands.read_description("toy/other", folder)
    (folder / "toy/steps.yaml").write_text(DESCRIPTION + "color: red\n")
    with pytest.raises(InputError, match="color"):
        commands.read_description("toy/steps", folder)
    (folder / "toy/steps.yaml").write_text(DESCRIPTION + "target: front\n")
    with pytest.raises(InputError, match=r"steps\.yaml: key 'target' stands twice"):
        commands.read_description("toy/steps", folder)


def test_repeats_over_a_population_are_its_test_seeds(toy):
    text = DESCRIPTION.replace(
        "[{learn.seed: 0}, {learn.seed: 1}]", "{population: people, seeds: [record.seed, sensor.seed]}"
    )
    (toy / "studies/toy/steps.yaml").write_text(text)
    found = commands.repeats(commands.read_description("toy/steps", toy / "studies"), toy / "params.yaml")
    assert found == [{"record.seed": 11, "sensor.seed": 11}, {"record.seed": 12, "sensor.seed": 12}]


def test_the_commit_of_sources_says_whether_they_are_as_committed(tmp_path, monkeypatch):
    def git(*arguments):
        subprocess.run(["git", "-C", tmp_path, *arguments], check=True, capture_output=True)

    (tmp_path / "src").mkdir()
    (tmp_path / "src/one.py").write_text("x = 1")
    assert source_commit(["src"], tmp_path) == UNKNOWN_COMMIT  # unpacked from an archive
    git("init")
    assert source_commit(["src"], tmp_path) == UNKNOWN_COMMIT
    git("add", ".")
    git("-c", "user.name=a", "-c", "user.email=a@b", "commit", "-m", "one")
    commit = source_commit(["src"], tmp_path)
    assert len(commit) >= 7
    (tmp_path / "notes.txt").write_text("no source")
    (tmp_path / "src/dvc.lock").write_text("what the stages wrote")
    assert source_commit(["src"], tmp_path) == commit
    (tmp_path / "src/two.py").write_text("x = 2")
    assert source_commit(["src"], tmp_path) == f"{commit}+changes"
    assert source_commit(["src"], tmp_path / "src") == UNKNOWN_COMMIT  # within another project
    monkeypatch.setenv("PATH", "")
    assert source_commit(["src"], tmp_path) == UNKNOWN_COMMIT


def test_a_study_says_by_whose_code_it_was_made_and_what_of_it_was_run_again():
    def words(**changes):
        made = MADE.model_copy(update={"rerun": RERUN.model_copy(update=changes)})
        return provenance(Study(TABLE, made))

    study = Study(TABLE, MADE)
    assert provenance(study) == "made by commit a1b2c3d, not run again"
    assert rests_on("toy/steps", None) == ("", "")
    assert rests_on("toy/steps", study) == (
        f"Rows over people rest on the study toy/steps, {provenance(study)}.",
        "",
    )
    assert words() == "made by commit a1b2c3d, part of one cell run again by e4f5a6b: equal"
    assert rests_on("toy/steps", Study(TABLE, MADE.model_copy(update={"rerun": RERUN})))[1] == (
        "Run again: recordings of the first person, compared in 2 numbers of the table and 1 number that the "
        "table's code gives and the table lacks; nothing else of the study."
    )
    assert "run again by e4f5a6b: 1 of 3 numbers differ" in words(different=["cost_a"])
    assert "equal within 0.1 % on another processor" in words(exact=False)


def test_a_study_that_does_not_say_by_which_code_it_was_made_is_refused(toy):
    folder = toy / "results/toy/steps"
    commands.write_study(TABLE, MADE, folder)
    assert stored_study(folder).made == MADE
    (folder / "study.json").write_text(json.dumps({"learn": "0" * 32}))
    with pytest.raises(InputError, match=r"study\.json: .*commit: Field required"):
        read_study("toy/steps", toy / "results", toy / "params.yaml")


def test_a_part_of_a_cell_is_run_with_its_parameters_and_held_against_the_table(toy):
    cell = "rerun: {variant: more, repeat: 1, covers: all}\n"
    (toy / "studies/toy/steps.yaml").write_text(DESCRIPTION + cell)
    description = commands.read_description("toy/steps", toy / "studies")
    script = toy / "benchmarks/studies/toy/steps.py"
    script.parent.mkdir(parents=True)
    script.write_text(
        "import json, yaml\n"
        "learn = yaml.safe_load(open('params.yaml'))['learn']\n"
        "found = {'cost_a': 2.0000001, 'cost_b': learn['steps'], 'seed': learn['seed']}\n"
        "json.dump(found, open('numbers.json', 'w'))\n"
    )
    found = commands.run_part("toy/steps", description, toy)
    assert found == {"cost_a": 2.0000001, "cost_b": 9, "seed": 1}
    kept = MADE.model_copy(update={"beside": {"cost_b": 9.0, "seed": 1.0}})
    again = commands.compare(found, Study(TABLE, kept), description, toy)
    assert (again.different, again.compared, again.in_table, again.exact) == ([], 3, 1, True)
    assert again.commit == UNKNOWN_COMMIT
    assert commands.compare(found, Study(TABLE, MADE), description, toy).different == [
        "cost_b",
        "seed",
    ]  # not kept
    off = found | {"cost_a": 2.0 * (1.0 + 0.5 * commands.TOLERANCE)}
    assert commands.compare(off, Study(TABLE, kept), description, toy).different == ["cost_a"]
    other = kept.model_copy(update={"processor": "another"})
    assert commands.compare(off, Study(TABLE, other), description, toy).different == []
    off |= {"cost_a": 2.0 * (1.0 + 2.0 * commands.TOLERANCE)}
    assert commands.compare(off, Study(TABLE, other), description, toy).different == ["cost_a"]
    known = {
        "processor": "another",
        "rerun": RERUN.model_copy(update={"processor": commands.processor()}),
    }
    assert commands.compare(
        {"cost_a": 2.001}, Study(TABLE, MADE.model_copy(update=known)), description, toy
    ).different
    known["rerun"] = RERUN.model_copy(update={"processor": "a third"})
    assert not commands.compare(
        {"cost_a": 2.001}, Study(TABLE, MADE.model_copy(update=known)), description, toy
    ).different
    script.write_text("raise SystemExit('no such key')")
    with pytest.raises(InputError, match=r"steps\.py: no such key"):
        commands.run_part("toy/steps", description, toy)


def test_a_study_is_quoted_only_with_its_parameters(toy):
    parameters, results = toy / "params.yaml", toy / "results"
    assert read_study("toy/steps", results, parameters) is None
    made = MADE.model_copy(update={"parameters": digests(parameters, ["learn", "absent"])})
    commands.write_study(TABLE, made, results / "toy/steps")
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
    description = commands.read_description("toy/steps", toy / "studies")
    page = commands.studies_page({"toy/steps": (description, Study(TABLE, MADE))})
    assert "Made by commit a1b2c3d, not run again." in page
    assert "Does more help?" in page
    assert "make study NAME=toy/steps" in page
    assert "1.5 [-4.85, 7.85]" in page.replace(
        "\N{MINUS SIGN}", "-"
    )  # t of one degree of freedom: 12.706 * 0.5


@pytest.mark.parametrize("name", commands.study_names())
def test_every_study_names_what_is_there(name, root: Path):
    description = commands.read_description(name)
    pipeline = yaml.safe_load((root / "dvc.yaml").read_text())
    parameters = yaml.safe_load((root / "params.yaml").read_text())
    assert description.target in pipeline["stages"]
    for changes in [*description.variants.values(), *commands.repeats(description, root / "params.yaml")]:
        for key in changes:
            value = parameters
            for part in key.split("."):
                assert part in value, f"{key} is no parameter"
                value = value[part]


RUN = [name for name in commands.study_names() if (RESULTS / name / "study.json").exists()]


@pytest.mark.parametrize("name", [name for name in RUN if commands.read_description(name).rerun])
def test_the_present_code_gives_what_a_study_found(name, root: Path):
    """Part of one cell is run again: all digits on a processor of the kind that the table is known from."""
    description, study = commands.read_description(name), stored_study(RESULTS / name)
    again = commands.compare(commands.run_part(name, description, root), study, description, root)
    assert again.different == [], f"make study NAME={name}: the code gives other numbers than its table"
    assert again.compared >= 20


@pytest.mark.parametrize("name", RUN)
def test_every_result_was_made_with_the_parameters_and_variants_of_now(name, root: Path):
    description, study = commands.read_description(name), read_study(name)
    assert study is not None, f"make study NAME={name}: parameters have changed since"
    assert set(study.table["variant"]) == set(description.variants)
    assert set(description.shown) <= set(study.table)
    assert study.made.rerun is None or study.made.rerun.different == []
    assert bool(study.made.rerun) == bool(description.rerun), f"make studies-check NAME={name}"
    assert f"{name}/table.csv" in (RESULTS / "index.html").read_text()
