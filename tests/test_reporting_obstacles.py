"""The report of the obstacle testbed, on a small world with models that steer away."""

import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from obstacles_unrolls import baseline

from structlearn.avoidance.avoidance_dataset import AvoidanceDataParameters
from structlearn.avoidance.human_inspired import HumanInspiredModels
from structlearn.avoidance.learned_models import AvoidanceModels
from structlearn.avoidance.network_training import NetworkParameters
from structlearn.avoidance.shapes import SHAPES, obstacle
from structlearn.ground.artefacts import write_metrics
from structlearn.recordings.demonstration import Demonstration
from structlearn.reporting.figures import save
from structlearn.reporting.page import Link, render
from structlearn.testbeds.obstacles.page.obstacle_claims import obstacle_claims
from structlearn.testbeds.obstacles.page.obstacle_page import obstacle_page
from structlearn.testbeds.obstacles.page.obstacle_path_figures import beyond_figure, worst
from structlearn.testbeds.obstacles.page.obstacle_published import PER_SETTING, PER_SHAPE, UNSEEN
from structlearn.testbeds.obstacles.page.obstacle_results import ObstacleResults, example_setting, metrics
from structlearn.testbeds.obstacles.page.obstacle_sections import pictures
from structlearn.testbeds.obstacles.page.obstacle_tables import limits, per_setting, per_shape, tables, unseen
from structlearn.testbeds.obstacles.protocol import avoidance_protocols
from structlearn.testbeds.obstacles.protocol.avoidance_fits import AvoidanceTrainingParameters
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import AvoidanceEvaluationParameters
from structlearn.testbeds.obstacles.world.reaching_person import AvoiderParameters
from structlearn.testbeds.obstacles.world.scenarios import Scenario, SceneParameters

NEAR, FAR = [0.4, -0.15, 0.25], [0.4, -0.45, 0.6]
SCENARIOS = [
    Scenario(number, obstacle(shape, np.array(centre)))
    for shape in SHAPES
    for number, centre in enumerate((FAR, NEAR), start=1)
]
PARAMETERS = AvoidanceEvaluationParameters(rate_hz=25.0, kept_every=1, speeds_m_s=(0.2,), pairs=12)


def steering(count, size):
    return HumanInspiredModels(size * np.ones((count, 3, 50)))


def kind(size):
    return {"setting": steering(6, size), "all": steering(1, size)} | {
        name: steering(1, size) for name in SHAPES
    }


def fitted(model, learned_from, obstacle_name, scenario, error):
    """Rows of the table of errors: 1.1 times the error held out, three times it along x."""
    rows = []
    for part, factor in (("train", 1.0), ("test", 1.1)):
        y, z = factor * error, 0.5 * factor * error
        rows.append(
            {
                "obstacle": obstacle_name,
                "scenario": scenario,
                "model": model,
                "learned_from": learned_from,
                "part": part,
                "nmse_x": 3 * y,
                "nmse_y": y,
                "nmse_z": z,
                "nmse": (3 * y + y + z) / 3,
                "dominant": "z" if scenario != 1 else "",
                "nmse_dominant": z if scenario != 1 else np.nan,
            }
        )
    return rows


def error_table(network=0.04, rai=0.6):
    rows = []
    for model, error in (("network", network), ("human_inspired", rai), ("phase_modulated", network)):
        for place, shape in enumerate(SHAPES):
            for source in (shape, "all"):
                rows += fitted(model, source, shape, 0, error)
            if model != "phase_modulated":
                for scenario in (1, 2):
                    rows += fitted(model, "setting", shape, scenario, error * (1 + 0.1 * place))
    return pd.DataFrame(rows)


@pytest.fixture(scope="module")
def results():
    primitive = baseline()
    models = AvoidanceModels(networks=kind(20.0), human_inspired=kind(2.0), phase_modulated=kind(20.0))
    situations = avoidance_protocols.situations(SCENARIOS, primitive, PARAMETERS)
    found = [avoidance_protocols.evaluate(one, models, primitive, PARAMETERS) for one in situations]
    scores, paths = (pd.concat(parts, ignore_index=True) for parts in zip(*found, strict=True))
    path = primitive.unroll(0.04)
    provenance = {"origin": "simulated"}
    people = [
        Demonstration(
            f"{number}",
            path.time,
            path.position + np.array([0, 0, 0.1 + 0.01 * number]),
            provenance=provenance,
        )
        for number in range(3)
    ]
    return ObstacleResults(
        scores=scores,
        paths=paths,
        people=avoidance_protocols.demonstration_scores([people] * len(SCENARIOS), SCENARIOS, primitive),
        errors=error_table(),
        baseline=primitive,
        scenarios=SCENARIOS,
        shown=dict.fromkeys(SHAPES, people),
        scene=SceneParameters(settings=2),
        person=AvoiderParameters(count=3),
        data=AvoidanceDataParameters(),
        training=AvoidanceTrainingParameters(per_shape=NetworkParameters(members=8)),
        evaluation=PARAMETERS,
    )


@pytest.fixture(scope="module")
def drawn(results):
    return pictures(results)


def page(results):
    links = [Link("../recordings/obstacles/unseen.rrd", "unseen.rrd")]
    return render(obstacle_page(results, {}, {"obstacle_scene": results.scene}, links))


def verdicts(results):
    return {row[0]: row[3] for row in obstacle_claims(results)}


def with_scores(results, mask, **columns):
    """The same results with other values in some scores."""
    scores = results.scores.copy()
    for name, value in columns.items():
        scores.loc[mask, name] = value
    return replace(results, scores=scores)


def test_page_shows_every_figure_and_links_only_tables_that_are_written(results, drawn):
    html = page(results)
    assert set(re.findall(r'<img src="figures/(\w+)\.png"', html)) == set(drawn)
    assert set(re.findall(r'href="tables/(\w+)\.csv"', html)) <= set(tables(results))
    assert 'href="../recordings/obstacles/unseen.rrd"' in html
    assert not re.search(r'(src|href)="(https?:)?//', html)


def test_page_says_that_it_is_simulated_and_is_the_same_every_time(results):
    html = page(results)
    assert re.search(r"<h1>[^\n]*badge", html)
    assert "on this page are simulated" in html
    assert html == page(results)
    assert not re.search(r"\bnan\b", re.sub(r"<style>.*?</style>", "", html, flags=re.DOTALL).lower())


def test_pictures_are_the_same_every_time_and_small(results, drawn, tmp_path):
    save(drawn["beyond"], tmp_path / "first.png")
    save(beyond_figure(results), tmp_path / "second.png")
    first = (tmp_path / "first.png").read_bytes()
    assert first == (tmp_path / "second.png").read_bytes()
    assert len(first) < 200_000


def test_a_millimetre_is_the_same_on_both_axes(drawn):
    for name in ("example", "unseen", "beyond"):
        for panel in drawn[name].axes:
            assert panel.get_aspect() == 1.0


def test_tables_hold_what_the_scores_say_beside_what_is_printed(results):
    table = per_setting(results).set_index(["model", "source"])
    scores = results.scores
    own = scores[(scores["protocol"] == "trained") & (scores["learned_from"] == "setting")]
    own = own[(own["model"] == "network") & (own["rules"] == "published")]
    assert table.loc[("network", "here, as published"), "goal_max"] == own["goal_distance_m"].max()
    assert table.loc[("network", "here, as published"), "obstacle_mean"] == own["obstacle_distance"].mean()
    assert table.loc[("network", "dissertation"), "obstacle_min"] == PER_SETTING["network"]["obstacle_min"]
    assert table.loc[("demonstrations", "here"), "hits"] == results.people["hit"].sum()

    shapes = per_shape(results)
    network = shapes[(shapes["model"] == "network") & (shapes["obstacle"] == "cube")]
    assert network["nmse_test"].tolist() == pytest.approx(
        [PER_SHAPE["cube"]["network"]["nmse_test"], 0.033, 0.033]  # the mean of 0.044 and 0.022
    )
    assert unseen(results)["hits"].iloc[0] == UNSEEN[""]["hits"] == 35


def test_both_kinds_of_rules_stand_side_by_side(results):
    table = limits(results).set_index(["obstacles", "model"])
    row = table.loc[("unseen", "network, per shape")]
    assert row["unrolls"] == 189
    limited = results.evaluation.postprocessing
    bare = results.rows("unseen")
    assert row["goal_limited"] <= limited.end_limit_m + bare["goal_distance_m"].max() + 1e-9
    assert row["late_goal_limited"] <= limited.late_limit_m + bare["late_goal_distance_m"].max() + 1e-9
    assert row["goal_text"] >= row["goal_limited"]
    assert ("unseen", "network, per setting") not in table.index  # they know one scenario each


def test_excursions_are_the_farthest_from_the_goal_that_holds(results):
    paths, duration = results.paths, results.baseline.duration
    change = results.situations["goal_change"].goal_change
    for protocol, goal in (("unseen", results.baseline.goal), ("goal_change", change.goals)):
        its = paths[(paths["protocol"] == protocol) & (paths["time_s"] >= duration)]
        its = its[(its["model"] == "network") & (its["learned_from"] == "cube")]
        away = np.linalg.norm(its[["x_m", "y_m", "z_m"]].to_numpy() - goal, axis=1).max()
        assert results.excursion(protocol, "network", "cube") == pytest.approx(away)
    every = [results.excursion("unseen", "network", shape) for shape in SHAPES]
    assert results.excursion("unseen", "network", SHAPES) == max(every)


def test_detours_are_from_where_the_bare_reach_is_at_the_same_time(results):
    paths = results.paths[results.paths["time_s"] <= results.baseline.duration]
    its = paths[(paths["protocol"] == "trained") & (paths["obstacle"] == "cube")]
    its = its[its["scenario"] == 2].set_index("time_s")
    avoiding = its[(its["model"] == "network") & (its["learned_from"] == "cube")]
    bare = its[its["model"] == "none"]
    position = ["x_m", "y_m", "z_m"]
    largest = np.linalg.norm(avoiding[position] - bare[position], axis=1).max()
    row = results.detours.loc[("trained", "network", "cube")]
    assert row["max"] == pytest.approx(largest)  # the other setting is far off
    assert row["mean"] < row["max"]


def test_claims_follow_the_numbers(results):
    statement = "A network per shape never hits an obstacle that it learned from"
    scores = results.scores
    network = (scores["model"] == "network") & (scores["rules"] == "limited")
    trained = network & (scores["protocol"] == "trained") & (scores["learned_from"] == "cube")
    clean = with_scores(results, scores["model"] == "network", hit=False)
    assert verdicts(clean)[statement] == "yes"
    assert verdicts(with_scores(clean, trained & (scores["scenario"] == 2), hit=True))[statement] == "no"

    statement = "A network per shape hits at most 2 of 63 unseen spheres"
    of_cube = network & (scores["protocol"] == "unseen") & (scores["learned_from"] == "cube")
    for hits, word in ((2, "yes"), (3, "no")):
        changed = with_scores(clean, of_cube & (scores["scenario"] <= hits), hit=True)
        assert verdicts(changed)[statement] == word

    statement = next(name for name in verdicts(results) if name.startswith("With limits, every unroll"))
    near = with_scores(results, scores.index >= 0, goal_distance_m=0.03, late_goal_distance_m=0.004)
    assert verdicts(near)[statement] == "yes"
    assert verdicts(with_scores(near, trained, goal_distance_m=0.041))[statement] == "no"
    assert verdicts(with_scores(near, trained, late_goal_distance_m=0.0051))[statement] == "no"


def test_claims_on_fits_follow_the_numbers(results):
    worse = "Per setting, the model of Rai et al. fits worse than the network: all three axes, held out"
    low = "A network per shape has a held-out NMSE of at most 0.20 on y and z"
    all_low = "A network per setting has an NMSE of 0.1 or lower in all scenarios"
    assert [verdicts(results)[name] for name in (worse, low, all_low)] == ["yes", "yes", "yes"]
    swapped = replace(results, errors=error_table(network=0.6, rai=0.04))
    assert [verdicts(swapped)[name] for name in (worse, low, all_low)] == ["no", "no", "no"]
    gain, _ = results.fit_gain("nmse", "test")
    assert gain == pytest.approx(1.5 * 1.1 * (0.6 - 0.04) * 1.1)  # (3 + 1 + 1/2) / 3; mean of 1, 1.1, 1.2


def test_a_world_without_dominant_axes_gives_a_page(results):
    errors = results.errors.assign(dominant="", nmse_dominant=np.nan)
    html = page(replace(results, errors=errors))
    assert "0 of 6 scenarios have a dominant axis" in html
    assert not re.search(r"\bnan\b", re.sub(r"<style>.*?</style>", "", html, flags=re.DOTALL).lower())


def test_metrics_are_flat_and_of_the_worse_axis(results, tmp_path):
    values = metrics(results)
    write_metrics(values, tmp_path / "metrics.json")  # raises on NaN
    assert json.loads((tmp_path / "metrics.json").read_text()).keys() == values.keys()
    assert values["nmse_test_sphere"] == pytest.approx(0.044)
    assert values["simulated"] is True
    limited = results.scores[results.scores["rules"] == "limited"]
    assert values["goal_distance_max_m"] == limited["goal_distance_m"].max()
    assert values["hits_unseen_baseline"] == results.rows("unseen")["hit"].sum() > 0


def test_the_example_is_the_setting_that_the_bare_reach_comes_closest_to(results):
    assert example_setting(results.scores) == 2


def test_pairs_that_are_shown_both_stand_in_the_way(results):
    number, speed = worst(results, "pair")
    place = number - 1
    length = np.linalg.norm(results.baseline.goal - results.baseline.start)
    for one in results.situations["pair"].obstacles:
        assert 0.0 < one.centre[place, 0] < length
    assert speed == 0.0
    assert worst(results, "moving")[1] == 0.2


def test_a_single_member_is_not_called_an_ensemble(results):
    single = replace(results, training=AvoidanceTrainingParameters())
    assert "is a single one, as in the dissertation" in page(single)
    assert "is the mean of 8 trained members" in page(results)
