"""The recorded samples: reader and protocol on made-up files, and on the real ones where they are at hand."""

import numpy as np
import pandas as pd
import pytest
from committed import committed
from readers_bags import recorded_data

from structlearn.avoidance.avoidance_dataset import AvoidanceDataset
from structlearn.avoidance.network_training import NetworkParameters
from structlearn.core.errors import InputError
from structlearn.feedback.coupling_model import TrainingParameters
from structlearn.primitives import canonical, kernels
from structlearn.reporting.claims import read_claims
from structlearn.tasks.obstacles import coupling_representations, coupling_samples
from structlearn.tasks.obstacles.coupling_representations import RepresentationParameters
from structlearn.tasks.obstacles.representations_section import (
    INPUTS,
    REPRESENTATIONS,
    representation_facts,
    representation_findings,
)

ROWS = 12
KEYS = ["representation", "inputs", "axis"]


def tables(rows=ROWS, seed=0):
    rng = np.random.default_rng(seed)
    features = rng.normal(size=(rows, 17))
    features[:, 15] = np.linalg.norm(features[:, :3], axis=1)
    time = np.linspace(0.0, 1.0, rows)
    p, u = canonical.phase(time, canonical.TAU_PER_DURATION)
    modulation = kernels.features(p, u)
    return {"features": features, "target": rng.normal(size=(rows, 3)), "modulation": modulation}, time


def write(folder, found):
    for name, path in coupling_samples.sample_files(folder).items():
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savetxt(path, found[name])


def test_samples_and_their_phase_are_read(tmp_path):
    found, time = tables()
    write(tmp_path, found)
    dataset = coupling_samples.read_coupling_samples(tmp_path)
    np.testing.assert_array_equal(dataset.features, found["features"])
    np.testing.assert_array_equal(dataset.target, found["target"])
    p, u = canonical.phase(time, canonical.TAU_PER_DURATION)
    np.testing.assert_allclose(dataset.time, time, atol=2e-4)
    np.testing.assert_allclose(dataset.phase, p, atol=1e-3)
    np.testing.assert_allclose(dataset.phase_velocity, u, atol=1e-12)
    assert len(np.unique(dataset.demonstration)) == ROWS
    provenance = coupling_samples.read_obstacles(tmp_path, None, {}).provenance
    assert provenance["origin"] == "recorded"
    assert len(provenance["sha256"].split()) == 3


def test_faults_name_the_file(tmp_path):
    with pytest.raises(InputError, match="holds no samples of obstacle avoidance"):
        coupling_samples.read_coupling_samples(tmp_path)
    found, _ = tables()
    wrong = found["features"].copy()
    wrong[3, 15] += 0.5
    for changes, message in (
        ({"target": found["target"][:-1]}, r"Ct_target_obs_avoid\.txt: has 11 rows, .*X_raw.* has 12"),
        ({"features": wrong}, r"X_raw_obs_avoid\.txt: row 3: distance to the centre"),
        (
            {"modulation": found["modulation"] + np.eye(ROWS, 25)},
            r"PSI_mult_phase_V_obs_avoid\.txt: row \d+: no time of a movement",
        ),
    ):
        write(tmp_path, found | changes)
        with pytest.raises(InputError, match=message):
            coupling_samples.read_coupling_samples(tmp_path)


def phase_dependent(count=120, seed=0):
    """Linear in the features, but for a factor that only the phase tells."""
    rng = np.random.default_rng(seed)
    time = rng.uniform(0.0, 1.0, count)
    p, u = canonical.phase(time, canonical.TAU_PER_DURATION)
    features = rng.normal(size=(count, 17))
    target = features[:, :3] * u[:, None] + 0.05 * rng.normal(size=(count, 3))
    return AvoidanceDataset(features, target, p, u, np.zeros(count, int), np.arange(count), time)


def test_representations_are_compared_on_the_same_held_out_samples():
    dataset, key = phase_dependent(), "obstacle_training.per_setting"
    network = committed(NetworkParameters, key, hidden=(6,), members=2, training={"iterations": 12})
    pmnn = committed(TrainingParameters, "compare_models", steps=60, dropout=0.0, evaluate_every=30)
    its = {"folds": 2, "network": network, "pmnn": pmnn, "pmnn_hidden": (8,)}
    parameters = committed(RepresentationParameters, "defaults.obstacles.representations", **its)
    with pytest.raises(InputError, match="too few for 2 folds"):
        coupling_representations.compare_representations(phase_dependent(3), parameters)
    results = coupling_representations.compare_representations(dataset, parameters)
    scores = results["scores"].set_index(KEYS)
    assert list(scores.index.droplevel("axis").unique()) == list(coupling_representations.REPRESENTATIONS)
    # the pooled error is the mean over folds of the share of each, and ridge regression can be redone by hand
    found = scores.loc[("ridge", "features", "y"), "nmse"]
    assert results["folds"].groupby(KEYS)["nmse"].mean()["ridge", "features", "y"] == pytest.approx(found)
    squared, target = 0.0, dataset.target[:, 1]
    for block in np.array_split(np.arange(120), 2):
        rest = np.setdiff1d(np.arange(120), block)
        seen = dataset.features[rest]
        design, offset = (dataset.features - seen.mean(axis=0)) / seen.std(axis=0), target[rest].mean()
        normal = design[rest].T @ design[rest] + np.eye(17)
        weights = np.linalg.solve(normal, design[rest].T @ (target[rest] - offset))
        squared += np.square(design[block] @ weights + offset - target[block]).sum()
    assert found == pytest.approx(squared / (120 * target.var()))
    worth = results["phase_worth"].set_index(KEYS)
    assert worth.loc[("ensemble", "phase_velocity", "y"), "gain"] > 0.0


def made_up_scores():
    """Tables in which every claim holds."""
    ranks = {"human_inspired": 4, "network_validation": 3, "ridge": 3}
    ranks |= {"network": 2, "pmnn": 1, "ensemble": -4}

    def error(name, inputs):
        return 0.6 + 0.1 * ranks[name] + (0 if inputs == "phase" else 0.05)

    folds = [
        (name, inputs, axis, fold, error(name, inputs) + noise)
        for name, inputs in coupling_representations.REPRESENTATIONS
        for axis in "xyz"
        for fold, noise in enumerate(0.002 * np.array([-1.0, 0.5, 0.0, -0.5, 1.0]))
    ]
    folds = pd.DataFrame(folds, columns=[*KEYS, "fold", "nmse"]).assign(samples=20)
    scores = folds.groupby(KEYS, sort=False)["nmse"].mean().reset_index().assign(train=0.05)
    worth = scores[(scores["inputs"] != "features") & (scores["representation"] != "pmnn")][KEYS]
    return {"folds": folds, "scores": scores, "phase_worth": worth.assign(gain=0.1, half_width=0.02)}


def test_claims_follow_the_tables(root):
    kinds = [dict.fromkeys(pair) for pair in zip(*coupling_representations.REPRESENTATIONS, strict=True)]
    assert [set(REPRESENTATIONS), set(INPUTS)] == [set(names) for names in kinds]  # they stand as text there
    claims = read_claims(root / "stages/tasks/claims/avoidance.yaml")
    find = representation_findings(made_up_scores())
    words = [claim.verdict(one, case) for claim in claims for case, one in find[claim.evidence].items()]
    assert set(words) == {"yes"}
    best = made_up_scores()["scores"].set_index(KEYS)["nmse"]
    assert find["nmse_x"].value == best["ensemble", "phase", "x"]
    assert representation_facts(made_up_scores())["best"]["name"] == "ensemble of networks"


def test_the_recorded_samples():
    dataset = coupling_samples.read_coupling_samples(recorded_data("clmc"))
    assert len(dataset) == 823
    _, u = canonical.phase(dataset.time, canonical.time_constant(1.0))
    np.testing.assert_allclose(dataset.phase_velocity, u, atol=0.07)  # two ways to the same phase
    # a phase that were not the samples' own would not tell the speed along the reach
    correlation = np.corrcoef(dataset.features[:, 12], np.sin(np.pi * np.clip(dataset.time, 0.0, 1.0)))[0, 1]
    assert correlation > 0.5
