"""The page of the dynamics testbed, on made-up results."""

import numpy as np
import pytest
import reporting_verdicts
import yaml
from committed import PARAMETER_FILE, ROOT, committed, read_yaml
from dynamics_tables import (
    SEEDS,
    dynamics_tables,
    findings_of,
    iiwa,
    parameters,
    payload_table,
    population_of,
)

from dissertation.dynamics import page
from dissertation.dynamics.names import IDEAL, ROBOT
from dissertation.dynamics.page.figures import payload_panel
from dissertation.dynamics.page.findings import findings, published
from dissertation.dynamics.page.page import dynamics_page, tables
from dissertation.dynamics.protocol.trainings import CHOSEN, FORMS, PLAIN
from dissertation.dynamics.protocol.truth import friction_table, known_errors, residual_torques
from dissertation.dynamics.world.joint_logs import (
    PerturbedRobotParameters,
    perturbed_mechanics,
    perturbed_robot,
)
from dissertation.evidence.results import with_study
from dissertation.evidence.studies import Study, StudyProvenance, digests
from structlearn.reporting.document import render
from structlearn.rigid_body.dynamics_models import DynamicsModels
from structlearn.rigid_body.inertia_parameters import free_parameters
from structlearn.rigid_body.model_names import DEFAULT, GROUND_TRUTH, NAMES
from structlearn.rigid_body.motion import Motion


@pytest.fixture(scope="module")
def raw():
    return dynamics_tables()


def rendered(raw):
    """The page without its figures being drawn."""
    made = dynamics_page(population_of(raw), findings_of(raw), raw, parameters(), None)
    return render(made, reporting_verdicts.AnyFigure())


def verdicts(raw):
    return reporting_verdicts.verdicts(page.__name__, findings_of(raw))


@pytest.fixture(scope="module")
def told(raw):
    """Verdicts as the tables stand."""
    return verdicts(raw)


def changed(raw, table, chosen, **columns):
    """The same with other values in some rows of a table, given as wanted values by column."""
    frame = raw[table].copy()
    mask = np.logical_and.reduce([frame[name] == value for name, value in chosen.items()])
    frame.loc[mask, list(columns)] = list(columns.values())
    return raw | {table: frame}


def with_scores(raw, model, robot=IDEAL, **columns):
    return changed(raw, "scores", {"model": model, "robot": robot, "task": "reach"}, **columns)


def untracked(raw, model, arm, form):
    """The same, with a model that did not meet the criterion in a form."""
    scores = raw["scores"]
    gone = (scores["model"] == model) & (scores["robot"] == arm) & (scores["form"] == form)
    its = changed(raw, "outcomes", {"model": model, "arm": arm, "form": form}, met=False)
    return its | {"scores": scores[~gone]}


def test_findings_are_those_of_the_tables(raw):
    every = findings_of(raw).numbers()
    assert (every["epochs_chosen_Cov"], every["epochs_plain_Cov"]) == pytest.approx((2, 2))
    assert every["epochs_of_others_chosen_MLP"] == pytest.approx(20)
    assert every["epochs_of_others_plain_MLP"] == pytest.approx(64)  # the limit
    assert "over_strict_plain_MLP" not in every  # it did not meet the criterion
    assert every["robot_feedback_chosen_Cov"] == pytest.approx(1 / 3)
    assert every["rnea_max_error_nm"] == 3e-13
    assert every["payload_mass_error_share"] == pytest.approx(0.01 / 1.5)
    assert every["viscous_factor"] == pytest.approx(4.0)
    assert every["spd_consistent"] == 0


def test_claims_hold_where_the_tables_say_so(raw):
    better = raw
    for model in ("nostr", "symm"):  # made up to be as good as the truth
        better = with_scores(better, model, velocity_nmse=0.05)
    better = changed(better, "outcomes", {"arm": ROBOT, "model": "cov"}, nmse_mean=0.35)
    found = verdicts(better)
    both = ("epochs", "epochs_more", "above_truth", "robot_reaches")
    yes = {f"{claim}_{form}" for claim in both for form in FORMS}
    yes |= {f"{name}_{CHOSEN}" for name in ("over_strict", "over_less", "robot_networks", "robot_mlp")}
    yes |= {
        "static_friction_chosen",
        "oscillation",
        "part_nmse",
        "part_more",
        "robot_feedback_chosen",
        "spd_consistent",
        "consistent_links",
    }
    yes |= {"online_course_normalised", "online_course_raw", "online_half_normalised", "online_scaled"}
    assert {name for name in yes if found[name] != "yes"} == set()


def test_what_one_form_finds_decides_nothing_in_the_other(raw, told):
    for form, other in ((CHOSEN, PLAIN), (PLAIN, CHOSEN)):
        slow = changed(raw, "outcomes", {"model": "cov", "arm": IDEAL, "form": form}, epochs=9.0)
        found = verdicts(slow)
        assert (found[f"epochs_{form}"], found[f"epochs_{other}"]) == ("no", told[f"epochs_{other}"])


def test_nothing_follows_from_a_network_that_never_met_the_criterion(raw, told):
    assert told["robot_networks_plain"] == "no"
    assert told["robot_mlp_chosen"] == "yes"
    without = verdicts(untracked(untracked(raw, "mlp", IDEAL, CHOSEN), "mlp", ROBOT, CHOSEN))
    assert without["robot_mlp_chosen"] == without["over_strict_chosen"] == "not tested"


def test_an_error_above_that_of_a_constant_ranks_nobody(raw):
    """Online, where models of which both are useless differ by orders of magnitude."""
    online = raw["online"].assign(nmse=raw["online"]["nmse"] * 1e6)
    assert verdicts(raw | {"online": online})["online_half_normalised"] == "no"


def test_a_stopped_run_counts_as_an_arm_that_does_not_move(raw):
    """It may have been stopped before any error could grow, or before any was measured."""
    for error in (1e-9, np.nan):
        halted = with_scores(raw, "delan", ROBOT, velocity_nmse=error, position_nmse=error)
        results = population_of(halted).results
        assert set(results.each("velocity_nmse", arm=ROBOT, model="delan", task="reach")) == {1.0}
    table = tables(results, halted)["robot"].frame.set_index(["model", "source"])
    assert table.loc[("DeLaN", "chosen training"), "stopped"] == "3 of 6"
    assert table.loc[("DeLaN", "chosen training"), "reach_velocity"] == "unstable"
    assert table.loc[("DeLaN", "plain loss"), "reach_velocity"] == "not tested"
    assert table.loc[("DeLaN", "dissertation"), "reach_velocity"] == "unstable"


def test_tables_stand_beside_the_published_ones(raw):
    found = tables(population_of(raw).results, raw)
    table = found["simulation"].frame.set_index(["model", "source"])
    assert table.loc[("Cov", "dissertation"), "epochs"] == "2 ± 1"
    assert table.loc[("Cov", "plain loss"), "epochs"] == "2.0 ± 0.0"
    assert table.loc[("MLP", "plain loss"), "epochs"] == "> 64"
    assert table.loc[("MLP", "chosen training"), "reach_velocity"] == "5.500 ± 0.500"
    for name in ("simulation", "robot"):
        assert (found[name].frame["source"] == "dissertation").sum() == len(published()[name])
        assert {row for row in published()[name]} <= set(NAMES)
    errors = found["robot_errors"].frame.set_index(["model", "form"])
    assert errors.loc[("default (URDF)", ""), "mean"] == pytest.approx(0.3)
    assert errors.loc[("Cov", "chosen training"), "joint_3"] == pytest.approx(0.033)
    assert errors.loc[("Cov + Coulomb", "plain loss"), "mean"] == pytest.approx(0.0044)
    bodies = found["bodies"].frame.set_index("model")
    assert bodies.loc["Cov", "possible"] == bodies.loc["Cov", "links"] == 7 * len(SEEDS)
    assert (bodies.loc["SPD", "positive_definite"], bodies.loc["SPD", "possible"]) == (7 * len(SEEDS), 0)
    choice = found["choice"].frame.set_index("model")
    assert choice.loc["Cov", ["loss", "rate", "epochs", "raw"]].tolist() == pytest.approx(
        ["normalised", 0.003, 0.9, 128.0]
    )


def test_a_payload_is_settled_when_its_mass_stays_right(raw):
    assert findings_of(raw).numbers()["payload_settling_median"] == 4
    late = findings_of(raw | {"payload": payload_table(settled_after=20.0)}).numbers()
    assert (late["payload_settling_max"], late["payload_settled"]) == (21, len(SEEDS))
    wrong = payload_table()
    wrong.loc[wrong["time_s"] == wrong["time_s"].max(), "mass_kg"] = 1.0
    never = raw | {"payload": wrong}
    assert findings_of(never).numbers()["payload_settled"] == 0
    assert rendered(never)


def test_the_payload_that_is_carried_is_a_step(raw):
    carried = parameters()["record_motion"].payload
    figure = payload_panel(raw["payload"], carried, 30.0)
    line = next(its for its in figure.axes[0].lines if its.get_label() == "carried")
    assert line.get_drawstyle() == "steps-pre"
    assert line.get_xydata().tolist() == [[0.0, 0.0], [30.0, 0.0], [60.0, 1.0]]


def test_after_a_change_of_tracking_what_was_learned_keeps_its_study(raw, tmp_path, monkeypatch):
    """Rows of the moved stage are this run's; the study's, made with other parameters, stand beside."""
    values = read_yaml(PARAMETER_FILE)
    keys = ["arm", "arm_motion", "dynamics_robots", "online", "perturbed_robot", "record_motion", "track"]
    seeds = ["dynamics_robots.test", "train_dynamics.seeds", "online.seeds"]
    made = {"parameters": digests(values, [*keys, "train_dynamics"], seeds), "seeds": seeds}
    own = population_of(raw).one.table
    more = own.assign(seed=own["seed"] + 100, variant="ours", cell="111-113")
    study = Study(more, StudyProvenance(**made, cells={}, check=None))
    (tmp_path / "dvc.yaml").write_bytes((ROOT / "dvc.yaml").read_bytes())
    monkeypatch.chdir(tmp_path)
    found = {}
    for name, goals in (("same", 5), ("moved", 4)):
        values["track"]["reaching"]["goals"] = goals
        (tmp_path / "params.yaml").write_text(yaml.safe_dump(values))
        population = with_study(own, study, "seed", [], variant="ours")
        assert population.moved == (name == "moved")
        found[name] = findings(population, [1e-13])
    same, moved = (its["over_strict_chosen"]["MLP"] for its in found.values())
    assert (same.n, same.remark) == (len(SEEDS), "")
    assert moved.n == 1
    assert moved.remark.startswith("one person; ")
    assert moved.remark.endswith("with other parameters")
    assert np.isinf(moved.high)
    judged = [reporting_verdicts.cases(page.__name__, its) for its in found.values()]
    kept = ("epochs_chosen", "online_course_raw", "robot_gain_chosen", "payload_mass_error_share")
    for evidence in kept:
        assert found["same"][evidence] == found["moved"][evidence]
        assert judged[0][evidence] == judged[1][evidence]
    assert set(judged[1]["over_strict_chosen"].values()) == {"undecided"}


def test_what_is_known_explains_a_log_made_with_it():
    """A motion whose torques are those of the perturbed robot's links and friction."""
    arm, rng = iiwa(), np.random.default_rng(3)
    robots = committed(PerturbedRobotParameters, "perturbed_robot")
    mechanics = perturbed_mechanics(arm.tree, arm.inertias, perturbed_robot(robots, 3))
    states = [rng.normal(0.0, 1.0, (60, 7)) for _ in range(3)]
    terms = ("viscous", "coulomb")
    state = {
        "inertia": free_parameters("cov", mechanics.inertias)[None].numpy(),
        "friction": np.sqrt(np.stack([mechanics.viscous, mechanics.coulomb], -1))[None],
    }
    truth = DynamicsModels("cov", arm.tree.names, terms, (), state)
    motion = Motion(*states, np.zeros((60, 7)))
    residuals = residual_torques(arm, truth, motion, 10.0)
    speed, friction = (residuals[name].to_numpy() for name in ("velocity_rad_s", "friction_n_m"))
    assert np.all(np.sign(speed) == np.sign(friction))
    measured = (friction - residuals["residual_n_m"].to_numpy()).reshape(60, 7)  # links and friction
    errors = known_errors(arm, mechanics, Motion(*states, measured)).set_index("model")["nmse"]
    assert errors[GROUND_TRUTH].max() < 1e-6
    assert errors[DEFAULT].min() > 1e-3
    table = friction_table({"cov_coulomb": truth}, mechanics)
    assert np.allclose(table["value"], table["truth"])
