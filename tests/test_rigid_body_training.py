import numpy as np
import pinocchio
import pytest
from committed import committed
from rigid_body_motions import arm, rubbing_motion, sine_motion
from rigid_body_robots import pinocchio_torques

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
from structlearn.rigid_body.tree import LinkInertias, Robot

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
    assert sorted(models) == sorted(
        f"{place}/{loss}/{kind}"
        for loss in ("raw", "normalised")
        for place, kinds in (
            ("iiwa", ("mlp", "delan", "cov")),
            ("robot", ("mlp", "delan", "delan_coulomb", "cov", "cov_coulomb")),
        )
        for kind in kinds
    )
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
    parameters = PARAMETERS.model_copy(
        update={"models": ("mlp", "cov"), "epochs": limits, "learning": learning}
    )
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
        OnlineParameters, "online", models=("mlp_scaled", "cov"), seeds=2, losses=("normalised",), stride=3
    )
    table = learn_once_through(arm().tree, motion, parameters)
    batches = -(-len(motion) // 256)
    for kind in ("mlp_scaled", "cov"):
        assert table[table["model"] == kind]["batch"].max() == batches
    assert len(table) == 2 * 2 * 7 * (batches + 1)
    cov = table[table["model"] == "cov"].groupby("batch")["nmse"].mean()
    assert cov.iloc[-1] < 0.5 * cov.iloc[0]


def test_a_payload_is_found_after_it_was_picked_up():
    empty = arm()
    point, mass = np.array([0.02, -0.01, 0.1]), 1.5
    true = empty.inertias
    loaded = LinkInertias(true.mass.copy(), true.first_moment.copy(), true.inertia.copy())
    loaded.mass[-1] += mass
    loaded.first_moment[-1] += mass * point
    model = empty.model.copy()
    link = model.inertias[7]
    motion = sine_motion(empty)
    half = len(motion) // 2
    model.inertias[7] = link + pinocchio.Inertia(mass, point, 1e-3 * np.eye(3))
    carrying = Robot(empty.name, empty.tree, loaded, model)
    states = motion.q, motion.qd, motion.qdd
    torque = motion.torque.copy()
    torque[half:] = pinocchio_torques(carrying, *states)[half:]
    table = follow_payload(
        empty.tree,
        true,
        Motion(*states, torque),
        0.02,
        committed(PayloadLearningParameters, "online.payload", batch=50, memory_s=0.5),
    )
    before, after = table[table["time_s"] <= half * 0.02], table.iloc[-1]
    np.testing.assert_allclose(before["mass_kg"], 0.0, atol=0.02)
    assert after["mass_kg"] == pytest.approx(mass, rel=0.05)
    found = after[["moment_x_kg_m", "moment_y_kg_m", "moment_z_kg_m"]].to_numpy(float)
    np.testing.assert_allclose(found, mass * point, atol=0.01)
    assert after["nmse_learned"] < 0.01 * after["nmse_fixed"]
