import numpy as np
import pytest
from committed import committed
from rigid_body_motions import arm, rubbing_motion, sine_motion
from rigid_body_robots import carrying

from structlearn.rigid_body import compiled_dynamics
from structlearn.rigid_body.model_learning import LearningParameters
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.online_learning import (
    OnlineParameters,
    PayloadLearningParameters,
    follow_payload,
    learn_once_through,
)
from structlearn.rigid_body.seeded_training import (
    PLAIN,
    SCHEDULED,
    DynamicsTrainingParameters,
    EpochLimits,
    train,
    trainings,
)
from structlearn.simulation.arm import Payload

PARAMETERS = committed(
    DynamicsTrainingParameters,
    "train_dynamics",
    models=("mlp", "delan", "cov"),
    seeds=2,
    epochs=EpochLimits(raw=2, normalised=2, robot=2),
    learning=committed(LearningParameters, "train_dynamics.learning", hidden=(6, 6), threshold=1e-9),
)


@pytest.fixture(autouse=True)
def _one_process(monkeypatch):
    monkeypatch.setenv("STRUCTLEARN_BACKEND", "sequential")


def test_all_models_of_two_motions_are_trained_and_tabulated():
    work = trainings("iiwa", ("none",), PARAMETERS.epochs.by_loss, PARAMETERS)
    work += trainings("robot", ("viscous", "coulomb"), PARAMETERS.epochs.by_loss, PARAMETERS)
    motions = {"iiwa": sine_motion(arm(), 200), "robot": rubbing_motion(arm())}
    models, errors, outcomes = train(work, motions, arm().tree, PARAMETERS)
    kinds = [f"iiwa/{{}}/{kind}" for kind in ("mlp", "delan", "cov")]
    kinds += [f"robot/{{}}/{kind}" for kind in ("mlp", "delan", "delan_coulomb", "cov", "cov_coulomb")]
    assert set(models) == {kind.format(loss) for kind in kinds for loss in ("raw", "normalised")}
    for name, learned in models.items():
        expected = 0 if "mlp" in name or name.startswith("iiwa") else 2 if "coulomb" in name else 1
        assert learned.friction_coefficients().shape == (2, 7, expected)
    keys = ["data", "model", "friction", "loss", "optimiser", "seed"]
    assert len(errors) == len(outcomes) * 7 * 3  # joints, and epochs with the start
    assert not outcomes.duplicated(keys).any()
    assert set(outcomes["optimiser"]) == {SCHEDULED, PLAIN}
    last = errors[errors["epoch"] == 2].groupby(keys)["nmse"].max()
    np.testing.assert_allclose(outcomes.set_index(keys)["nmse_max"].sort_index(), last.sort_index())


def test_epochs_are_counted_to_the_first_at_which_all_joints_are_good_enough():
    """Every training ends at its own limit; what it says of a model is that of the epoch that was kept."""
    learning = committed(LearningParameters, "train_dynamics.learning", hidden=(6, 6), threshold=700.0)
    limits = EpochLimits(raw=4, normalised=3, robot=2)
    changes = {"models": ("mlp", "cov"), "epochs": limits, "learning": learning}
    parameters = PARAMETERS.model_copy(update=changes)
    work = trainings("iiwa", ("none",), limits.by_loss, parameters)
    _, errors, outcomes = train(work, {"iiwa": sine_motion(arm(), 400)}, arm().tree, parameters)
    assert {(each.loss, each.epochs) for each in work} == {("raw", 4), ("normalised", 3)}
    keys = ["model", "loss", "optimiser", "seed"]
    reached = 0
    for key, its in errors.groupby(keys):
        by_epoch = its.pivot(index="epoch", columns="joint", values="nmse")
        limit = limits.by_loss[key[1]]
        (outcome,) = outcomes[(outcomes[keys] == list(key)).all(axis=1)].itertuples()
        good, but_last = (
            table.index[(table <= learning.threshold).all(axis=1) & (table.index > 0)]
            for table in (by_epoch, by_epoch.iloc[:, :-1])
        )
        for found, epochs in ((outcome.epochs, good), (outcome.epochs_but_last, but_last)):
            assert found == epochs[0] if len(epochs) else np.isnan(found)
        kept = by_epoch.loc[good[0] if len(good) else limit]
        assert outcome.nmse_mean == pytest.approx(kept.mean())
        assert outcome.nmse_max == pytest.approx(kept.max())
        assert len(good) or by_epoch.index.max() == limit
        reached += len(good) > 0
    assert 0 < reached < len(outcomes)


def test_online_learning_sees_every_batch_once():
    motion = sine_motion(arm())
    parameters = committed(
        OnlineParameters, "online", models=("mlp_scaled", "cov"), seeds=2, losses=("normalised",)
    )
    table = learn_once_through(arm().tree, motion, parameters)
    batches = -(-len(motion) // 256)
    for kind in ("mlp_scaled", "cov"):
        assert table[table["model"] == kind]["batch"].max() == batches
    assert len(table) == 2 * 2 * 7 * (batches + 1)
    cov = table[table["model"] == "cov"].groupby("batch")["nmse"].mean()
    assert cov.iloc[-1] < 0.5 * cov.iloc[0]


def test_a_payload_is_found_after_it_was_picked_up():
    empty, point, mass = arm(), (0.02, -0.01, 0.1), 1.5
    motion = sine_motion(empty)
    half = len(motion) // 2
    states = motion.q, motion.qd, motion.qdd
    loaded = compiled_dynamics.inverse_dynamics(empty.tree, carrying(empty, Payload(mass, point, 1e-3)))
    late = [loaded(*state) for state in zip(*(values[half:] for values in states), strict=True)]
    followed = Motion(*states, np.vstack([motion.torque[:half], late]))
    parameters = committed(PayloadLearningParameters, "online.payload", batch=50, memory_s=0.5)
    table = follow_payload(empty.tree, empty.inertias, followed, 0.02, parameters)
    before, after = table[table["time_s"] <= half * 0.02], table.iloc[-1]
    np.testing.assert_allclose(before["mass_kg"], 0.0, atol=0.02)
    assert after["mass_kg"] == pytest.approx(mass, rel=0.05)
    found = after[["moment_x_kg_m", "moment_y_kg_m", "moment_z_kg_m"]].to_numpy(float)
    np.testing.assert_allclose(found, mass * np.array(point), atol=0.01)
    assert after["nmse_learned"] < 0.01 * after["nmse_fixed"]
