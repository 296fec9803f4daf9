"""Past spheres, rivals see and reach what learned avoidance does, and both are scored alike."""

from itertools import product
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from committed import ROOT, committed, read_yaml

from dissertation.evidence.studies import RESULTS, read_study
from dissertation.evidence.study_cells import planned_cells, seeds_of
from dissertation.obstacles.protocol.avoidance_protocols import (
    AvoidanceEvaluationParameters,
    unseen_scenarios,
)
from dissertation.obstacles.world.reaching_person import AvoiderParameters
from dissertation.obstacles.world.scenarios import SceneParameters, scenarios
from dissertation.rivals.choice import drawn_methods
from dissertation.rivals.protocol import MODELS, NOMINAL, OURS, RIVALS
from dissertation.rivals.reaching import reaching_protocol
from dissertation.rivals.reaching.reaches import (
    SPHERE,
    coupling_samples,
    demonstrated,
    executed_reaches,
    past_places,
    reach_episodes,
    seen_sphere,
)
from dissertation.rivals.reaching.reaching_protocol import (
    FAR,
    NEAR,
    OTHER,
    UNSEEN,
    ReachingBench,
    ReachingMethodParameters,
    ReachingParameters,
    ReachingTrialParameters,
    compare_reaches,
    demonstrated_person,
    failures,
    reach_scores,
    try_reaches,
)
from structlearn.avoidance.avoidance_dataset import AvoidanceDataParameters, to_local
from structlearn.core.errors import InputError
from structlearn.core.parallel import BACKEND

TINY = {"width": 8, "layers": 1, "every": 4, "chunk": 3, "steps": 4, "batch": 3}
SMALL = {"hidden": (4,), "members": 1, "training": {"iterations": 2}}
METHODS = committed(ReachingMethodParameters, "reaching_methods", ours=SMALL, **dict.fromkeys(RIVALS, TINY))


@pytest.fixture(scope="module")
def bench():
    scene = committed(SceneParameters, "obstacle_scene", settings=4, near_share=0.5)
    data = committed(AvoidanceDataParameters, "obstacle_dataset")
    return ReachingBench(scene, data, committed(AvoidanceEvaluationParameters, "obstacle_evaluation"))


@pytest.fixture(scope="module")
def reaches(bench):
    people = committed(AvoiderParameters, "obstacle_demonstrator", baseline_count=3, count=2, seed=3)
    return demonstrated(bench.scene, people, bench.data)


def test_all_methods_learn_from_the_same_reaches(bench, reaches):
    seen, samples = reach_episodes(reaches, bench.data), coupling_samples(reaches, bench.data)
    assert len(seen) == 4 * 2 == len({*zip(samples.scenario, samples.demonstration, strict=True)})
    assert [one.setting for one in seen] == [0, 0, 1, 1, 2, 2, 3, 3]
    place, one = reaches.places[1], reaches.sets[1][0]
    np.testing.assert_array_equal(seen[2].pose[0], seen[2].task[0, :3])
    np.testing.assert_array_equal(seen[2].pose[-1], 0.0)  # it ends at its own goal
    assert seen[2].task[-1, 3] == 1.0
    centre, start = (to_local(its, reaches.baseline) for its in (place.obstacle.centre, one.position[0]))
    np.testing.assert_allclose(seen[2].touch[0, :3], centre - start, atol=2e-3)  # smoothed
    assert [len(its) for its in reaches.first(1).sets] == [1] * 4


def test_the_closest_point_of_a_sphere_is_on_it_towards_the_hand():
    hand, centre = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.1]]), np.array([0.3, 0.0, 0.0])
    found = seen_sphere(hand, centre, 0.05)
    np.testing.assert_allclose(found, [[0.3, 0, 0, 0.25, 0, 0], [0, 0, -0.1, 0, 0, -0.05]], atol=1e-12)


class Straight:
    """Moves to the goal in equal steps, whatever it sees."""

    def __init__(self, every, fastest=1.0):
        self.parameters, self.fastest, self.seen = SimpleNamespace(every=every), (fastest,), []

    def chunk(self, pose, task, sphere):
        self.seen.append((pose, task, sphere))
        ahead = task[:, 3:] + self.parameters.every / 99.0
        return task[None, :, :3] * (1.0 - np.minimum(ahead, 1.0))


def test_a_rival_reaches_past_many_spheres_at_once_and_sees_where_it_is(bench, reaches):
    baseline = reaches.baseline
    (spheres,) = unseen_scenarios(baseline).obstacles
    dt = baseline.duration / 99.0
    policy = Straight(every=3)
    path, goal = executed_reaches(policy, baseline, spheres, dt), to_local(baseline.goal, baseline)
    assert path.shape == (63, 100, 3)
    np.testing.assert_allclose(path[:, 0], 0.0, atol=1e-12)
    np.testing.assert_allclose(path[:, -1], np.tile(goal, (63, 1)), atol=1e-9)
    pose, task, sphere = policy.seen[4]
    np.testing.assert_allclose(pose + goal, path[:, 12], atol=1e-12)
    np.testing.assert_allclose(task[:, 3], 12.0 / 99.0)
    np.testing.assert_allclose(sphere[:, :3], spheres.centre - path[:, 12], atol=1e-12)
    slow = executed_reaches(Straight(4, fastest=1e-4), baseline, spheres, dt)
    np.testing.assert_allclose(np.linalg.norm(slow[:, -1], axis=1), 1e-4 * 99, rtol=0.02)


def test_a_rival_that_puts_out_nonsense_has_hit(reaches):
    situation = unseen_scenarios(reaches.baseline)
    policy = Straight(every=4)
    policy.chunk = lambda pose, *_: np.full((3, *pose.shape), np.nan)
    dt, goal = 0.01, to_local(reaches.baseline.goal, reaches.baseline)
    path = executed_reaches(policy, reaches.baseline, situation.obstacles[0], dt)
    scores = reach_scores(path, np.zeros_like(path), situation, goal, dt)
    assert scores["failed"].eq(1.0).all()
    assert scores["hit"].eq(1.0).all()
    assert scores[["goal", "detour"]].isna().all(axis=None)


def test_scores_are_those_of_the_spheres_and_the_goal(reaches):
    situation, goal = unseen_scenarios(reaches.baseline), to_local(reaches.baseline.goal, reaches.baseline)
    line = np.linspace(0.0, 1.0, 200)[:, None] * goal
    bare = np.tile(line, (63, 1, 1))
    centre, radius = situation.obstacles[0].centre, situation.obstacles[0].radius
    path = bare + np.linspace(0.0, 0.06, 200)[:, None] * [0.0, 0.0, 1.0]  # ends 60 mm from the goal
    scores = reach_scores(path, bare, situation, goal, 0.01)
    closest = np.linalg.norm(path - centre[:, None], axis=-1).min(axis=1)
    np.testing.assert_array_equal(scores["hit"], closest <= radius)
    assert 0 < scores["hit"].sum() < 63
    np.testing.assert_allclose(scores[["goal", "detour"]], 60.0)
    assert scores["failed"].eq(1.0).all()
    straight = reach_scores(bare, bare, situation, goal, 0.01)
    np.testing.assert_array_equal(straight["detour"], 0.0)
    np.testing.assert_array_equal(straight["failed"], straight["hit"])  # at the goal
    assert 0 < straight["hit"].sum() < 63


def test_a_reduced_cell_has_all_methods_at_demonstrated_and_unseen_spheres(bench, reaches, monkeypatch):
    monkeypatch.setenv(BACKEND, "sequential")
    parameters = committed(ReachingParameters, "reaching", counts=(1, 2))
    results = compare_reaches(reaches, bench, parameters, METHODS)
    found = results[results["quantity"] == "hit"].set_index(["model", "level", "part"])["value"]
    levels = [(NOMINAL, 0.0), *product(MODELS[1:], (1.0, 2.0))]
    assert set(found.index) == {(*one, part) for one, part in product(levels, (NEAR, FAR, UNSEEN))}
    assert found.between(0.0, 1.0).all()
    assert found[NOMINAL, 0.0, UNSEEN] > 0.3
    detours = results[results["quantity"] == "detour"].set_index(["model", "level", "part"])["value"]
    for model in MODELS[1:]:
        assert detours[model, 1.0, UNSEEN] != detours[model, 2.0, UNSEEN]
    assert found[OURS, 2.0, UNSEEN] < found[NOMINAL, 0.0, UNSEEN]
    with pytest.raises(InputError, match="3 demonstrations per place, of which only 2 are made"):
        compare_reaches(reaches, bench, parameters.model_copy(update={"counts": (1, 3)}), METHODS)


def test_trials_are_made_where_nobody_demonstrated_and_the_fewest_failures_win(bench, reaches, monkeypatch):
    monkeypatch.setenv(BACKEND, "sequential")
    options = {name: {key: [its] for key, its in vars(getattr(METHODS, name)).items()} for name in RIVALS}
    for name in RIVALS:
        options[name]["steps"] = [4, 40]
    options[OURS] = {key: [its] for key, its in vars(METHODS.ours).items() if key != "training"}
    options[OURS]["training"] = {key: [its] for key, its in vars(METHODS.ours.training).items()}
    options[OURS]["displaced_m"] = [0.0, 0.04]
    trials = committed(ReachingTrialParameters, "reaching_trials", trials=2, count=1)
    trials = trials.model_copy(update=options)
    results = try_reaches(reaches, bench, committed(ReachingParameters, "reaching"), trials)
    assert set(results["part"]) == {NEAR, FAR, OTHER}
    for model in MODELS[1:]:
        detours = results[results["model"].eq(model) & results["quantity"].eq("detour")]
        assert detours[detours["part"] == OTHER]["value"].nunique() == 2
    table = pd.DataFrame(
        {"quantity": "failed", "model": OURS, "level": [0.0, 0.0, 1.0, 1.0], "value": [0.1, 0.3, 0.0, 0.2]}
    )
    assert failures(table, OURS).idxmin() == 1


def test_reaches_are_learned_from_as_many_demonstrations_as_are_asked_for(bench, reaches, monkeypatch):
    monkeypatch.setattr(reaching_protocol, "_results", lambda trials, *_: trials)
    parameters = committed(ReachingParameters, "reaching", counts=(1, 2))
    trials = committed(ReachingTrialParameters, "reaching_trials", count=1)
    compared = compare_reaches(reaches, bench, parameters, METHODS)[1:]
    tried = try_reaches(reaches, bench, parameters, trials)
    assert [(one.model, one.level) for one in compared] == [*product(MODELS[1:], (1, 2))]
    assert len(tried) == 3 * trials.trials
    shown = [{len(its) for its in one.shown.sets} for one in (*compared, *tried)]
    assert shown == [{1}, {2}] * 3 + [{1}] * len(tried)


def centres(places):
    return {tuple(place.obstacle.centre) for place in places}


def test_trials_are_made_at_places_of_which_none_is_compared(monkeypatch):
    few = {
        "obstacle_scene": {"settings": 3},
        "obstacle_demonstrator": {"baseline_count": 3, "count": 1},
    }
    monkeypatch.setattr(
        reaching_protocol, "stage_parameters", lambda key, model: committed(model, key, **few.get(key, {}))
    )
    monkeypatch.setattr(reaching_protocol, "_results", lambda trials, tested, *_: tested)
    (shown, bench), (compared, its) = (demonstrated_person(tuning) for tuning in (True, False))
    scene = committed(SceneParameters, "obstacle_scene", **few["obstacle_scene"])
    assert its.scene == scene
    assert centres(compared.places) == centres(scenarios(scene, [SPHERE]))
    assert not centres(compared.places) & centres(shown.places)
    assert shown.person == compared.person
    parameters = committed(ReachingParameters, "reaching")
    trials = committed(ReachingTrialParameters, "reaching_trials", count=1)
    (near, _), (other, parts) = try_reaches(shown, bench, parameters, trials)
    assert set(parts) == {OTHER}
    demonstrated_there = past_places(shown.places, shown, bench.data).obstacles[0].centre
    compared_there = past_places(compared.places, shown, bench.data).obstacles[0].centre
    np.testing.assert_array_equal(near.obstacles[0].centre, demonstrated_there)
    for places in (demonstrated_there, compared_there):
        apart = other.obstacles[0].centre[:, None] - places
        assert np.linalg.norm(apart, axis=-1).min() > 1e-3


def test_what_was_chosen_past_spheres_is_what_is_compared():
    study = read_study("rivals/reaching_choice", ROOT / RESULTS)
    if study is None:
        pytest.skip("no trials were made yet")
    trials = committed(ReachingTrialParameters, "reaching_trials")
    methods = committed(ReachingMethodParameters, "reaching_methods")
    for model in MODELS[1:]:
        best = failures(study.results, model).idxmin()
        assert getattr(methods, model) == drawn_methods(model, trials)[int(best)]


def test_nobody_who_reaches_was_tuned_on_or_is_in_another_study():
    people = {seed for cell in planned_cells("rivals/reaching", ROOT) for seed in seeds_of(cell)}
    choosing = {seed for cell in planned_cells("rivals/reaching_choice", ROOT) for seed in seeds_of(cell)}
    population = read_yaml(ROOT / "params.yaml")["obstacle_people"]
    others = {seed for cell in planned_cells("obstacles/people", ROOT) for seed in seeds_of(cell)}
    assert len(people) >= 12
    assert choosing <= set(population["tuning"])
    assert not people & {*population["tuning"], *population["test"], *others}
