"""What the stages of the servoing testbed wrote, and what they make of a user's bags."""

import json
import runpy
import shutil
from dataclasses import fields, replace
from functools import reduce
from operator import getitem
from pathlib import Path

import numpy as np
import pytest
import yaml
from committed import NO_TOPICS, committed, merged, parameter_tree
from recordings_bags import as_recorded
from reduced_pipeline import REDUCED

from structlearn.ground.artefacts import read_table
from structlearn.ground.errors import InputError
from structlearn.ground.populations import Population
from structlearn.recordings import read_recordings, write_recordings
from structlearn.reporting.studies import read_description
from structlearn.tactile.geodesics import read_geodesics
from structlearn.tactile.touch_dataset import chains, read_dataset
from structlearn.testbeds.servoing.protocol.servo_variants import Variant, variants

OWN_STAGES = ("record_touch", "touch_dataset", "geodesics", "train_latent", "servo", "view", "report")


def run_stages(root: Path, source: Path, topics: dict, stages=OWN_STAGES) -> None:
    """Stages on a user's bags in the working directory."""
    own = {"record_touch": {"source": str(source), "topics": NO_TOPICS | {"pose": "/pose"} | topics}}
    parameters = merged(parameter_tree(REDUCED), own)
    parameters["other_skins"]["skins"].pop("flat_pad")
    Path("params.yaml").write_text(yaml.safe_dump(parameters))
    for stage in stages:
        runpy.run_path(str(root / "stages" / "servoing" / f"{stage}.py"), run_name="stage")["main"]()


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_what_is_recorded_becomes_samples_with_distances(reduced_project):
    """Of two places a turn, which touches twice, and a swipe, which touches four times, each twice."""
    files = list((reduced_project / "data/raw/servoing").glob("*.mcap"))
    assert len(files) == 8
    dataset = read_dataset(reduced_project / "data/servoing/touch.safetensors")
    assert dataset.contact.max() + 1 == 4 * 2 + 4 * 4
    assert len(chains(dataset, 3)) > 1000
    geodesics = read_geodesics(reduced_project / "data/servoing/geodesics.safetensors")
    assert geodesics.distance.shape == (1, 300, 300)
    assert np.isfinite(geodesics.distance).all()
    truth = read_table(reduced_project / "data/servoing/true_contacts.parquet")
    assert truth["trial"].nunique() == len(files)


def test_all_controllers_meet_the_same_trials(reduced_project):
    """Whatever they make of them: start and target of a trial are the same in every controller's rows."""
    trials, paths, progress = (
        read_table(reduced_project / f"data/servoing/servo/{name}.parquet")
        for name in ("trials", "paths", "progress")
    )
    keys = [field.name for field in fields(Variant)]
    groups = trials.groupby(keys)
    assert len(groups) == len(variants(3)) == progress.groupby(keys).ngroups
    assert set(groups.size()) == {2 * 3}
    contacts = trials.filter(regex="^(start|target)_._m$|_load_n$").columns
    for _, rows in groups:
        np.testing.assert_array_equal(rows[contacts], trials[contacts][: 2 * 3])
    shown = paths.groupby([*keys, "seed", "trial"]).size()
    assert len(shown) == 6 * 2
    assert paths.filter(like="electrode_").shape[1] == 19


def test_another_skin_goes_the_same_way(reduced_project):
    latent, directions, trials = (
        read_table(reduced_project / f"data/servoing/{name}.parquet")
        for name in ("other_skins/latent", "other_skins/directions", "servo/other_skins")
    )
    assert all(set(table["skin"]) == {"sphere"} for table in (latent, directions, trials))
    assert set(trials["form"]) == {"published", "resting"}
    assert np.isfinite(latent["reconstruction"]).all()


def test_what_is_reported_is_of_the_first_of_the_test_set(root):
    """Demonstrations, models and contacts; studies repeat it on the others, and tune on none of them."""
    people = committed(Population, "servo_people")
    parameters = yaml.safe_load((root / "params.yaml").read_text())
    seeds = ("toucher.seed", "toucher.sensor_seed", "train_latent.training.seed", "servo.seed")
    for key in seeds:
        assert reduce(getitem, key.split("."), parameters) == people.test[0], key
    studies = root / "benchmarks/studies"
    assert set(read_description("servoing/people", studies).repeats.seeds) == set(seeds)
    for name in ("controller", "loss_weights"):
        for repeat in read_description(f"servoing/{name}", studies).repeats:
            assert {repeat[key] for key in seeds} <= set(people.tuning)


def test_own_recordings_go_the_same_way(root, reduced_project, folder):
    """Other names, no provenance: the same samples; only what cannot be known is missing."""
    bags = as_recorded(read_recordings(reduced_project / "data/raw/servoing"))
    write_recordings([replace(one, name=f"own_{number}") for number, one in enumerate(bags)], "bags")
    others = Path("data/servoing/other_skins")  # the source makes no difference to what is learned with them
    shutil.copytree(reduced_project / others, others)
    run_stages(root, folder / "bags", {"tactile": ["/tactile/0"]})
    mine = read_dataset("data/servoing/touch.safetensors")
    simulated = read_dataset(reduced_project / "data/servoing/touch.safetensors")
    np.testing.assert_array_equal(mine.signals, simulated.signals)
    np.testing.assert_array_equal(mine.velocity, simulated.velocity)
    assert len(read_table("data/servoing/true_contacts.parquet")) == 0
    shown = {file.name for file in Path("reports/recordings/servoing").iterdir()}
    assert shown == {"demonstrations.rrd", "latent.rrd"}
    report = Path("reports/servoing")
    assert json.loads((report / "details.json").read_text())["simulated"] is False
    assert "servo_success_rate" not in json.loads((report / "metrics.json").read_text())
    html = (report / "index.html").read_text()
    assert "servo.rrd" not in html
    assert 'class="badge"' not in html  # only the other skins are simulated, and say so


def test_a_missing_topic_is_named(root, reduced_project, folder):
    with pytest.raises(InputError, match="/biotac"):
        run_stages(root, reduced_project / "data/raw/servoing", {"tactile": ["/biotac"]}, OWN_STAGES[:1])
