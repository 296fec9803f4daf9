"""The page of the dynamics testbed, on made-up results."""

from dataclasses import replace

import numpy as np
import pytest
import reporting_verdicts
from committed import committed
from dynamics_tables import SEEDS, dynamics_results, iiwa, payload_table

from structlearn.reporting.document import render, words_in_view
from structlearn.reporting.publishing import HEADLINES
from structlearn.rigid_body.agreement import agreement_with_pinocchio
from structlearn.rigid_body.inertia_parameters import free_parameters
from structlearn.rigid_body.model_files import DynamicsModels
from structlearn.rigid_body.model_names import DEFAULT, GROUND_TRUTH, NAMES
from structlearn.rigid_body.motion import Motion
from structlearn.testbeds.dynamics import page
from structlearn.testbeds.dynamics.names import IDEAL, ROBOT
from structlearn.testbeds.dynamics.page.evidence import evidence
from structlearn.testbeds.dynamics.page.figures import drawings
from structlearn.testbeds.dynamics.page.page import dynamics_page
from structlearn.testbeds.dynamics.page.results import headlines, metrics, published
from structlearn.testbeds.dynamics.page.tables import tables
from structlearn.testbeds.dynamics.protocol.robot_behind_log import (
    friction_table,
    known_errors,
    residual_torques,
)
from structlearn.testbeds.dynamics.world.stand_in_robot import StandInParameters, stand_in


@pytest.fixture(scope="module")
def results():
    return dynamics_results()


def rendered(results):
    """The page without its figures being drawn."""
    document = dynamics_page(results, tables(results), {"arm_motion": results.motion})
    return render(document, reporting_verdicts.AnyFigure())


@pytest.fixture(scope="module")
def whole_page(results):
    return rendered(results)


def verdicts(results):
    return reporting_verdicts.verdicts(page.__name__, evidence(results))


@pytest.fixture(scope="module")
def told(results):
    """Verdicts as the results stand."""
    return verdicts(results)


def changed(results, table, chosen, **columns):
    """The same with other values in some rows of a table, given as wanted values by column."""
    frame = getattr(results, table).copy()
    mask = np.logical_and.reduce([frame[name] == value for name, value in chosen.items()])
    frame.loc[mask, list(columns)] = list(columns.values())
    return replace(results, **{table: frame})


def with_scores(results, model, robot=IDEAL, **columns):
    return changed(results, "scores", {"model": model, "robot": robot, "task": "reach"}, **columns)


def with_outcomes(results, model, data=IDEAL, friction=None, **columns):
    chosen = {"model": model, "data": data} | ({"friction": friction} if friction else {})
    return changed(results, "outcomes", chosen, **columns)


def with_online(results, model, factor):
    online = results.online.copy()
    online.loc[online["model"] == model, "nmse"] *= factor
    return replace(results, online=online)


def trained(results):
    """The same, with networks that met the criterion in simulation."""
    return with_outcomes(with_outcomes(results, "mlp", epochs=20.0), "delan", epochs=20.0)


def test_page_is_short_and_the_same_every_time(results, whole_page):
    """It names no table, source or number that is not there."""
    assert words_in_view(whole_page) <= 1500
    assert rendered(results) == whole_page
    assert "nan" not in whole_page.replace(">", " ").replace("<", " ").split()


def test_metrics_are_all_there_and_the_first_ones_few(results):
    every = metrics(results)
    assert 0 < len(headlines(every)) <= HEADLINES
    for model in ("mlp", "delan", "nostr", "symm", "spd", "tri", "cov"):
        for key in ("epochs", "ee_velocity_nmse", "unstable", "robot_nmse", "robot_unstable", "online_nmse"):
            assert f"{key}_{model}" in every
    assert every["epochs_cov"] == every["epochs_plain_cov"] == 2
    assert every["epochs_mlp"] == every["epochs_limit"] == results.training.epochs.raw
    assert every["ee_velocity_nmse_mlp"] == pytest.approx(5.5)
    assert every["rnea_max_error_nm"] == 3e-13
    assert every["engines_max_difference_rad"] == 3e-15
    assert every["engines_max_difference_nm"] == 4e-13
    assert every["base_parameters"] == 3
    assert every["payload_mass_error_kg"] == pytest.approx(-0.01)


@pytest.mark.parametrize(
    ("claim", "change"),
    [
        ("epochs_plain", lambda it: with_outcomes(it, "tri", epochs=4.0)),
        ("epochs_scheduled", lambda it: with_outcomes(it, "tri", epochs=np.nan)),
        ("epochs_more_plain", lambda it: with_outcomes(it, "symm", epochs=1.0)),
        ("epochs_more_scheduled", lambda it: with_outcomes(it, "nostr", epochs=1.0)),
        ("above_truth", lambda it: with_scores(it, "cov", velocity_nmse=0.1)),
        ("above_truth", lambda it: with_scores(it, "spd", position_nmse=0.1)),
        ("online_course", lambda it: with_online(it, "symm", 0.01)),
        ("online_final", lambda it: with_online(it, "mlp", 0.01)),
        ("robot_gain", lambda it: with_outcomes(it, "symm", ROBOT, "viscous", nmse_mean=0.4)),
        ("robot_least_gain", lambda it: with_outcomes(it, "cov", ROBOT, "viscous", nmse_mean=0.2)),
        ("robot_networks", lambda it: with_outcomes(it, "mlp", ROBOT, nmse_mean=0.2)),
        ("robot_delan_ran", lambda it: with_scores(it, "delan", ROBOT, stopped="")),
        ("robot_mlp_oscillates", lambda it: with_scores(it, "mlp", ROBOT, velocity_nmse=0.001)),
        ("robot_reaches", lambda it: with_scores(it, "cov", ROBOT, velocity_nmse=0.1)),
        ("static_friction", lambda it: with_outcomes(it, "cov", ROBOT, "coulomb", nmse_mean=0.3)),
        ("agreement", lambda it: replace(it, agreement=it.agreement.assign(compiled_n_m=1e-8))),
    ],
)
def test_claims_can_hold_and_fail(results, told, claim, change):
    assert told[claim] == "yes"
    assert verdicts(change(results))[claim] == "no"


def test_nothing_follows_from_a_network_that_never_met_the_criterion(results, told):
    claims = ("networks_over_strict", "networks_oscillate")
    calm = with_scores(
        with_scores(trained(results), "mlp", velocity_nmse=0.001), "delan", velocity_nmse=0.001
    )
    for found, verdict in ((told, "not tested"), (verdicts(trained(results)), "yes"), (verdicts(calm), "no")):
        assert {found[claim] for claim in claims} == {verdict}
    unlearned = with_outcomes(results, "delan", ROBOT, nmse_mean=4.0)
    assert verdicts(unlearned)["robot_delan_ran"] == "not tested"


def test_best_is_not_good_online(results, told):
    assert told["online_absolute"] == "no"
    for model in ("spd", "tri", "cov"):
        results = with_online(results, model, 1e-3)
    found = verdicts(results)
    assert found["online_absolute"] == found["online_scaled"] == "yes"


def test_a_stopped_run_counts_as_an_arm_that_does_not_move(results):
    """It may have been stopped before any error could grow, or before any was measured."""
    for error in (1e-9, np.nan):
        halted = with_scores(results, "delan", ROBOT, velocity_nmse=error, position_nmse=error)
        values = metrics(halted)
        assert (values["robot_ee_velocity_nmse_delan"], values["robot_unstable_delan"]) == (1.0, SEEDS)
    table = tables(halted)["robot"].frame.set_index(["model", "source"])
    assert table.loc[("DeLaN", "here"), "reach_velocity"] == "unstable"
    assert table.loc[("DeLaN", "here"), "stopped"] == "3 of 6"
    assert table.loc[("DeLaN", "dissertation"), "reach_velocity"] == "unstable"


def test_tables_stand_beside_the_published_ones(results):
    found = tables(results)
    table = found["simulation"].frame.set_index(["model", "source"])
    assert table.loc[("Cov", "dissertation"), "epochs"] == "2 ± 1"
    assert table.loc[("Cov", "here"), "epochs"] == "2.0 ± 0.0"
    assert table.loc[("MLP", "here"), "epochs"] == f"> {results.training.epochs.raw}"
    assert table.loc[("MLP", "here"), "reach_velocity"] == "5.500 ± 0.500"
    for name in ("simulation", "robot"):
        assert (found[name].frame["source"] == "dissertation").sum() == len(published()[name])
        assert {row for row in published()[name]} <= set(NAMES)
    errors = found["robot_errors"].frame.set_index("model")
    assert errors.loc["default (URDF)", "mean"] == pytest.approx(0.3)
    assert errors.loc["Cov", "joint_3"] == pytest.approx(0.033)
    assert errors.loc["Cov + Coulomb", "mean"] == pytest.approx(0.0044)
    bodies = found["bodies"].frame.set_index("model")
    assert bodies.loc["Cov", "possible"] == bodies.loc["Cov", "links"] == 7 * SEEDS
    assert bodies.loc["SPD", "positive_definite"] == 7 * SEEDS
    assert bodies.loc["SPD", "possible"] == 0


def test_epochs_say_how_many_seeds_got_there(results):
    partly = changed(results, "outcomes", {"model": "cov", "data": IDEAL, "seed": 0}, epochs=np.nan)
    assert tables(partly)["epochs"].frame.set_index("model").loc["Cov", "raw"] == "2.0 ± 0.0 (2 of 3)"
    assert metrics(partly)["epochs_cov"] == pytest.approx((2 + 2 + results.training.epochs.raw) / 3)


def test_a_payload_is_settled_when_its_mass_stays_right(results, whole_page):
    assert results.settling_s == pytest.approx(4.0)
    late = payload_table(settled_after=50.0)
    assert replace(results, payload=late).settling_s == pytest.approx(51.0)
    wrong = payload_table()
    wrong.loc[wrong.index[-1], "mass_kg"] = 1.0
    never = replace(results, payload=wrong)
    assert never.settling_s is None
    assert rendered(never) != whole_page


def test_a_log_of_your_own_has_no_truth_and_is_not_tracked(results, whole_page):
    scores, paths = (table[table["robot"] == IDEAL] for table in (results.scores, results.paths))
    known = results.known[results.known["model"] == DEFAULT]
    friction = results.friction.assign(truth=np.nan)
    own = replace(results, stand_in=None, scores=scores, paths=paths, known=known, friction=friction)
    assert "robot_reaches.rrd" in whole_page
    assert "robot_reaches.rrd" not in rendered(own)
    assert drawings(own)
    assert "robot" not in tables(own)
    assert "robot_nmse_cov" in metrics(own)
    found = verdicts(own)
    assert found["robot_delan_ran"] == found["robot_reaches"] == "not tested"


def test_what_is_known_explains_a_log_made_with_it():
    """A motion whose torques are those of the stand-in's links and friction."""
    arm, rng = iiwa(), np.random.default_rng(3)
    mechanics = stand_in(arm.tree, arm.inertias, committed(StandInParameters, "stand_in"))
    states = [rng.normal(0.0, 1.0, (60, 7)) for _ in range(3)]
    terms = ("viscous", "coulomb")
    state = {
        "inertia": free_parameters("cov", mechanics.inertias)[None].numpy(),
        "friction": np.sqrt(np.stack([mechanics.viscous, mechanics.coulomb], -1))[None],
    }
    truth = DynamicsModels("cov", arm.tree.names, terms, (), state)
    motion = Motion(*states, np.zeros((60, 7)))
    residuals = residual_torques(arm, truth, motion, 10.0)
    speed, rubbing = (residuals[name].to_numpy() for name in ("velocity_rad_s", "friction_n_m"))
    assert np.all(np.sign(speed) == np.sign(rubbing))
    measured = (rubbing - residuals["residual_n_m"].to_numpy()).reshape(60, 7)  # links and friction
    errors = known_errors(arm, mechanics, Motion(*states, measured)).set_index("model")["nmse"]
    assert errors[GROUND_TRUTH].max() < 1e-6
    assert errors[DEFAULT].min() > 1e-3
    table = friction_table({"cov_coulomb": truth}, mechanics)
    assert np.allclose(table["value"], table["truth"])
    assert friction_table({"cov_coulomb": truth}, None)["truth"].isna().all()
    assert set(known_errors(arm, None, Motion(*states, measured))["model"]) == {DEFAULT}


def test_agreement_sees_a_difference():
    arm, ways = iiwa(), ["recursion_n_m", "regressor_n_m", "compiled_n_m"]
    found = agreement_with_pinocchio(arm, states=20)
    assert max(found[way] for way in ways) < 1e-9 < found["largest_n_m"]
    heavier = replace(arm, inertias=replace(arm.inertias, mass=1.01 * arm.inertias.mass))
    wrong = agreement_with_pinocchio(heavier, states=20)
    assert min(wrong[way] for way in ways) > 1e-3
