from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd
import pytest
import torch
from committed import ROOT, committed
from newton_euler import inverse_dynamics
from rigid_body_robots import COULOMB, VISCOUS, arm, carrying, motion_with_friction, sine_motion

from dissertation.dynamics.protocol import trainings as protocol
from dissertation.dynamics.protocol.training_choice import TABLE, choose, try_trainings
from dissertation.simulation.arm import Payload
from structlearn.core.metrics import nmse
from structlearn.networks.torch_settings import Adam, AdamParameters, seeded
from structlearn.rigid_body import compiled_dynamics
from structlearn.rigid_body import dynamics_training as training
from structlearn.rigid_body.dynamics_models import predicted_torques, rigid_body_torques
from structlearn.rigid_body.friction import friction_coefficients, friction_columns
from structlearn.rigid_body.inertia_parameters import STRUCTURES, link_inertias
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.network_models import SCALING, NetworkLearner
from structlearn.rigid_body.payload import PayloadLearningParameters, follow_payload, identify_empty

PARAMETERS = committed(
    training.LearningParameters,
    "train_dynamics.learning",
    hidden=(8, 8),
    networks=committed(AdamParameters, "train_dynamics.learning.networks", rate=3e-3, batch=16),
    structures=committed(
        AdamParameters, "train_dynamics.learning.networks", rate=0.03, batch=32, second_moment_decay=0.99
    ),
)
FRICTION = ("viscous", "coulomb")


@pytest.fixture(scope="module")
def motion():
    return sine_motion(arm())


def start(kind, motion, seeds=(0, 1), friction=(), loss="raw"):
    return training.learner(
        kind, training.TrainingData(arm().tree, motion, friction), loss, seeds, PARAMETERS
    )


@pytest.mark.parametrize("structure", STRUCTURES)
def test_the_regressor_path_steps_as_autograd_through_the_recursion_does(structure):
    """Also after many steps: the compiled descent is that of torch's Adam on the recursion."""
    motion = motion_with_friction(arm())
    group = start(structure, motion, friction=FRICTION, loss="normalised")
    free = torch.from_numpy(group.free.copy()).requires_grad_()
    friction = torch.from_numpy(group.friction.copy()).requires_grad_()
    weights = torch.from_numpy(training.loss_weights("normalised", motion))
    parameters = PARAMETERS.structures
    adam = torch.optim.Adam([free, friction], parameters.rate, (0.9, parameters.second_moment_decay))
    order = torch.randperm(len(motion), generator=torch.Generator().manual_seed(1))[:-5]
    for batch in order.split(parameters.batch):
        q, qd, qdd, torque = (
            torch.from_numpy(values[batch]) for values in (motion.q, motion.qd, motion.qdd, motion.torque)
        )
        inertias = link_inertias(structure, free)
        torques = inverse_dynamics(arm().tree, inertias, q, qd, qdd)
        columns = torch.from_numpy(friction_columns(motion.q[batch], motion.qd[batch], FRICTION))
        torques = torques + torch.einsum("njt,mjt->mnj", columns, friction_coefficients(friction, FRICTION))
        loss = ((torques - torque).square() * weights).sum(dim=-1).mean(dim=-1).sum()
        adam.zero_grad()
        loss.backward()
        adam.step()

    group.learn(order)
    np.testing.assert_allclose(group.free, free.detach(), rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(group.friction, friction.detach(), rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("kind", training.KINDS)
def test_a_seed_learns_the_same_alone_and_in_a_stack_and_again(kind, motion):
    def learned(seeds):
        models = start(kind, motion, seeds)
        return training.learn_online(models, stride=5), models.state()

    (both, state), (_, again), (second, _) = learned((0, 1)), learned((0, 1)), learned((1,))
    for name, values in state.items():
        np.testing.assert_array_equal(values, again[name])  # the same bytes
    # Adam divides by the root of squares: rounding in sums of another order grows where gradients are tiny
    np.testing.assert_allclose(both[:4, 1], second[:4, 0], rtol=1e-3)
    assert not np.allclose(both[0, 0], both[0, 1])


def test_a_model_is_kept_as_it_was_when_it_became_good_enough(motion):
    group = start("spd", motion, seeds=range(3), loss="normalised")
    learned = training.learn_in_epochs(group, threshold=0.1, epochs=20)
    first = int(learned.epochs.argmin())
    assert learned.epochs.min() < learned.epochs.max()  # the others went on learning
    free = torch.from_numpy(learned.state["inertia"])
    states = (torch.from_numpy(values) for values in (motion.q, motion.qd, motion.qdd))
    torques = inverse_dynamics(arm().tree, link_inertias("spd", free), *states).numpy()
    for model, epoch in enumerate(learned.epochs):
        np.testing.assert_allclose(nmse(torques[model], motion.torque), learned.nmse[epoch, model], rtol=1e-6)
    assert (learned.nmse[: learned.epochs[first], first].max(axis=1) > 0.1).all()


class Scripted:
    """Models whose errors are told beforehand: (E + 1, M, n)."""

    samples = batch = 1

    def __init__(self, errors):
        self.errors, self.models, self.epoch = errors, np.arange(errors.shape[1]), 0

    def learn(self, order):
        self.epoch += 1

    def nmse(self, stride=1):
        return self.errors[self.epoch, self.models]

    def keep(self, models):
        self.models = self.models[models]

    def state(self):
        return {"epoch": np.full(len(self.models), self.epoch)}


def test_a_model_stops_when_no_joint_that_lacks_would_get_there():
    epochs = np.arange(13.0)[:, None]
    fast, slow, met = 0.5**epochs, 0.9**epochs, np.where(epochs < 3, 1.0, 0.01)
    errors = np.stack([np.hstack(pair) for pair in ((fast, met), (slow, met), (slow, fast))], axis=1)
    learned = training.learn_in_epochs(Scripted(errors), threshold=0.1, epochs=12, futility=4)
    # 0.9^12 > 0.1: the second stops when its first joint alone lacks; the third waits for its other joint
    np.testing.assert_array_equal(learned.state["epoch"], [4, 4, 4])
    np.testing.assert_array_equal(learned.epochs, [4, 0, 0])
    patient = training.learn_in_epochs(Scripted(errors), threshold=0.1, epochs=12)
    np.testing.assert_array_equal(patient.state["epoch"], [4, 12, 12])
    np.testing.assert_array_equal(patient.nmse[5:, 0], np.tile(errors[4, 0], (8, 1)))


def test_a_network_is_kept_for_its_errors_on_all_samples(motion):
    parameters = {"threshold": 0.9, "epochs": 30}
    group = start("mlp_scaled", motion, loss="normalised")
    np.testing.assert_allclose(group.nmse(stride=3), group.nmse(), rtol=0.05)
    some = training.learn_in_epochs(group, **parameters, stride=7)
    every = training.learn_in_epochs(start("mlp_scaled", motion, loss="normalised"), **parameters)
    assert (some.epochs > 0).all()
    assert (np.abs(some.epochs - every.epochs) <= 1).all()
    for model, epoch in enumerate(some.epochs):
        np.testing.assert_array_equal(some.nmse[epoch, model], every.nmse[epoch, model])


@pytest.mark.parametrize(
    ("kind", "friction"), [("mlp_scaled", ()), ("delan", ()), ("delan", ("coulomb", "offset"))]
)
def test_a_step_of_networks_goes_down_the_slope_of_the_loss(kind, friction, motion):
    """The gradient against finite differences of the loss that `nmse` measures, in double precision."""
    group = start(kind, motion.part(slice(0, 40)), friction=friction, loss="normalised")
    in_double(group)
    slopes = []
    group.optimiser.step = lambda gradients: slopes.extend(
        torch.zeros_like(values) if gradient is None else gradient
        for values, gradient in zip(group.parameters, gradients, strict=True)
    )
    group.batch = 40
    group.learn(torch.arange(40))
    generator = torch.Generator().manual_seed(3)
    for values, slope in zip(group.parameters, slopes, strict=True):
        direction = torch.randn(values.shape, dtype=torch.float64, generator=generator)
        losses = []
        for step in (1e-6, -2e-6):
            values.data += step * direction
            losses.append(group.nmse().sum(axis=1))
        values.data += 1e-6 * direction
        found = (slope * direction).flatten(1).sum(dim=1)
        np.testing.assert_allclose(found, (losses[0] - losses[1]) / 2e-6, rtol=1e-6, atol=1e-6)


def in_double(group):
    """Let networks learn in double precision."""
    for values in group.parameters:
        values.data = values.data.double()
    for name in ("states", "torque", "columns", "weights"):
        setattr(group, name, getattr(group, name).double())
    network = group.network
    fields = ("row", "column") if hasattr(network, "row") else SCALING
    group.network = replace(network, **{name: getattr(network, name).double() for name in fields})


def test_steps_are_those_of_torch_also_where_gradients_have_strides_or_are_missing():
    generator = seeded(0)
    start = [torch.randn(3, 5, 4, generator=generator) for _ in range(3)]
    own, theirs = ([values.clone() for values in start] for _ in range(2))
    small, torchs = Adam(own, 0.01, 0.99), torch.optim.Adam(theirs, 0.01, (0.9, 0.99), fused=True)
    kept = torch.tensor([True, False, True])
    for step in range(6):
        gradients = [torch.randn(len(own[0]), 4, 5, generator=generator).mT for _ in range(2)]
        if step == 3:
            small.keep(kept)
            for values in theirs[:2]:
                values.data, moments = values.data[kept], torchs.state[values]
                moments.update({name: moments[name][kept] for name in ("exp_avg", "exp_avg_sq")})
            gradients = [values[kept] for values in gradients]
        small.step([*gradients, None])
        for values, gradient in zip(theirs, gradients, strict=False):
            values.grad = gradient.contiguous()
        torchs.step()
    for ours, expected in zip(own[:2], theirs[:2], strict=True):
        torch.testing.assert_close(ours, expected, rtol=0.0, atol=0.0)
    torch.testing.assert_close(own[2], start[2][kept], rtol=0.0, atol=0.0)  # it had no gradient


def test_networks_of_several_motions_learn_as_each_alone():
    motions = [sine_motion(arm(), 300), motion_with_friction(arm()).part(slice(0, 300))]
    weights = np.stack([training.loss_weights("normalised", its) for its in motions])

    def learned(chosen):
        own, seeds = [motions[place] for place in chosen], [seeded(place) for place in chosen]
        networks = PARAMETERS.networks, (8, 8), seeds
        group = NetworkLearner("delan", own, ("viscous",), weights[chosen], *networks)
        return training.learn_in_epochs(group, threshold=0.0, epochs=2)

    both = learned([0, 1])
    for place in (0, 1):
        alone, part = learned([place]), both.part(place)
        np.testing.assert_allclose(part.nmse, alone.nmse, rtol=1e-3)
        assert part.state.keys() == alone.state.keys()
        for name, values in part.state.items():
            np.testing.assert_allclose(values, alone.state[name], rtol=1e-2, atol=1e-4)


def test_the_raw_loss_weighs_all_joints_alike_and_the_other_by_their_variance(motion):
    np.testing.assert_array_equal(training.loss_weights("raw", motion), 1.0)
    np.testing.assert_allclose(training.loss_weights("normalised", motion) * motion.torque.var(axis=0), 1.0)


TRAININGS = committed(
    protocol.DynamicsTrainingParameters,
    "train_dynamics",
    models=("mlp", "mlp_scaled", "delan", "cov"),
    seeds=(3, 5),
    epochs=protocol.EpochLimits(simulation=4, robot=1),
    learning=committed(
        training.LearningParameters, "train_dynamics.learning", hidden=(6, 6), threshold=700.0
    ),
)
ROBOTS = (11, 12)
MOTIONS = ("iiwa", *(f"perturbed/{robot}" for robot in ROBOTS))


@pytest.fixture(scope="module")
def trained():
    """Models, errors and outcomes of which some meet the criterion in simulation."""
    friction = motion_with_friction(arm())
    logs = sine_motion(arm(), 400), *(friction.part(slice(0, 300 + robot)) for robot in ROBOTS)
    motions = dict(zip(MOTIONS, logs, strict=True))
    return protocol.train_all(protocol.trainings(ROBOTS, TRAININGS), motions, arm().tree, TRAININGS)


def test_all_models_of_an_arm_and_its_robots_are_trained_and_tabulated(trained):
    models, errors, outcomes = trained
    chosen = ("mlp", "mlp_scaled", "delan", "cov")
    plain = ("mlp", "delan", "cov")  # the scaled perceptron has no plain form
    forms = [*product((protocol.PLAIN,), plain), *product((protocol.CHOSEN,), chosen)]
    expected = {f"{motion}/{form}/{kind}" for motion, (form, kind) in product(MOTIONS, forms)}
    expected |= {f"part/chosen/{kind}" for kind in chosen}
    expected |= {f"perturbed/{robot}/{form}/cov_coulomb" for robot in ROBOTS for form in protocol.FORMS}
    assert set(models) == expected
    for name, learned in models.items():
        simulated = name.startswith(("iiwa", "part"))
        terms = 0 if "mlp" in name or simulated else 2 if "coulomb" in name else 1
        assert learned.friction_coefficients().shape == (2 if simulated else 1, 7, terms)
    keys = ["arm", "model", "form", "seed"]
    assert not outcomes.duplicated(keys).any()
    seeds = outcomes.groupby("arm")["seed"].unique()
    assert set(seeds["iiwa"]) == {3, 5}
    assert set(seeds["perturbed"]) == set(ROBOTS)  # a robot's model has its seed
    last = errors[(errors["epoch"] == 1) & (errors["arm"] == "perturbed")].groupby(keys)["nmse"].max()
    of_robots = outcomes[outcomes["arm"] == "perturbed"].set_index(keys)["nmse_max"]
    np.testing.assert_allclose(of_robots.sort_index(), last.sort_index())


def test_what_may_be_tracked_with_met_the_criterion_of_its_arm():
    """In simulation on every joint; on a robot's log on average, which is asked of networks alone."""
    limits = protocol.EpochLimits(simulation=3, robot=3)
    learning = TRAININGS.learning.model_copy(update={"threshold": 0.3})
    parameters = TRAININGS.model_copy(update={"epochs": limits, "learning": learning})
    motions = {"iiwa": sine_motion(arm(), 600), "perturbed/11": motion_with_friction(arm())}
    _, _, outcomes = protocol.train_all(
        protocol.trainings((11,), parameters), motions, arm().tree, parameters
    )
    simulated, robots = (outcomes[outcomes["arm"] == name] for name in ("iiwa", "perturbed"))
    np.testing.assert_array_equal(simulated["met"], simulated["epochs"].notna())
    np.testing.assert_array_equal(simulated["met"], simulated["nmse_max"] <= 0.3)
    networks = ~robots["model"].str.startswith("cov")
    np.testing.assert_array_equal(robots["met"], (robots["nmse_mean"] <= 0.3) | ~networks)
    assert 0 < outcomes["met"].sum() < len(outcomes)


def test_epochs_are_counted_to_the_first_at_which_all_joints_are_good_enough(trained):
    """What is said of a model is that of the epoch that was kept; schedules are compared by it."""
    errors, outcomes = (table[table["arm"] == "iiwa"] for table in trained[1:])
    limit, threshold = TRAININGS.epochs.simulation, TRAININGS.learning.threshold
    keys, reached = ["model", "form", "seed"], 0
    for key, its in errors.groupby(keys):
        by_epoch = its.pivot_table("nmse", "epoch", "joint")
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


def test_a_model_of_a_part_is_scored_on_the_whole_motion(trained):
    models, _, outcomes = trained
    its = outcomes[(outcomes["arm"] == "part") & (outcomes["model"] == "cov")]
    motion = sine_motion(arm(), 400).part(slice(None, None, TRAININGS.stride))
    torques = predicted_torques(models["part/chosen/cov"], arm().tree, motion)
    np.testing.assert_allclose(its["nmse_mean"], [nmse(one, motion.torque).mean() for one in torques])


def test_the_choice_is_that_of_the_table_in_git():
    """Among all that were tried, with seeds and a motion that nothing is judged on."""
    table, parameters = (
        pd.read_csv(ROOT / TABLE),
        committed(protocol.DynamicsTrainingParameters, "train_dynamics"),
    )
    assert choose(table) == parameters.chosen
    assert not {*table["seed"]} & {*parameters.seeds}


def test_the_fewest_epochs_are_chosen_and_of_equal_ones_the_lowest_error():
    columns = ["model", "loss", "batch", "rate", "seed", "epochs", "nmse_max"]
    rows = [("cov", "raw", 64, 0.01, 1, np.nan, 0.5), ("cov", "normalised", 64, 0.01, 1, 3.0, 0.09)]
    rows += [("cov", "normalised", 64, 0.03, 1, 3.0, 0.02), ("cov", "normalised", 256, 0.03, 1, 4.0, 0.01)]
    chosen = choose(pd.DataFrame(rows, columns=columns))["cov"]
    assert (chosen.loss, chosen.batch, chosen.rate) == ("normalised", 64, 0.03)
    motion = sine_motion(arm(), 200)
    tried = try_trainings(["cov"], training.TrainingData(arm().tree, motion), TRAININGS.learning, 2)
    assert len(tried) == 2 * 2 * 3 * 3
    assert (tried["epochs"].isna() == (tried["nmse_max"] > TRAININGS.learning.threshold)).all()


def test_online_learning_sees_every_batch_once():
    motion = sine_motion(arm())
    parameters = committed(
        protocol.OnlineParameters,
        "online",
        models=("mlp_scaled", "cov"),
        seeds=(4, 7),
        losses=("normalised",),
    )
    learning = committed(training.LearningParameters, "train_dynamics.learning")
    table = protocol.learn_once_through(arm().tree, motion, parameters, learning)
    assert set(table["seed"]) == {4, 7}
    batches = -(-len(motion) // 256)
    for kind in ("mlp_scaled", "cov"):
        assert table[table["model"] == kind]["batch"].max() == batches
    assert len(table) == 2 * 2 * 7 * (batches + 1)
    cov = table[table["model"] == "cov"].groupby("batch")["nmse"].mean()
    assert cov.iloc[-1] < 0.5 * cov.iloc[0]


def test_an_empty_robot_is_identified_with_its_friction():
    motion = motion_with_friction(arm())
    parameters = committed(PayloadLearningParameters, "online.payload", empty_s=20.0)
    links, friction = identify_empty(arm().tree, arm().inertias, motion, 0.02, parameters)
    expected = friction_columns(motion.q, motion.qd, ("viscous", "coulomb")) @ [VISCOUS, COULOMB]
    np.testing.assert_allclose(friction, expected, atol=0.1)
    torques = rigid_body_torques(arm().tree, links, motion) + friction
    assert nmse(torques, motion.torque).max() < 1e-3  # also of what came after


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


def test_after_the_memory_a_sample_has_half_its_weight():
    """The same moves empty and then loaded, one batch each: the load is found to 1 / (1 + 1/2)."""
    empty, mass = arm(), 1.5
    moves = sine_motion(empty).part(slice(0, 100))
    states = moves.q, moves.qd, moves.qdd
    loaded = rigid_body_torques(empty.tree, carrying(empty, Payload(mass, (0.02, -0.01, 0.1), 1e-3)), moves)
    without = rigid_body_torques(empty.tree, empty.inertias, moves)
    followed = Motion(*(np.vstack([values, values]) for values in states), np.vstack([without, loaded]))
    options = {"batch": 100, "memory_s": 100 * 0.02, "empty_s": 100 * 0.02}
    parameters = committed(PayloadLearningParameters, "online.payload", **options)
    table = follow_payload(empty.tree, empty.inertias, followed, 0.02, parameters)
    np.testing.assert_allclose(table["mass_kg"], [0.0, mass / 1.5], atol=0.01)


def test_errors_are_relative_to_the_variance_of_the_whole_motion():
    """Also where the beginning, whose variance weights the joints, is far quieter."""
    empty = arm()
    motion = sine_motion(empty)
    louder = np.linspace(0.2, 1.0, len(motion))[:, None]
    states = motion.q, motion.qd * louder, motion.qdd * louder
    true = carrying(empty, Payload(1.5, (0.02, -0.01, 0.1), 1e-3))
    torques = rigid_body_torques(empty.tree, true, Motion(*states, motion.torque))
    followed = Motion(*states, torques)
    parameters = committed(PayloadLearningParameters, "online.payload", batch=50, empty_s=2.0)
    table = follow_payload(empty.tree, empty.inertias, followed, 0.02, parameters)
    off = (rigid_body_torques(empty.tree, empty.inertias, followed) - torques) ** 2 / torques.var(axis=0)
    expected = [off[start : start + 50].mean() for start in range(0, len(motion), 50)]
    np.testing.assert_allclose(table["nmse_fixed"], expected, rtol=1e-8)
