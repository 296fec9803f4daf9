from itertools import product

import numpy as np
import pytest
from committed import committed
from rigid_body_motions import arm, rubbing_motion, sine_motion
from rigid_body_robots import carrying

from structlearn.rigid_body import compiled_dynamics
from structlearn.rigid_body.dynamics_training import LearningParameters
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.payload import PayloadLearningParameters, follow_payload, learn_payload
from structlearn.simulation.arm import Payload
from structlearn.testbeds.dynamics.protocol.trainings import (
    OURS,
    TEXT,
    DynamicsTrainingParameters,
    EpochLimits,
    OnlineParameters,
    learn_once_through,
    scores,
    train,
    trainings,
)

PARAMETERS = committed(
    DynamicsTrainingParameters,
    "train_dynamics",
    models=("mlp", "mlp_scaled", "delan", "cov"),
    seeds=(3, 5),
    epochs=EpochLimits(simulation=4, robot=1),
    learning=committed(LearningParameters, "train_dynamics.learning", hidden=(6, 6), threshold=700.0),
)
ROBOTS = (11, 12)
MOTIONS = ("iiwa", *(f"stand_in/{robot}" for robot in ROBOTS))


@pytest.fixture(scope="module")
def trained():
    """Models, errors and outcomes of which some meet the criterion in simulation."""
    rubbing = rubbing_motion(arm())
    logs = sine_motion(arm(), 400), *(rubbing.part(slice(0, 300 + robot)) for robot in ROBOTS)
    motions = dict(zip(MOTIONS, logs, strict=True))
    return train(trainings(ROBOTS, PARAMETERS), motions, arm().tree, PARAMETERS)


def test_all_models_of_an_arm_and_its_robots_are_trained_and_tabulated(trained):
    models, errors, outcomes = trained
    ours = ("mlp", "mlp_scaled", "delan", "cov")
    text = ("mlp", "delan", "cov")  # the scaled perceptron is no model of the text
    forms = [*product((TEXT,), text), *product((OURS,), ours)]
    expected = {f"{motion}/{form}/{kind}" for motion, (form, kind) in product(MOTIONS, forms)}
    expected |= {f"stand_in/{robot}/{form}/cov_coulomb" for robot in ROBOTS for form in (TEXT, OURS)}
    assert set(models) == expected
    for name, learned in models.items():
        terms = 0 if "mlp" in name or name.startswith("iiwa") else 2 if "coulomb" in name else 1
        assert learned.friction_coefficients().shape == (2 if name.startswith("iiwa") else 1, 7, terms)
    keys = ["arm", "model", "form", "seed"]
    assert not outcomes.duplicated(keys).any()
    seeds = outcomes.groupby("arm")["seed"].unique()
    assert set(seeds["iiwa"]) == {3, 5}
    assert set(seeds["stand_in"]) == set(ROBOTS)  # a robot's model has its seed
    last = errors[(errors["epoch"] == 1) & (errors["arm"] == "stand_in")].groupby(keys)["nmse"].max()
    of_robots = outcomes[outcomes["arm"] == "stand_in"].set_index(keys)["nmse_max"]
    np.testing.assert_allclose(of_robots.sort_index(), last.sort_index())


def test_what_may_be_tracked_with_met_the_criterion_of_its_arm():
    """In simulation on every joint; on a robot's log on average, which is asked of networks alone."""
    limits = EpochLimits(simulation=3, robot=3)
    learning = PARAMETERS.learning.model_copy(update={"threshold": 0.3})
    parameters = PARAMETERS.model_copy(update={"epochs": limits, "learning": learning, "forms": (OURS,)})
    motions = {"iiwa": sine_motion(arm(), 600), "stand_in/11": rubbing_motion(arm())}
    _, _, outcomes = train(trainings((11,), parameters), motions, arm().tree, parameters)
    simulated, robots = (outcomes[outcomes["arm"] == name] for name in ("iiwa", "stand_in"))
    np.testing.assert_array_equal(simulated["met"], simulated["epochs"].notna())
    np.testing.assert_array_equal(simulated["met"], simulated["nmse_max"] <= 0.3)
    networks = ~robots["model"].str.startswith("cov")
    np.testing.assert_array_equal(robots["met"], (robots["nmse_mean"] <= 0.3) | ~networks)
    assert 0 < outcomes["met"].sum() < len(outcomes)


def test_epochs_are_counted_to_the_first_at_which_all_joints_are_good_enough(trained):
    """What is said of a model is that of the epoch that was kept; schedules are compared by it."""
    errors, outcomes = (table[table["arm"] == "iiwa"] for table in trained[1:])
    limit, threshold = PARAMETERS.epochs.simulation, PARAMETERS.learning.threshold
    keys, reached = ["model", "form", "seed"], 0
    for key, its in errors.groupby(keys):
        by_epoch = its.pivot(index="epoch", columns="joint", values="nmse")
        (outcome,) = outcomes[(outcomes[keys] == list(key)).all(axis=1)].itertuples()
        good, but_last = (
            table.index[(table <= threshold).all(axis=1) & (table.index > 0)]
            for table in (by_epoch, by_epoch.iloc[:, :-1])
        )
        for found, epochs in ((outcome.epochs, good), (outcome.epochs_but_last, but_last)):
            assert found == epochs[0] if len(epochs) else np.isnan(found)
        kept = by_epoch.loc[good[0] if len(good) else limit]
        assert outcome.nmse_mean == pytest.approx(kept.mean())
        assert outcome.nmse_max == pytest.approx(kept.max())
        reached += len(good) > 0
    assert 0 < reached < len(outcomes)
    compared = scores(outcomes, limit)
    ours = outcomes[(outcomes["form"] == OURS) & (outcomes["model"] == "mlp")]
    assert compared["epochs_mlp"] == ours["epochs"].fillna(limit).mean()
    assert compared["worst_mlp"] == pytest.approx(np.exp(np.log(ours["nmse_max"]).mean()))


def test_online_learning_sees_every_batch_once():
    motion = sine_motion(arm())
    parameters = committed(
        OnlineParameters, "online", models=("mlp_scaled", "cov"), seeds=(4, 7), losses=("normalised",)
    )
    learning = committed(LearningParameters, "train_dynamics.learning")
    table = learn_once_through(arm().tree, motion, parameters, learning)
    assert set(table["seed"]) == {4, 7}
    batches = -(-len(motion) // 256)
    for kind in ("mlp_scaled", "cov"):
        assert table[table["model"] == kind]["batch"].max() == batches
    assert len(table) == 2 * 2 * 7 * (batches + 1)
    cov = table[table["model"] == "cov"].groupby("batch")["nmse"].mean()
    assert cov.iloc[-1] < 0.5 * cov.iloc[0]


def test_an_arm_that_carries_nothing_is_identified_with_its_friction():
    parameters = committed(PayloadLearningParameters, "online.payload", empty_s=20.0)
    table = learn_payload((rubbing_motion(arm()), 0.02), arm().tree, arm().inertias, parameters)
    assert table["nmse_fixed"].max() < 3e-3  # also after the samples it was fitted to
    np.testing.assert_allclose(table["mass_kg"], 0.0, atol=0.05)


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
