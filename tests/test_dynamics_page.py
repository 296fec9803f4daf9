"""The page of the dynamics testbed, on made-up results."""

from dataclasses import replace

import numpy as np
import pytest
import reporting_verdicts
from committed import committed
from dynamics_tables import SEEDS, dynamics_results, iiwa, payload_table

from dissertation.dynamics import page
from dissertation.dynamics.names import IDEAL, ROBOT
from dissertation.dynamics.page import findings as page_findings
from dissertation.dynamics.page.page import dynamics_page, tables
from dissertation.dynamics.protocol.trainings import OURS, PUBLISHED
from dissertation.dynamics.world.joint_logs import PerturbedRobotParameters, perturbed_mechanics
from structlearn.reporting.document import render
from structlearn.rigid_body.dynamics_models import DynamicsModels
from structlearn.rigid_body.inertia_parameters import free_parameters
from structlearn.rigid_body.model_names import DEFAULT, GROUND_TRUTH, NAMES
from structlearn.rigid_body.motion import Motion


@pytest.fixture(scope="module")
def results():
    return dynamics_results()


def rendered(results):
    """The page without its figures being drawn."""
    return render(dynamics_page(results, page_findings.findings(results)), reporting_verdicts.AnyFigure())


def verdicts(results):
    return reporting_verdicts.verdicts(page.__name__, page_findings.findings(results))


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


def untracked(results, model, arm, form):
    """The same, with a model that did not meet the criterion in a form."""
    scores = results.scores
    gone = (scores["model"] == model) & (scores["robot"] == arm) & (scores["form"] == form)
    its = changed(results, "outcomes", {"model": model, "arm": arm, "form": form}, met=False)
    return replace(its, scores=scores[~gone])


def test_findings_are_those_of_the_tables(results):
    every = page_findings.findings(results).numbers()
    assert (every["epochs_cov"], every["epochs_cov_plain"]) == pytest.approx((2, 2))
    assert (every["epochs_mlp"], every["epochs_mlp_plain"]) == pytest.approx((20, every["epochs_limit"]))
    assert "ee_velocity_nmse_mlp_plain" not in every  # it did not meet the criterion
    assert every["ee_velocity_nmse_mlp"] == pytest.approx(5.5)
    assert every["rnea_max_error_nm"] == 3e-13
    assert every["base_parameters"] == 3
    assert every["robots"] == len(SEEDS)
    assert every["payload_mass_error_share"] == pytest.approx(0.01 / 1.5)


def test_claims_hold_where_the_tables_say_so(results):
    better = results
    for model in ("mlp_scaled", "nostr", "symm"):  # made up to be as good as the truth
        better = with_scores(better, model, velocity_nmse=0.05)
    found = verdicts(better)
    both = ("epochs", "epochs_more", "above_truth", "robot_gain", "robot_reaches", "static_friction")
    yes = {f"{claim}_{form}" for claim in both for form in (PUBLISHED, OURS)}
    yes |= {"over_strict_ours", "robot_networks_ours", "robot_mlp_ours"}
    yes |= {"online_course", "online_final", "online_scaled"}
    assert {found[name] for name in yes | {"payload_mass_error_share", "rnea_max_error_nm"}} == {"yes"}


def test_what_one_form_finds_decides_nothing_in_the_other(results, told):
    for form, other in ((PUBLISHED, OURS), (OURS, PUBLISHED)):
        slow = changed(results, "outcomes", {"model": "cov", "arm": IDEAL, "form": form}, epochs=9.0)
        found = verdicts(slow)
        assert (found[f"epochs_{form}"], found[f"epochs_{other}"]) == ("no", told[f"epochs_{other}"])


def test_nothing_follows_from_a_network_that_never_met_the_criterion(results, told):
    for claim in ("over_strict_published", "robot_mlp_published", "robot_delan_stopped_published"):
        assert told[claim] == "not tested"
    assert told["robot_networks_published"] == "no"
    assert told["robot_mlp_ours"] == "yes"
    without = verdicts(untracked(untracked(results, "mlp", IDEAL, OURS), "mlp", ROBOT, OURS))
    assert without["robot_mlp_ours"] == "not tested"
    assert "not tested: no network of this kind met the criterion" in rendered(results)


def test_a_stopped_run_counts_as_an_arm_that_does_not_move(results):
    """It may have been stopped before any error could grow, or before any was measured."""
    for error in (1e-9, np.nan):
        halted = with_scores(results, "delan", ROBOT, velocity_nmse=error, position_nmse=error)
        values = page_findings.findings(halted).numbers()
        found = (values["robot_ee_velocity_nmse_delan"], values["robot_unstable_delan"])
        assert found == (1.0, len(SEEDS))
    table = tables(halted)["robot"].frame.set_index(["model", "source"])
    assert table.loc[("DeLaN", "our training"), "reach_velocity"] == "unstable"
    assert table.loc[("DeLaN", "our training"), "stopped"] == "3 of 6"
    assert table.loc[("DeLaN", "as published"), "reach_velocity"] == "not tested"
    assert table.loc[("DeLaN", "dissertation"), "reach_velocity"] == "unstable"


def test_tables_stand_beside_the_published_ones(results):
    found = tables(results)
    table = found["simulation"].frame.set_index(["model", "source"])
    assert table.loc[("Cov", "dissertation"), "epochs"] == "2 ± 1"
    assert table.loc[("Cov", "as published"), "epochs"] == "2.0 ± 0.0"
    assert (
        table.loc[("MLP", "as published"), "epochs"]
        == f"> {results.chosen['train_dynamics'].epochs.simulation}"
    )
    assert table.loc[("MLP", "our training"), "reach_velocity"] == "5.500 ± 0.500"
    for name in ("simulation", "robot"):
        assert (found[name].frame["source"] == "dissertation").sum() == len(page_findings.published()[name])
        assert {row for row in page_findings.published()[name]} <= set(NAMES)
    errors = found["robot_errors"].frame.set_index(["model", "form"])
    assert errors.loc[("default (URDF)", ""), "mean"] == pytest.approx(0.3)
    assert errors.loc[("Cov", "our training"), "joint_3"] == pytest.approx(0.033)
    assert errors.loc[("Cov + Coulomb", "as published"), "mean"] == pytest.approx(0.0044)
    bodies = found["bodies"].frame.set_index("model")
    assert bodies.loc["Cov", "possible"] == bodies.loc["Cov", "links"] == 7 * len(SEEDS)
    assert bodies.loc["SPD", "positive_definite"] == 7 * len(SEEDS)
    assert bodies.loc["SPD", "possible"] == 0


def test_a_payload_is_settled_when_its_mass_stays_right(results):
    assert set(results.settling_s) == {4.0}
    late = payload_table(settled_after=20.0)
    assert set(replace(results, payload=late).settling_s) == {21.0}
    wrong = payload_table()
    wrong.loc[wrong["time_s"] == wrong["time_s"].max(), "mass_kg"] = 1.0
    never = replace(results, payload=wrong)
    assert never.settling_s.isna().all()
    assert page_findings.findings(never).numbers()["payload_settled"] == 0
    assert rendered(never)


def test_what_is_known_explains_a_log_made_with_it():
    """A motion whose torques are those of the perturbed robot's links and friction."""
    arm, rng = iiwa(), np.random.default_rng(3)
    mechanics = perturbed_mechanics(
        arm.tree, arm.inertias, committed(PerturbedRobotParameters, "perturbed_robot"), 3
    )
    states = [rng.normal(0.0, 1.0, (60, 7)) for _ in range(3)]
    terms = ("viscous", "coulomb")
    state = {
        "inertia": free_parameters("cov", mechanics.inertias)[None].numpy(),
        "friction": np.sqrt(np.stack([mechanics.viscous, mechanics.coulomb], -1))[None],
    }
    truth = DynamicsModels("cov", arm.tree.names, terms, (), state)
    motion = Motion(*states, np.zeros((60, 7)))
    residuals = page_findings.residual_torques(arm, truth, motion, 10.0)
    speed, friction = (residuals[name].to_numpy() for name in ("velocity_rad_s", "friction_n_m"))
    assert np.all(np.sign(speed) == np.sign(friction))
    measured = (friction - residuals["residual_n_m"].to_numpy()).reshape(60, 7)  # links and friction
    errors = page_findings.known_errors(arm, mechanics, Motion(*states, measured)).set_index("model")["nmse"]
    assert errors[GROUND_TRUTH].max() < 1e-6
    assert errors[DEFAULT].min() > 1e-3
    table = page_findings.friction_table({"cov_coulomb": truth}, mechanics)
    assert np.allclose(table["value"], table["truth"])
