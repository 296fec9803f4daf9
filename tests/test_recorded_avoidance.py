"""The recorded samples: reader and protocol on made-up files, and on the real ones where they are at hand."""

import numpy as np
import pytest
from committed import committed
from readers_bags import recorded_data

from structlearn.avoidance.avoidance_dataset import AvoidanceDataset
from structlearn.avoidance.network_training import NetworkParameters
from structlearn.core.errors import InputError
from structlearn.feedback.coupling_model import TrainingParameters
from structlearn.primitives import canonical, kernels
from structlearn.tasks.public.protocol import avoidance_representations, avoidance_samples
from structlearn.tasks.public.protocol.avoidance_representations import RecordedAvoidanceParameters

ROWS = 12


def tables(rows=ROWS, seed=0):
    rng = np.random.default_rng(seed)
    features = rng.normal(size=(rows, 17))
    features[:, 15] = np.linalg.norm(features[:, :3], axis=1)
    time = np.linspace(0.0, 1.0, rows)
    p, u = canonical.phase(time, canonical.TAU_PER_DURATION)
    modulation = kernels.features(p, u)
    return {"features": features, "target": rng.normal(size=(rows, 3)), "modulation": modulation}, time


def write(folder, found):
    for name, path in avoidance_samples.sample_files(folder).items():
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savetxt(path, found[name])


def test_samples_and_their_phase_are_read(tmp_path):
    found, time = tables()
    write(tmp_path, found)
    dataset = avoidance_samples.read_avoidance_samples(tmp_path)
    np.testing.assert_array_equal(dataset.features, found["features"])
    np.testing.assert_array_equal(dataset.target, found["target"])
    p, u = canonical.phase(time, canonical.TAU_PER_DURATION)
    np.testing.assert_allclose(dataset.time, time, atol=2e-4)
    np.testing.assert_allclose(dataset.phase, p, atol=1e-3)
    np.testing.assert_allclose(dataset.phase_velocity, u, atol=1e-12)
    assert len(np.unique(dataset.demonstration)) == ROWS
    provenance = avoidance_samples.avoidance_provenance(tmp_path)
    assert provenance["origin"] == "recorded"
    assert len(provenance["sha256"].split()) == 3


def test_faults_name_the_file(tmp_path):
    with pytest.raises(InputError, match="holds no samples of obstacle avoidance"):
        avoidance_samples.read_avoidance_samples(tmp_path)
    found, _ = tables()
    write(tmp_path, found | {"target": found["target"][:-1]})
    with pytest.raises(InputError, match=r"Ct_target_obs_avoid\.txt: has 11 rows, .*X_raw.* has 12"):
        avoidance_samples.read_avoidance_samples(tmp_path)
    wrong = found["features"].copy()
    wrong[3, 15] += 0.5
    write(tmp_path, found | {"features": wrong})
    with pytest.raises(InputError, match=r"X_raw_obs_avoid\.txt: row 3: distance to the centre"):
        avoidance_samples.read_avoidance_samples(tmp_path)
    write(tmp_path, found | {"modulation": found["modulation"] + np.eye(ROWS, 25)})
    with pytest.raises(InputError, match=r"PSI_mult_phase_V_obs_avoid\.txt: row \d+: no time of a movement"):
        avoidance_samples.read_avoidance_samples(tmp_path)


def phase_dependent(count=120, seed=0):
    """Linear in the features, but for a factor that only the phase tells."""
    rng = np.random.default_rng(seed)
    time = rng.uniform(0.0, 1.0, count)
    p, u = canonical.phase(time, canonical.TAU_PER_DURATION)
    features = rng.normal(size=(count, 17))
    target = features[:, :3] * u[:, None] + 0.05 * rng.normal(size=(count, 3))
    return AvoidanceDataset(features, target, p, u, np.zeros(count, int), np.arange(count), time)


def test_representations_are_compared_on_the_same_held_out_samples():
    dataset = phase_dependent()
    parameters = committed(
        RecordedAvoidanceParameters,
        "recorded_avoidance",
        folds=2,
        network=committed(
            NetworkParameters,
            "obstacle_training.per_setting",
            hidden=(6,),
            members=2,
            training={"iterations": 12},
        ),
        pmnn=committed(TrainingParameters, "compare_models", steps=60, dropout=0.0, evaluate_every=30),
        pmnn_hidden=(8,),
    )
    results = avoidance_representations.compare_on_recorded(dataset, parameters)
    pairs = list(dict.fromkeys(zip(results.scores["representation"], results.scores["inputs"], strict=True)))
    assert pairs == list(avoidance_representations.REPRESENTATIONS)
    scores = results.scores.set_index(["representation", "inputs", "axis"])
    # the pooled error is the mean over folds of the share of each, and ridge regression can be redone by hand
    folds = results.folds.groupby(["representation", "inputs", "axis"])["nmse"].mean()
    np.testing.assert_allclose(
        folds.loc["ridge", "features", "y"], scores.loc[("ridge", "features", "y"), "nmse"]
    )
    squared = 0.0
    for block in np.array_split(np.arange(120), 2):
        rest = np.setdiff1d(np.arange(120), block)
        mean, std = dataset.features[rest].mean(axis=0), dataset.features[rest].std(axis=0)
        design = (dataset.features - mean) / std
        offset = dataset.target[rest, 1].mean()
        normal = design[rest].T @ design[rest] + np.eye(17)
        weights = np.linalg.solve(normal, design[rest].T @ (dataset.target[rest, 1] - offset))
        squared += np.square(design[block] @ weights + offset - dataset.target[block, 1]).sum()
    expected = squared / (120 * dataset.target[:, 1].var())
    assert scores.loc[("ridge", "features", "y"), "nmse"] == pytest.approx(expected)
    worth = results.phase_worth.set_index(["representation", "inputs", "axis"])
    assert worth.loc[("ensemble", "phase_velocity", "y"), "gain"] > 0.0


def test_too_few_samples_for_the_folds():
    with pytest.raises(InputError, match="too few for 10 folds"):
        avoidance_representations.compare_on_recorded(
            phase_dependent(15),
            committed(RecordedAvoidanceParameters, "recorded_avoidance"),
        )


def test_the_recorded_samples():
    dataset = avoidance_samples.read_avoidance_samples(recorded_data("clmc"))
    assert len(dataset) == 823
    _, u = canonical.phase(dataset.time, canonical.time_constant(1.0))
    np.testing.assert_allclose(dataset.phase_velocity, u, atol=0.07)  # two ways to the same phase
    # a phase that were not the samples' own would not tell the speed along the reach
    correlation = np.corrcoef(dataset.features[:, 12], np.sin(np.pi * np.clip(dataset.time, 0.0, 1.0)))[0, 1]
    assert correlation > 0.5
