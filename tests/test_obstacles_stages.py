"""The stages of the obstacle testbed as scripts, on a small world."""

import runpy
from pathlib import Path

import numpy as np
import pytest
import yaml
from committed import committed, parameter_tree

from structlearn.avoidance.learned_models import read_models
from structlearn.avoidance.shapes import SHAPES
from structlearn.ground import parallel
from structlearn.ground.artefacts import read_table
from structlearn.ground.errors import InputError
from structlearn.recordings import read_recordings
from structlearn.testbeds.obstacles.files import read_baseline, read_scenarios
from structlearn.testbeds.obstacles.world.scenarios import SceneParameters, scenarios

STAGES = ("demonstrate", "dataset", "train", "evaluate")
NETWORK = {"hidden": [4], "training": {"iterations": 3}}
SMALL = {
    "obstacle_scene": {"settings": 2, "near_share": 0.5},
    "obstacle_demonstrator": {"baseline_count": 3, "count": 3},
    "obstacle_dataset": {"cloud_count": 30},
    "obstacle_training": {
        "per_setting": NETWORK,
        "per_shape": NETWORK,
        "all_shapes": NETWORK,
        "phase_modulated": {"steps": 20, "evaluate_every": 10, "chunk_samples": 10},
        "phase_modulated_hidden": [4],
    },
    "obstacle_evaluation": {"rate_hz": 50, "kept_every": 2, "speeds_m_s": [0.1], "pairs": 3},
}


def run_stages(root: Path, folder: Path) -> dict[str, bytes]:
    folder.mkdir()
    (folder / "params.yaml").write_text(yaml.safe_dump(parameter_tree(SMALL)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(parallel.BACKEND, "sequential")
        patch.chdir(folder)
        for stage in STAGES:
            runpy.run_path(str(root / "stages" / "obstacles" / f"{stage}.py"), run_name="__main__")
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.fixture(scope="module")
def written(root, tmp_path_factory):
    folder = tmp_path_factory.mktemp("obstacles")
    return folder / "first", run_stages(root, folder / "first")


def test_every_scenario_is_recorded_and_learned_from(written):
    folder, files = written
    places = scenarios(committed(SceneParameters, "obstacle_scene", **SMALL["obstacle_scene"]))
    recorded = [name for name in files if name.endswith(".mcap")]
    assert len(recorded) == 3 + 3 * len(places)
    provenance = read_recordings(folder / "data/raw/obstacles/cube/02")[0].provenance
    assert provenance["origin"] == "simulated"
    assert provenance["setting"] == "cube/02"
    assert [len(its) for its in read_scenarios(places, folder / "data/raw/obstacles")] == [3] * len(places)
    samples = read_table(folder / "data/obstacles/dataset/samples.parquet")
    assert samples.groupby("scenario")["demonstration"].nunique().tolist() == [3] * len(places)
    models = read_models(folder / "data/obstacles/models")
    assert set(models.networks) == {"setting", "all", *SHAPES}


def test_every_model_is_put_to_every_protocol(written):
    folder, *_ = written
    scores = read_table(folder / "data/obstacles/evaluation/scores.parquet")
    counts = scores[scores["rules"] == "limited"].groupby(["protocol", "model", "learned_from"]).size()
    assert counts["trained"]["network"].to_dict() == {
        "all": 6,
        "cube": 2,
        "cylinder": 2,
        "setting": 6,
        "sphere": 2,
    }
    assert counts["trained"]["none"].sum() == 6
    assert counts["unseen"]["phase_modulated"].to_dict() == {"all": 63} | dict.fromkeys(SHAPES, 63)
    assert set(counts.index.get_level_values("protocol")) == {
        "trained",
        "unseen",
        "moving",
        "pair",
        "goal_change",
    }
    people = read_table(folder / "data/obstacles/evaluation/demonstrations.parquet")
    assert len(people) == 18
    assert not people["hit"].any()
    paths = read_table(folder / "data/obstacles/evaluation/paths.parquet")
    start = paths[paths["time_s"] == 0.0][["x_m", "y_m", "z_m"]].to_numpy()
    baseline = read_baseline(folder / "data/obstacles/dataset/baseline.safetensors")
    np.testing.assert_allclose(start, np.broadcast_to(baseline.start, start.shape), atol=1e-6)


def test_what_is_missing_is_named(tmp_path):
    with pytest.raises(InputError, match=r"/0\d: no such file or folder"):
        read_scenarios(scenarios(committed(SceneParameters, "obstacle_scene", settings=1)), tmp_path)
