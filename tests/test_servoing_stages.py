"""The stages of the servoing testbed as scripts, on a small world."""

import json
import runpy
import shutil
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
import yaml
from committed import NO_TOPICS, parameter_tree

from structlearn.ground import parallel
from structlearn.ground.artefacts import read_table
from structlearn.ground.errors import InputError
from structlearn.recordings import read_recordings, write_recordings
from structlearn.recordings.recording import Recording
from structlearn.tactile.geodesics import read_geodesics
from structlearn.tactile.touch_dataset import chains, read_dataset
from structlearn.testbeds.servoing.protocol.servo_trials import Variant, variants

STAGES = ("record_touch", "touch_dataset", "geodesics", "train_latent", "servo", "other_skins")
SMALL = {
    "toucher": {"areas": 3, "rotations": 1, "translations": 1},
    "geodesics": {"bin_size": 300, "bins": 2, "bridge_mm": 8.0},
    "train_latent": {
        "seeds": 2,
        "stacks": 1,
        "training": {"steps": 100, "evaluate_every": 100},
        "pair_pool": 2000,
        "evaluation_pairs": 100,
        "longest_chain": 3,
    },
    "servo": {"trials": 3, "duration_s": 1.0, "shown": 1},
    "other_skins": {"bins": 2, "seeds": 1, "steps": 20},
    "inspect_servoing": {"demonstrations": ["rotation_1_1"], "map_points": 500, "trials": 1},
}


def run_stages(root: Path, folder: Path, parameters: dict, stages=STAGES) -> dict[str, bytes]:
    folder.mkdir(exist_ok=True)
    tree = parameter_tree(parameters)
    tree["other_skins"]["skins"].pop("sphere")
    (folder / "params.yaml").write_text(yaml.safe_dump(tree))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(parallel.BACKEND, "sequential")
        patch.chdir(folder)
        for stage in stages:
            runpy.run_path(str(root / "stages" / "servoing" / f"{stage}.py"), run_name="stage")["main"]()
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.fixture(scope="module")
def written(root, tmp_path_factory):
    folder = tmp_path_factory.mktemp("servoing")
    first = run_stages(root, folder / "first", SMALL)
    return folder / "first", first


def test_what_is_recorded_becomes_samples_with_distances(written):
    folder, files = written
    assert len([name for name in files if name.endswith(".mcap")]) == 6
    dataset = read_dataset(folder / "data/servoing/touch.safetensors")
    assert dataset.contact.max() + 1 == 3 * 2 + 3 * 4
    assert len(chains(dataset, 3)) > 1000
    geodesics = read_geodesics(folder / "data/servoing/geodesics.safetensors")
    assert geodesics.distance.shape == (2, 300, 300)
    assert np.isfinite(geodesics.distance).all()
    truth = read_table(folder / "data/servoing/true_contacts.parquet")
    assert truth["trial"].nunique() == 6


def test_all_controllers_meet_the_same_trials(written):
    """Whatever they make of them: start and target of a trial are the same in every controller's rows."""
    folder, *_ = written
    trials, paths, progress = (
        read_table(folder / f"data/servoing/servo/{name}.parquet") for name in ("trials", "paths", "progress")
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


def test_another_skin_goes_the_same_way(written):
    folder, *_ = written
    tables = {
        name: read_table(folder / f"data/servoing/other_skins/{name}.parquet")
        for name in ("latent", "directions", "trials")
    }
    assert all(set(table["skin"]) == {"flat_pad"} for table in tables.values())
    assert set(tables["trials"]["form"]) == {"published", "resting"}
    assert np.isfinite(tables["latent"]["reconstruction"]).all()


def test_own_recordings_go_the_same_way(root, written, tmp_path):
    """Other topic names, no provenance: the same samples; only what cannot be known is missing."""
    folder, *_ = written
    bags = [
        Recording(f"own_{number}", one.streams, None, {"origin": "recorded"})
        for number, one in enumerate(read_recordings(folder / "data/raw/servoing"))
    ]
    write_recordings(bags, tmp_path / "bags")
    topics = NO_TOPICS | {"pose": "/pose", "tactile": ["/tactile/0"]}
    own = SMALL | {"record_touch": {"source": str(tmp_path / "bags"), "topics": topics}}
    others = "data/servoing/other_skins"  # the source makes no difference to them
    shutil.copytree(folder / others, tmp_path / "own" / others)
    run_stages(root, tmp_path / "own", own, (*STAGES[:-1], "view", "report"))
    mine = read_dataset(tmp_path / "own/data/servoing/touch.safetensors")
    simulated = read_dataset(folder / "data/servoing/touch.safetensors")
    np.testing.assert_array_equal(mine.signals, simulated.signals)
    np.testing.assert_array_equal(mine.velocity, simulated.velocity)
    assert len(read_table(tmp_path / "own/data/servoing/true_contacts.parquet")) == 0
    reports = tmp_path / "own/reports"
    shown = {file.name for file in (reports / "recordings/servoing").iterdir()}
    assert shown == {"demonstrations.rrd", "latent.rrd"}
    assert json.loads((reports / "servoing/details.json").read_text())["simulated"] is False
    assert "servo_success_rate" not in json.loads((reports / "servoing/metrics.json").read_text())
    html = (reports / "servoing/index.html").read_text()
    assert "servo.rrd" not in html
    assert 'class="badge"' not in html  # only the other skins are simulated, and say so


def test_a_missing_topic_is_named(root, written, tmp_path):
    folder, *_ = written
    topics = NO_TOPICS | {"pose": "/pose", "tactile": ["/biotac"]}
    source = str(folder / "data/raw/servoing")
    own = SMALL | {"record_touch": {"source": source, "topics": topics}}
    with pytest.raises(InputError, match="/biotac"):
        run_stages(root, tmp_path / "own", own, STAGES[:1])
