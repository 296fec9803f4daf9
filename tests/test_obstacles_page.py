"""Page and recordings of the obstacle testbed, on a small world with models that steer away."""

import re
from importlib.resources import files

import numpy as np
import pandas as pd
import pytest
import reporting_verdicts
import yaml
from committed import ROOT, committed, read_yaml
from markupsafe import escape
from obstacles_world import PEOPLE, PLACES, POPULATION, PRIMITIVE, TESTED, demonstrations, evaluation
from viewer_files import colour_of, contents, note, values, view_names

from dissertation.evidence.claims import read_claims
from dissertation.evidence.results import Results, with_study
from dissertation.evidence.studies import Study, StudyProvenance, digests
from dissertation.obstacles.names import FREE, HIT, KINDS, SOURCES, fitted_name
from dissertation.obstacles.page.findings import OURS, counts, findings, read_published
from dissertation.obstacles.page.page import PACKAGE, document
from dissertation.obstacles.page.shown import Shown
from dissertation.obstacles.protocol import avoidance_protocols, unrolled_reaches
from dissertation.obstacles.protocol.avoidance_fits import AvoidanceTrainingParameters
from dissertation.obstacles.protocol.avoidance_protocols import LIMITED, PUBLISHED
from dissertation.obstacles.protocol.results import DEMONSTRATED, obstacle_results
from dissertation.obstacles.recordings import demonstrated_avoidance as drawn
from dissertation.obstacles.recordings.unseen_avoidance import unseen
from dissertation.obstacles.world.reaching_person import AvoiderParameters
from dissertation.obstacles.world.scenarios import SceneParameters
from structlearn.avoidance.avoidance_dataset import AvoidanceDataParameters
from structlearn.avoidance.shapes import SHAPES
from structlearn.reporting.document import render
from structlearn.reporting.evidence import in_words
from structlearn.viewer.recording import write


def error_table(network=0.04, rai=0.6):
    """1.1 times the error held out, three times it along x, half of it along z; person 1 has no axis."""
    rows = []
    kinds = (
        ("network", network),
        ("ensemble", 2 * network),
        ("human_inspired", rai),
        ("phase_modulated", network),
    )
    keys = [(person, setting, *kind) for setting, person in enumerate(PEOPLE, start=1) for kind in kinds]
    for person, setting, model, error in keys:
        for place, shape in enumerate(SHAPES):
            sources = [(shape, 0)] + ([("all", 0)] if model != "human_inspired" else [])
            sources += [("setting", setting)] if model in ("network", "human_inspired") else []
            for (source, scenario), part in ((one, part) for one in sources for part in ("train", "test")):
                size = error * (1 + 0.01 * person) * (1.02 if source == "all" and place == 0 else 1.0)
                y = size * (1 + 0.1 * place * bool(scenario)) * (1.1 if part == "test" else 1.0)
                nmse = {"nmse_x": 3 * y, "nmse_y": y, "nmse_z": 0.5 * y, "nmse": 1.5 * y}
                axis = {"dominant": "z", "nmse_dominant": 0.5 * y}
                none = {"dominant": "", "nmse_dominant": np.nan}
                row = {"person": person, "obstacle": shape, "scenario": scenario, "model": model}
                row |= {"learned_from": source, "part": part} | nmse
                rows.append(row | (axis if scenario > 1 else none))
    return pd.DataFrame(rows)


def parameters():
    return {
        "obstacle_scene": committed(SceneParameters, "obstacle_scene", settings=3),
        "obstacle_demonstrator": committed(AvoiderParameters, "obstacle_demonstrator", count=3),
        "obstacle_dataset": committed(AvoidanceDataParameters, "obstacle_dataset"),
        "obstacle_training": committed(AvoidanceTrainingParameters, "obstacle_training"),
        "obstacle_evaluation": TESTED,
    }


@pytest.fixture(scope="module")
def results():
    """What the evaluating stages wrote."""
    scores, _, demonstrated = evaluation()
    words = scores.select_dtypes("str").columns  # as categories they are copied in no time
    scores = scores.astype(dict.fromkeys(words, "category"))
    return {"scores": scores, "demonstrated": demonstrated, "errors": error_table()}


def many(results, times=40):
    """The same with so many times as many reaches of everyone: rates have narrow intervals then."""
    return results | {"scores": pd.concat([results["scores"]] * times)}


def rare(results, column, value):
    """The same with a value in the first reach of every person with every model in every protocol alone."""
    scores = results["scores"].copy()
    first = ~scores.duplicated(["person", "protocol", "model", "learned_from", "rules"])
    scores.loc[first, column] = value
    return results | {"scores": scores}


def find(results):
    return findings(population(results))


def population(results, study=None):
    return with_study(obstacle_results(**results), study, "person", POPULATION.test)


def verdicts(found):
    return reporting_verdicts.verdicts(PACKAGE, found)


@pytest.fixture(scope="module")
def found(results):
    return find(results)


def with_scores(results, chosen=None, **columns):
    """The same with other values in the scores of some rows, given as wanted values by column."""
    scores = results["scores"].copy()
    mask = np.ones(len(scores), dtype=bool)
    for name, value in (chosen or {}).items():
        mask &= scores[name] == value
    scores.loc[mask, list(columns)] = list(columns.values())
    return results | {"scores": scores}


RECORDED = pd.DataFrame(
    {"share": 0.4, "low": 0.1, "high": 0.7, "people": 9},
    index=pd.MultiIndex.from_product([["clearance_m", "movement_s"], ["shared"]]),
)


def shown_of(results):
    demonstrated = dict.fromkeys(SHAPES, demonstrations())
    tables = results["scores"], evaluation()[1], results["demonstrated"]
    return Shown(*tables, PRIMITIVE, PLACES, demonstrated, POPULATION, RECORDED, parameters())


def rendered(results, study=None):
    """The page without its figures being drawn."""
    people = population(results, study)
    page = document(people, shown_of(results), findings(people), study)
    return render(page, reporting_verdicts.AnyFigure())


def study_of(results, offset=100, values=None):
    """The same people under other seeds, as a study made with these values of parameters."""
    table = obstacle_results(**results)
    table = table[table["person"] != POPULATION.shown]
    keys = [
        f"obstacle_{name}"
        for name in ["dataset", "demonstrator", "evaluation", "people", "scene", "training"]
    ]
    seeds = ["obstacle_people.test"]
    made = {"parameters": digests(values or read_yaml(ROOT / "params.yaml"), keys, seeds), "seeds": seeds}
    provenance = StudyProvenance(**made, cells={}, check=None)
    return Study(table.assign(person=table["person"] + offset), provenance)


def find_among_many(results):
    """Findings with a study of many more people like these: rates have narrow intervals then."""
    study = study_of(results)
    people = [study.results.assign(person=study.results["person"] + 100 * more) for more in range(20)]
    return findings(population(results, Study(pd.concat(people), study.made)))


def test_the_table_of_results_has_sums_and_extremes_over_reaches(results):
    table = Results(obstacle_results(**results), "person", POPULATION.test)
    keys = {"protocol": "trained", "model": "network", "learned_from": "sphere", "rules": PUBLISHED}
    own = results["scores"]
    own = own[(own[list(keys)] == pd.Series(keys)).all(axis=1) & (own["person"] == 11)]
    assert table.each("reaches", **keys)[11] == len(own) == 3
    assert table.each("hits", **keys)[11] == own["hit"].sum()
    assert table.each("largest_goal_distance", **keys)[11] == own["goal_distance_m"].max()
    assert table.each("closest", **keys)[11] == own["obstacle_distance"].min()
    per_setting = table.rows("nmse", learned_from="setting", axis="y", part="test", model="network")
    assert per_setting["setting"].tolist() == [2.0] * 3 + [3.0] * 3
    people = table.rows("reaches", model=DEMONSTRATED, learned_from="setting")
    assert people["value"].tolist() == [3] * 6  # of the scenarios with networks per setting


def test_findings_are_those_of_the_scores(results, found):
    values = found.numbers()
    assert values["people"] == 2
    scores = results["scores"]
    limited = scores[(scores["rules"] == LIMITED) & (scores["person"] != 1)]
    assert found["goal_with_limits"]["prescribed time"].value == pytest.approx(
        100 * limited["goal_distance_m"].max()
    )
    bare = limited[(limited["model"] == "none") & (limited["protocol"] == "unseen")]
    assert values["hits_without_unseen"] == bare["hit"].sum() > 0
    errors = 0.66 * np.array([1.11, 1.12]) * 0.75  # of y and half of it
    assert values["rai_across_settings"] == pytest.approx(np.sqrt(errors.prod()))


def test_verdicts_are_over_people_of_the_study_too_and_the_page_says_how_many_are_of_this_run(
    results, found, root, monkeypatch
):
    monkeypatch.chdir(root)
    study = study_of(results)
    people = population(results, study)
    assert not people.moved
    alone, together = found.numbers(), findings(people).numbers()
    assert together["people"] == 4
    assert together["hits_without_unseen"] == 2 * alone["hits_without_unseen"]
    assert together["rai_across_settings"] == pytest.approx(alone["rai_across_settings"])
    page = rendered(results, study)
    assert "over all 4 people" in page
    assert "with parameters that differ" not in page


def test_rows_of_earlier_stages_keep_the_study_when_a_parameter_of_a_late_one_changed(
    results, root, tmp_path, monkeypatch
):
    values = dict(read_yaml(root / "params.yaml"))
    study = study_of(with_scores(results, {"model": "human_inspired"}, hit=True), values=values)
    values["obstacle_evaluation"] = {**values["obstacle_evaluation"], "pair_seed": 1}
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(values))
    (tmp_path / "dvc.yaml").write_text((root / "dvc.yaml").read_text())
    monkeypatch.chdir(tmp_path)
    people = population(results, study)
    assert people.moved
    evidence = findings(people)
    assert (evidence["rai_across_settings"].n, evidence["rai_across_settings"].remark) == (4, "")
    hit = evidence["rai_hits_more"]
    assert hit.n == 2
    assert hit.remark.endswith("with other parameters")
    nobody = {name: table[table["person"] == POPULATION.shown] for name, table in results.items()}
    one = findings(population(nobody, study))
    assert one["rai_across_settings"].n == 2
    assert one["detour_pair"]["all"].remark.startswith("one person; ")
    assert "with parameters that differ" in rendered(results, study)


def test_hits_are_counted_by_person(results):
    clean = with_scores(results, {"model": "ensemble"}, hit=False)
    own = {"model": "ensemble", "learned_from": "cube", "protocol": "unseen", "rules": LIMITED, "person": 12}
    hit = with_scores(clean, own | {"person": 1}, hit=True)  # nothing is judged on who is shown
    for number in (1, 2):
        hit = with_scores(hit, own | {"scenario": number}, hit=True)
        seen = find(hit)
        by_person = counts(population(hit).results, "unseen", OURS, "cube")["hits"]
        assert by_person.to_dict() == {11: 0, 12: number}
        assert seen["people_within"]["cube"].count == 3 - number
        assert verdicts(seen)["people_within"] == ("yes" if number == 1 else "no")


def test_the_text_s_form_decides_what_the_text_says_and_ours_what_this_project_says(results):
    def found(results):
        return verdicts(find_among_many(results))

    clean, ours = with_scores(results, hit=False), ["hits_per_shape", "hits_unseen"]
    never = ["hits_per_setting", "single_hits_per_shape"]
    assert {found(clean)[name] for name in (*never, *ours, "single_hits_unseen")} == {"yes"}
    assert {found(rare(clean, "hit", True))[name] for name in never} == {"no"}
    for model, rules, mine, other in (
        ("network", PUBLISHED, ["single_hits_unseen"], ours),
        ("ensemble", LIMITED, ours, ["single_hits_unseen"]),
    ):
        (wrong,) = {PUBLISHED, LIMITED} - {rules}
        hit = found(with_scores(clean, {"model": model, "rules": wrong}, hit=True))
        assert {hit[name] for name in mine} == {"yes"}
        hit = found(with_scores(clean, {"model": model, "rules": rules, "protocol": "unseen"}, hit=True))
        assert [hit[name] for name in (mine[-1], *other)] == ["no", *("yes" for _ in other)]


def test_hits_stand_beside_those_without_avoidance(results):
    clean = with_scores(with_scores(results, hit=False), {"model": "none"}, hit=True)
    its = find(clean)
    assert in_words(its["hits_per_setting"], "count") == "0 of 6 (are hit; without avoidance 100.0 %)"
    assert its["hits_unseen"]["all"].remark == "are hit; without avoidance 100.0 %"
    assert verdicts(its)["hits_per_setting"] == "yes"
    assert its["unseen_against_none"].value == 100.0


def test_bounds_are_what_is_printed(results):
    printed = read_published()
    of = {claim.evidence: claim for claim in read_claims(files(PACKAGE) / "claims.yaml")}
    assert of["goal_of_rai"].bound == printed["per_setting"]["human_inspired"]["goal_max"]
    goals = of["converged"].bound
    assert goals["per setting"] == printed["per_setting"]["network"]["goal_max"]
    assert goals["trained"] == max(printed["per_shape"][shape]["network"]["goal_max"] for shape in SHAPES)
    unseen = [printed["unseen"][shape] for shape in SHAPES]
    assert goals["unseen"] == max(max(one["goal_max"], one["goal_mean"]) for one in unseen)
    errors = [printed["per_shape"][shape]["network"]["nmse_test"] for shape in SHAPES]
    assert of["single_of_all_shapes"].margin.size == pytest.approx(0.1 * np.mean(errors), abs=5e-5)
    drop = printed["unseen"]["none"]["hits"] - np.mean([one["hits"] for one in unseen])
    assert of["unseen_against_none"].bound == pytest.approx(50 * drop / 63, abs=0.05)
    people, rai = (printed["per_setting"][name] for name in ("demonstrations", "human_inspired"))
    low, _ = of["distances_like_people"].bound
    assert low == pytest.approx(rai["obstacle_mean"] - people["obstacle_mean"])
    assert of["goals_like_people"].bound[1] == pytest.approx(1e3 * (rai["goal_mean"] - people["goal_mean"]))


def test_claims_on_goals_follow_the_numbers(results):
    near = many(
        with_scores(results, goal_distance_m=0.03, late_goal_distance_m=0.004, excursion_m=0.03, detour_m=0.1)
    )
    found = verdicts(find(near))
    names = ("goal_with_limits", "excursions", "detour_pair", "converged")
    assert {found[name] for name in names} == {"yes"}
    rai = {"model": "human_inspired", "learned_from": "setting", "rules": PUBLISHED}
    one = rai | {"person": 12, "protocol": "trained", "obstacle": "cube"}
    assert verdicts(find(with_scores(near, one, goal_distance_m=1.3)))["goal_of_rai"] == "yes"
    far = verdicts(find(rare(near, "goal_distance_m", 0.125)))
    assert (far["converged"], far["goal_of_rai"]) == ("no", "no")
    per_case = reporting_verdicts.cases(PACKAGE, find(rare(near, "goal_distance_m", 0.125)))["converged"]
    assert per_case == {"per setting": "no", "trained": "yes", "unseen": "no"}


def test_claims_on_fits_follow_the_numbers(results, found):
    names = ("rai_fits_worse", "rai_dominant", "rai_across_settings", "error_per_shape")
    swapped = results | {"errors": error_table(network=0.6, rai=0.04)}
    here, lost = verdicts(found), verdicts(find(swapped))
    assert {here[name] for name in names} == {"yes"}
    assert {lost[name] for name in names} == {"no"}
    assert (here["high_errors"], lost["high_errors"]) == ("yes", "no")
    blind = results | {"errors": results["errors"].assign(dominant="", nmse_dominant=np.nan)}
    unseen = find(blind)
    assert {verdicts(unseen)[name] for name in ("high_dominant", "rai_dominant")} == {"not tested"}
    assert not re.search(r"\bnan\b", rendered(blind))


def test_what_is_not_tested_is_listed_with_the_reason(results):
    page = rendered(results)
    for one in read_yaml(files(PACKAGE) / "untested.yaml"):
        assert set(one) == {"statement", "source", "why"}
        assert str(escape(one["why"])) in page


UNSEEN = avoidance_protocols.unseen_scenarios(PRIMITIVE)


def own_scores():
    scores, _, _ = evaluation()
    return scores[scores["person"] == POPULATION.shown]


@pytest.fixture(scope="module")
def reaches():
    return unrolled_reaches.reaches_by_situation(evaluation()[1], own_scores(), PRIMITIVE)


@pytest.fixture(scope="module")
def shown(reaches):
    """The first setting of every shape."""
    samples = pd.DataFrame(
        {"scenario": [0, 0, 3, 3, 6, 6], "demonstration": [0, 1] * 3, "time_s": 6 * [0.5]}
    ).assign(target_x=0.0, target_y=np.arange(6.0), target_z=1.0)
    names = [place.name for place in PLACES[::3]]
    return drawn.shown_scenarios(PLACES, names, lambda _: demonstrations(), samples, reaches, 30)


def test_reaches_are_those_of_the_tables(reaches):
    its, found = reaches[unrolled_reaches.SituationKey("trained", "cube", 2)], own_scores()
    assert unrolled_reaches.without_avoidance(its) is its[0]
    scores = found[(found["protocol"] == "trained") & (found["obstacle"] == "cube")]
    scores = scores[(scores["scenario"] == 2) & (scores["rules"] == avoidance_protocols.LIMITED)]
    scores = scores.set_index(["model", "learned_from"])
    assert len(its) == len(scores)
    for reach in its:
        row = scores.loc[(reach.model, reach.learned_from)]
        assert (reach.obstacle_distance, reach.hit) == (row["obstacle_distance"], row["hit"])
    assert sum(len(reach.time) for group in reaches.values() for reach in group) == len(evaluation()[1])
    x = (PRIMITIVE.goal - PRIMITIVE.start) / np.linalg.norm(PRIMITIVE.goal - PRIMITIVE.start)
    np.testing.assert_allclose(its[1].coupling_in_base @ x, its[1].coupling[:, 0], atol=1e-9)
    assert np.abs(its[1].coupling).max() > 0.1


@pytest.mark.parametrize("shape", SHAPES)
def test_a_solid_is_as_large_as_its_obstacle_and_turned_as_far(tmp_path, shown, shape):
    path = tmp_path / "trained.rrd"
    one = next(one for one in shown if one.scenario.shape == shape)
    write(path, drawn.trained([one]))
    kind = {"sphere": "Ellipsoids3D", "cube": "Boxes3D", "cylinder": "Cylinders3D"}[shape]
    solid = {
        name: np.array(values(path, f"/{shape}\\/01/obstacle/solid", f"{kind}:{name}"), float).squeeze()
        for name in ("centers", "quaternions", "half_sizes", "lengths", "radii")
    }
    np.testing.assert_allclose(solid["centers"], one.scenario.obstacle.centre, rtol=1e-6)
    np.testing.assert_allclose(solid["quaternions"], [0.0, 0.0, np.sin(0.25), np.cos(0.25)], atol=1e-6)
    half = one.scenario.obstacle.half_size
    if shape == "cylinder":
        np.testing.assert_allclose([solid["radii"], solid["lengths"]], [half[0], 2 * half[2]], rtol=1e-6)
    else:
        np.testing.assert_allclose(solid["half_sizes"], half, rtol=1e-6)


def test_models_stand_beside_the_demonstrations_that_they_learned_from(tmp_path, shown):
    path = tmp_path / "trained.rrd"
    write(path, drawn.trained(shown))
    rows, _, timelines = contents(path)
    assert timelines == {"time"}
    for one in shown:
        tab = f"/{one.scenario.shape}\\/01"
        for reach in one.reaches[1:]:
            look = SOURCES[reach.learned_from]
            label, samples = look.name.replace(" ", "\\ "), len(reach.time)
            scene = f"{tab}/{reach.model}/{label}"
            assert rows[f"{scene}/hand"] == rows[f"{tab}/distance/{reach.model}/{label}"] == samples
            assert rows[f"{tab}/terms/{reach.model}/upwards/{label}"] == samples
            assert colour_of(path, f"{scene}/path", "LineStrips3D") == look.colour
            assert f" {fitted_name(reach.model, reach.learned_from)} |" in note(path, f"/notes{tab}")
        origins = values(path, f"{tab}/network/per\\ setting/coupling", "Arrows3D:origins")[0]
        np.testing.assert_allclose(origins, one.reaches[1].position[:: drawn.ARROW_EVERY], atol=1e-6)
        assert rows[f"{tab}/demonstrated\\ terms/to\\ the\\ left/1"] == 1
    assert {look.name for kind, look in KINDS.items() if kind != "none"} <= set(view_names(path))


def test_every_unseen_sphere_is_a_step_with_its_colour_and_paths(tmp_path, reaches):
    path = tmp_path / "unseen.rrd"
    write(path, unseen(UNSEEN, unrolled_reaches.groups_of(UNSEEN, reaches), PRIMITIVE))
    rows, _, timelines = contents(path)
    assert timelines == {"sphere"}
    for name in (*SHAPES, "all"):
        assert rows[f"/one/paths/{name}"] == rows[f"/closest/{name}"] == 63
        assert colour_of(path, f"/all/{name}", "LineStrips3D") == SOURCES[name].colour
    assert rows["/one/sphere"] == rows["/closest/no\\ avoidance"] == 63
    hit = {number for _, number in unrolled_reaches.hit_settings(reaches, "unseen")}
    assert 0 < len(hit) < 63
    expected = [(HIT if number in hit else FREE).colour for number in range(1, 64)]
    colours = values(path, "/one/sphere/cloud", "Points3D:colors")
    assert [f"#{one[0] >> 8:06x}" for one in colours] == expected
    assert len(values(path, "/notes/sphere", "TextDocument:text")) == 63
    assert f"| {KINDS['none'].name} | {len(hit)} |" in note(path)
    assert "simulated" in note(path)
