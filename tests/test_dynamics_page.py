"""The page of the dynamics testbed, on made-up results."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from committed import committed
from dynamics_tables import SEEDS, dynamics_results, iiwa, payload_table

from structlearn.reporting.claims import Evidence, combined, read_claims
from structlearn.reporting.document import Panel, render, words_in_view
from structlearn.reporting.publishing import HEADLINES
from structlearn.rigid_body.agreement import agreement_with_pinocchio
from structlearn.rigid_body.inertia_parameters import free_parameters
from structlearn.rigid_body.model_files import DynamicsModels
from structlearn.rigid_body.model_names import DEFAULT, GROUND_TRUTH, NAMES, in_order
from structlearn.rigid_body.motion import Motion
from structlearn.testbeds.dynamics import page
from structlearn.testbeds.dynamics.names import IDEAL, LOOKS, ROBOT
from structlearn.testbeds.dynamics.page.evidence import evidence
from structlearn.testbeds.dynamics.page.figures import drawings
from structlearn.testbeds.dynamics.page.page import dynamics_page, publish_dynamics
from structlearn.testbeds.dynamics.page.results import headlines, metrics, published
from structlearn.testbeds.dynamics.page.tables import tables
from structlearn.testbeds.dynamics.protocol.robot_behind_log import (
    friction_table,
    known_errors,
    residual_torques,
)
from structlearn.testbeds.dynamics.world.stand_in_robot import StandInParameters, stand_in

CLAIMS = read_claims(Path(page.__file__).parent / "claims.yaml")
STILL = np.zeros((4, 6, 3), np.uint8)


@pytest.fixture(scope="module")
def results():
    return dynamics_results()


def page_of(results):
    return dynamics_page(results, tables(results), {"arm_motion": results.motion})


def write(results, folder):
    publish_dynamics(results, STILL, {"arm_motion": results.motion}, folder)
    return (folder / "index.html").read_text()


def rendered(results):
    """The page without its figures being drawn."""
    names = ("still", "training", "tracking", "reaches", "online", "friction", "payload", "bodies")
    return render(page_of(results), {name: [Panel(f"figures/{name}.svg", 10, 10)] for name in names})


def verdicts(results):
    """By the name of the evidence; every claim rests on its own."""
    words, found = {}, evidence(results)
    for claim in CLAIMS:
        cases = found[claim.evidence]
        cases = {"": cases} if isinstance(cases, Evidence) else cases
        words[claim.evidence] = combined([claim.verdict(one, case) for case, one in cases.items()])
    return words


def with_scores(results, model, robot=IDEAL, task="reach", **columns):
    scores = results.scores.copy()
    mask = (scores["model"] == model) & (scores["robot"] == robot) & (scores["task"] == task)
    for name, value in columns.items():
        scores.loc[mask, name] = value
    return replace(results, scores=scores)


def with_outcomes(results, model, data=IDEAL, friction=None, **columns):
    outcomes = results.outcomes.copy()
    mask = (outcomes["model"] == model) & (outcomes["data"] == data)
    mask &= (outcomes["friction"] == friction) if friction else True
    for name, value in columns.items():
        outcomes.loc[mask, name] = value
    return replace(results, outcomes=outcomes)


def with_online(results, model, factor):
    online = results.online.copy()
    online.loc[online["model"] == model, "nmse"] *= factor
    return replace(results, online=online)


def trained(results):
    """The same, with networks that met the criterion in simulation."""
    for model in ("mlp", "delan"):
        results = with_outcomes(results, model, epochs=20.0)
    return results


def test_page_is_short_and_the_same_every_time(results, tmp_path):
    """It names no figure, table, source or number that is not there."""
    html = write(results, tmp_path)
    assert words_in_view(html) <= 1500
    assert rendered(results) == rendered(results)
    assert "nan" not in html.replace(">", " ").replace("<", " ").split()
    assert all(file.stat().st_size < 1e6 for file in (tmp_path / "figures").iterdir())


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
def test_claims_can_hold_and_fail(results, claim, change):
    assert verdicts(results)[claim] == "yes"
    assert verdicts(change(results))[claim] == "no"


def test_nothing_follows_from_a_network_that_never_met_the_criterion(results):
    claims = ("networks_over_strict", "networks_oscillate")
    assert {verdicts(results)[claim] for claim in claims} == {"not tested"}
    assert {verdicts(trained(results))[claim] for claim in claims} == {"yes"}
    calm = trained(results)
    for model in ("mlp", "delan"):
        calm = with_scores(calm, model, velocity_nmse=0.001)
    assert {verdicts(calm)[claim] for claim in claims} == {"no"}
    unlearned = with_outcomes(results, "delan", ROBOT, nmse_mean=4.0)
    assert verdicts(unlearned)["robot_delan_ran"] == "not tested"


def test_best_is_not_good_online(results):
    assert verdicts(results)["online_absolute"] == "no"
    for model in ("spd", "tri", "cov"):
        results = with_online(results, model, 1e-3)
    assert verdicts(results)["online_absolute"] == "yes"
    assert verdicts(results)["online_scaled"] == "yes"


def test_a_stopped_run_counts_as_an_arm_that_does_not_move(results):
    """It may have been stopped before any error could grow, or before any was measured."""
    for error in (1e-9, np.nan):
        halted = with_scores(results, "delan", ROBOT, velocity_nmse=error, position_nmse=error)
        assert metrics(halted)["robot_ee_velocity_nmse_delan"] == 1.0
        assert metrics(halted)["robot_unstable_delan"] == SEEDS
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
    outcomes = results.outcomes.copy()
    mask = (outcomes["model"] == "cov") & (outcomes["data"] == IDEAL) & (outcomes["seed"] == 0)
    outcomes.loc[mask, "epochs"] = np.nan
    partly = replace(results, outcomes=outcomes)
    assert tables(partly)["epochs"].frame.set_index("model").loc["Cov", "raw"] == "2.0 ± 0.0 (2 of 3)"
    limit = results.training.epochs.raw
    assert metrics(partly)["epochs_cov"] == pytest.approx((2 + 2 + limit) / 3)


def test_a_payload_is_settled_when_its_mass_stays_right(results):
    assert results.settling_s == pytest.approx(4.0)
    late = payload_table(settled_after=50.0)
    assert replace(results, payload=late).settling_s == pytest.approx(51.0)
    wrong = payload_table()
    wrong.loc[wrong.index[-1], "mass_kg"] = 1.0
    never = replace(results, payload=wrong)
    assert never.settling_s is None
    assert rendered(never) != rendered(results)


def test_a_log_of_your_own_has_no_truth_and_is_not_tracked(results):
    scores, paths = (table[table["robot"] == IDEAL] for table in (results.scores, results.paths))
    known = results.known[results.known["model"] == DEFAULT]
    friction = results.friction.assign(truth=np.nan)
    own = replace(results, stand_in=None, scores=scores, paths=paths, known=known, friction=friction)
    assert "robot_reaches.rrd" in rendered(results)
    assert "robot_reaches.rrd" not in rendered(own)
    assert drawings(own).keys() == drawings(results).keys()
    assert "robot" not in tables(own)
    assert "robot_nmse_cov" in metrics(own)
    found = verdicts(own)
    assert found["robot_delan_ran"] == found["robot_reaches"] == "not tested"


def test_every_model_has_a_name_a_look_and_a_place():
    assert list(LOOKS) == list(NAMES)
    assert len({look for look in LOOKS.values()}) == len(LOOKS) - 1  # what is known of a robot is grey
    order = [GROUND_TRUTH, "mlp", "cov", "cov_coulomb"]
    assert in_order(["cov_coulomb", "mlp", "cov", GROUND_TRUTH]) == order


def test_what_is_known_explains_a_log_made_with_it():
    """A motion whose torques are those of the stand-in's links and friction."""
    arm, rng = iiwa(), np.random.default_rng(3)
    mechanics = stand_in(arm.tree, arm.inertias, committed(StandInParameters, "stand_in"))
    states = [rng.normal(0.0, 1.0, (60, 7)) for _ in range(3)]
    terms = ("viscous", "coulomb")
    truth = DynamicsModels(
        "cov",
        arm.tree.names,
        terms,
        (),
        {
            "inertia": free_parameters("cov", mechanics.inertias)[None].numpy(),
            "friction": np.sqrt(np.stack([mechanics.viscous, mechanics.coulomb], -1))[None],
        },
    )
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
    arm = iiwa()
    found = agreement_with_pinocchio(arm, states=20)
    assert (
        max(found[f"{way}_n_m"] for way in ("recursion", "regressor", "compiled"))
        < 1e-9
        < found["largest_n_m"]
    )
    heavier = replace(arm, inertias=replace(arm.inertias, mass=1.01 * arm.inertias.mass))
    wrong = agreement_with_pinocchio(heavier, states=20)
    assert min(wrong[f"{way}_n_m"] for way in ("recursion", "regressor", "compiled")) > 1e-3
