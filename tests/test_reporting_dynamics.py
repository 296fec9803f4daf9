"""The report of the dynamics testbed, on made-up results."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from dynamics_tables import (
    SEEDS,
    dynamics_results,
    iiwa,
    payload_table,
    recorded_results,
    slide_tables,
)

from structlearn.ground.artefacts import write_metrics
from structlearn.reporting.figures import save
from structlearn.reporting.page import Link, Page, render
from structlearn.rigid_body.agreement import agreement_with_pinocchio
from structlearn.rigid_body.friction import free_friction
from structlearn.rigid_body.inertia_parameters import free_parameters
from structlearn.rigid_body.model_files import DynamicsModels
from structlearn.rigid_body.model_names import DEFAULT, GROUND_TRUTH, in_order
from structlearn.rigid_body.motion import Motion
from structlearn.testbeds.dynamics.page.dynamics_claims import dynamics_claims
from structlearn.testbeds.dynamics.page.dynamics_page import dynamics_page
from structlearn.testbeds.dynamics.page.dynamics_published import ROBOT as PRINTED_ROBOT
from structlearn.testbeds.dynamics.page.dynamics_published import SIMULATION
from structlearn.testbeds.dynamics.page.dynamics_results import IDEAL, ROBOT, metrics
from structlearn.testbeds.dynamics.page.dynamics_robot import friction_table, known_errors, residual_torques
from structlearn.testbeds.dynamics.page.dynamics_sections import pictures
from structlearn.testbeds.dynamics.page.dynamics_tables import (
    bodies,
    epochs,
    links,
    robot,
    robot_errors,
    simulation,
    tables,
)
from structlearn.testbeds.dynamics.world.stand_in_robot import StandInParameters, stand_in
from structlearn.testbeds.recorded.page import recorded_dynamics


@pytest.fixture(scope="module")
def results():
    return dynamics_results()


@pytest.fixture(scope="module")
def drawn(results):
    return pictures(results)


def page(results):
    links = [Link("../recordings/dynamics/reaches.rrd", "reaches.rrd")]
    return render(dynamics_page(results, {}, {"arm_motion": results.motion}, links))


def verdicts(results):
    return {row[0]: row[3] for row in dynamics_claims(results)}


def verdict(results, words):
    (found,) = (holds for statement, holds in verdicts(results).items() if words in statement)
    return found


def with_scores(results, model, robot_name=IDEAL, **columns):
    """The same results with other values in all reaches of a model."""
    scores = results.scores.copy()
    mask = (scores["model"] == model) & (scores["robot"] == robot_name) & (scores["task"] == "reach")
    for name, value in columns.items():
        scores.loc[mask, name] = value
    return replace(results, scores=scores)


def with_epochs(results, model, epochs):
    outcomes = results.outcomes.copy()
    mask = (outcomes["model"] == model) & (outcomes["data"] == IDEAL)
    outcomes.loc[mask, "epochs"] = epochs
    return replace(results, outcomes=outcomes)


def test_page_shows_every_figure_and_links_only_tables_that_are_written(results, drawn):
    html = page(results)
    assert set(re.findall(r'<img src="figures/(\w+)\.png"', html)) == set(drawn)
    assert set(re.findall(r'href="tables/(\w+)\.csv"', html)) <= set(tables(results))
    assert 'href="../recordings/dynamics/reaches.rrd"' in html
    assert not re.search(r'(src|href)="(https?:)?//', html)
    assert "nan" not in re.sub(r"<[^>]*>", "", html).lower().split()


def test_figures_are_the_same_every_time(results, drawn, tmp_path):
    paths = [tmp_path / f"{run}.png" for run in range(2)]
    save(drawn["tracking"], paths[0])
    save(pictures(results)["tracking"], paths[1])
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_metrics_have_the_agreed_names(results, tmp_path):
    write_metrics(metrics(results), tmp_path / "metrics.json")
    values = json.loads((tmp_path / "metrics.json").read_text())
    for model in ("mlp", "delan", "nostr", "symm", "spd", "tri", "cov"):
        assert f"epochs_{model}" in values
        assert f"ee_velocity_nmse_{model}" in values
    assert values["epochs_cov"] == 2
    assert values["epochs_mlp"] == values["epochs_limit"] == results.training.epochs.raw
    assert values["ee_velocity_nmse_mlp"] == pytest.approx(5.5)
    assert values["rnea_max_error_nm"] == 3e-13
    assert values["base_parameters"] == 3
    assert values["payload_mass_error_kg"] == pytest.approx(-0.01)


def test_a_stopped_run_counts_as_an_arm_that_does_not_move(results):
    """It may have been stopped before any error could grow."""
    halted = with_scores(results, "delan", ROBOT, velocity_nmse=1e-9)
    assert metrics(halted)["robot_ee_velocity_nmse_delan"] == 1.0
    assert metrics(halted)["robot_unstable_delan"] == SEEDS
    never_began = with_scores(results, "delan", ROBOT, velocity_nmse=np.nan, position_nmse=np.nan)
    assert metrics(never_began)["robot_ee_velocity_nmse_delan"] == 1.0
    table = robot(halted).set_index(["model", "source"])
    assert table.loc[("DeLaN", "here"), "reach_velocity"] == "unstable"
    assert table.loc[("DeLaN", "here"), "stopped"] == "3 of 6"
    assert table.loc[("DeLaN", "dissertation"), "reach_velocity"] == "unstable"


def test_tables_stand_beside_the_published_ones(results):
    table = simulation(results).set_index(["model", "source"])
    assert table.loc[("Cov", "dissertation"), "epochs"] == "2 ± 1"
    assert table.loc[("Cov", "here"), "epochs"] == "2.0 ± 0.0"
    assert table.loc[("MLP", "here"), "epochs"] == f"> {results.training.epochs.raw}"
    assert table.loc[("MLP", "here"), "reach_velocity"] == "5.500 ± 0.500"
    assert table.loc[("MLP", "dissertation"), "reach_velocity"] == "5.542 ± 6.980"
    assert table.loc[("ground truth", "here"), "sine_position"] == "0.005"
    printed = robot(results).query("source == 'dissertation'")
    assert len(printed) == len(PRINTED_ROBOT)
    assert len(SIMULATION) == (simulation(results)["source"] == "dissertation").sum()


def test_epochs_say_how_many_seeds_got_there(results):
    outcomes = results.outcomes.copy()
    mask = (outcomes["model"] == "cov") & (outcomes["data"] == IDEAL) & (outcomes["seed"] == 0)
    outcomes.loc[mask, "epochs"] = np.nan
    partly = replace(results, outcomes=outcomes)
    assert epochs(partly).set_index("model").loc["Cov", "raw"] == "2.0 ± 0.0 (2 of 3)"
    limit = results.training.epochs.raw
    assert metrics(partly)["epochs_cov"] == pytest.approx((2 + 2 + limit) / 3)


def test_claims_follow_the_numbers(results):
    assert verdict(results, "after at most 3 epochs") == "yes"
    assert verdict(with_epochs(results, "tri", 4.0), "after at most 3 epochs") == "no"
    assert verdict(with_epochs(results, "tri", np.nan), "after at most 3 epochs") == "no"
    assert verdict(results, "train faster") == "yes"
    assert verdict(with_epochs(results, "symm", 1.0), "train faster") == "not for Symm"
    assert verdict(results, "as well as the ground truth") == "yes"
    assert verdict(with_scores(results, "cov", velocity_nmse=0.1), "as well as the ground truth") == "no"
    # Symm tracks as well as the strict structures here
    assert verdict(results, "generalise better") == "not for Symm"
    assert verdict(results, "MLP oscillates in reaches of the robot") == "yes"
    assert verdict(results, "DeLaN oscillates mildly") == "yes"
    halted = with_scores(results, "delan", stopped="speed limit")
    assert verdict(halted, "DeLaN oscillates mildly") == "no, it is unstable"
    assert verdict(results, "learn fastest") == "yes"
    assert verdict(results, "by a factor of 3") == "yes"
    assert verdict(results, "DeLaN is unstable") == "yes"
    assert verdict(with_scores(results, "delan", ROBOT, stopped=""), "DeLaN is unstable") == "no"
    assert verdict(results, "Static friction") == "yes"


def test_models_that_were_not_run_are_not_spoken_of(results):
    few = replace(
        results,
        outcomes=results.outcomes[~results.outcomes["model"].isin(["delan", "symm"])],
        scores=results.scores[results.scores["model"].isin([GROUND_TRUTH, DEFAULT, "mlp", "cov"])],
        online=results.online[results.online["model"].isin(["mlp", "tri"])],
    )
    found = verdicts(few)
    assert "Cov track unseen reaches as well as the ground truth" in found
    assert "Online, Tri learn fastest" in found
    assert not [statement for statement in found if "DeLaN" in statement or "Symm" in statement]
    bare = replace(few, online=few.online[few.online["model"] == "mlp"])
    assert not [statement for statement in verdicts(bare) if "learn fastest" in statement]
    assert "nan" not in page(few)


def test_pinocchio_is_held_to_its_aim(results):
    assert verdict(results, "Pinocchio's") == "yes"
    off = replace(results, agreement=results.agreement.assign(compiled_n_m=1e-8))
    assert verdict(off, "Pinocchio's") == "no"


def test_impossible_bodies_are_counted(results):
    table = bodies(results).set_index("model")
    assert table.loc["Cov", "possible"] == table.loc["Cov", "links"] == 7 * SEEDS
    assert table.loc["SPD", "positive_definite"] == 7 * SEEDS
    assert table.loc["SPD", "possible"] == 0
    assert links(results)["mass_kg"].iloc[0] == "1.50"


def test_errors_on_the_log_are_those_of_the_kept_models(results):
    table = robot_errors(results).set_index("model")
    assert table.loc["default (URDF)", "mean"] == pytest.approx(0.3)
    assert table.loc["Cov", "joint_3"] == pytest.approx(0.033)
    assert table.loc["Cov + Coulomb", "mean"] == pytest.approx(0.0044)


def test_a_payload_is_settled_when_its_mass_stays_right(results):
    assert results.settling_s == pytest.approx(4.0)
    wrong = payload_table()
    wrong.loc[wrong.index[-1], "mass_kg"] = 1.0
    assert replace(results, payload=wrong).settling_s is None
    assert "is not within 5 % in the end" in page(replace(results, payload=wrong))
    late = payload_table(settled_after=50.0)
    assert replace(results, payload=late).settling_s == pytest.approx(51.0)


def test_a_log_of_your_own_has_no_truth_and_is_not_tracked(results):
    scores, paths = (table[table["robot"] == IDEAL] for table in (results.scores, results.paths))
    known = results.known[results.known["model"] == DEFAULT]
    friction = results.friction.assign(truth=np.nan)
    own = replace(results, stand_in=None, scores=scores, paths=paths, known=known, friction=friction)
    html = page(own)
    assert "is your own" in html
    assert "Table III.2: the" not in html
    assert set(pictures(own)) == set(pictures(results))
    assert "robot" not in tables(own)
    assert "robot_nmse_cov" in metrics(own)


def test_models_come_in_the_order_of_the_text():
    assert in_order(["cov_coulomb", "mlp", "cov", GROUND_TRUTH]) == [
        GROUND_TRUTH,
        "mlp",
        "cov",
        "cov_coulomb",
    ]


def test_what_is_known_explains_a_log_made_with_it():
    """A motion whose torques are those of the stand-in's links and friction."""
    arm, rng = iiwa(), np.random.default_rng(3)
    mechanics = stand_in(arm.tree, arm.inertias, StandInParameters())
    states = [rng.normal(0.0, 1.0, (60, 7)) for _ in range(3)]
    terms = ("viscous", "coulomb")
    truth = DynamicsModels(
        "cov",
        arm.tree.names,
        terms,
        (),
        {
            "inertia": free_parameters("cov", mechanics.inertias)[None].numpy(),
            "friction": free_friction(np.stack([mechanics.viscous, mechanics.coulomb], -1), terms)[
                None
            ].numpy(),
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


def recorded_page(made_up):
    return render(Page("Panda", "", (recorded_dynamics.section(made_up, *slide_tables(), {}),)))


def test_recorded_metrics_are_means_over_the_joints_of_the_test_part():
    assert recorded_dynamics.metrics(recorded_results()) == pytest.approx(
        {
            "panda_nmse_default": 4.0,
            "panda_nmse_least_squares_viscous": 0.05,
            "panda_nmse_least_squares_coulomb": 0.01,
            "panda_nmse_cov_viscous": 0.06,
            "panda_nmse_cov_coulomb": 0.012,
            "panda_nmse_mlp": 0.1,
        }
    )


def test_recorded_section_says_whether_the_aims_are_met():
    html = recorded_page(recorded_results())
    assert "1.20 (viscous), 1.20 (viscous, Coulomb)" in html
    assert "is met" in html
    assert "by a factor of 5.0" in html
    assert "the payload weighs 2.4 kg" in html
    assert "is missed" in recorded_page(recorded_results(coulomb=0.1))


def test_recorded_table_has_a_row_per_model_and_friction():
    made_up = recorded_results()
    table = recorded_dynamics.error_table(made_up)
    assert len(table) == made_up.errors.groupby(["model", "friction"]).ngroups
    assert table["model"].iloc[0] == "URDF as it is"
    assert table.query("model == 'Cov' and friction == 'viscous'")["mean"].item() == pytest.approx(0.06)
    assert set(recorded_dynamics.pictures(made_up)) == {"panda", "panda_torques"}
    html = recorded_page(made_up)
    for name in recorded_dynamics.tables(made_up, *slide_tables()):
        assert f"tables/{name}.csv" in html
    rubbing = recorded_dynamics.friction_table(made_up)
    assert list(rubbing.columns) == ["joint", "viscous", "coulomb"]
    assert len(recorded_dynamics.body_table(made_up)) == 7 * SEEDS
