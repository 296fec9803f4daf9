"""Reaches past obstacles, made up and public: folds, learning, page, representations."""

from dataclasses import replace
from functools import lru_cache
from itertools import product

import numpy as np
import pandas as pd
import pytest
from committed import committed, committed_entry
from readers_bags import recorded_data

from dissertation.evidence.claims import read_claims
from dissertation.recorded.coupling import learning as coupling_representations
from dissertation.recorded.coupling import page as section
from dissertation.recorded.readers import coupling_samples
from structlearn.avoidance import scene_models
from structlearn.avoidance.avoidance_dataset import AvoidanceDataset
from structlearn.avoidance.features import obstacle_features
from structlearn.avoidance.scene_reaches import ONSET_SHARE, SceneLearningParameters, reaches_past_obstacles
from structlearn.core.errors import InputError, MissingInputError
from structlearn.core.rates import rate_interval
from structlearn.core.signals import minimum_jerk
from structlearn.primitives import canonical, kernels
from structlearn.primitives.position import fit_position
from structlearn.readers.demonstration import Demonstration, NamedShape
from structlearn.tasks.obstacles import learning
from structlearn.tasks.obstacles.learning import ALL_MODELS, MODELS, folds_of_people, learn_past_obstacles
from structlearn.tasks.obstacles.page import SceneWays, scene_findings, scene_pictures

BOXES = {"walls": ["boundary"], "reaches": {"longest_s": 4.0}}
QUICK = {"folds": 2, "network": {"members": 1, "training": {"iterations": 4}}}
QUICK |= {"published_network": {"training": {"iterations": 4}}}
PARAMETERS = committed(SceneLearningParameters, "defaults.obstacles", tuned_on=["p0"], **BOXES, **QUICK)
RATE_HZ, REST_S, MOVE_S = 90.0, 0.6, 1.5
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
WALLS = [
    NamedShape(f"boundary {side}", "cube", np.array([x, -0.05, 0.8]), UPRIGHT, np.array([0.02, 0.6, 0.13]))
    for side, x in (("left", -0.36), ("right", 0.36))
]


def made_up_trial(person, number, bow=0.0, x=0.0, move_s=MOVE_S, late_s=0.2):
    """A hand that rests, reaches 0.4 m forward with a bow of so many m to the right, and rests."""
    time = np.arange(0.0, move_s + 2 * REST_S, 1.0 / RATE_HZ)
    share = minimum_jerk(np.clip((time - REST_S) / move_s, 0.0, 1.0))
    side = 0.03 * number + bow * np.sin(np.pi * share)
    position = np.column_stack([side, -0.25 + 0.4 * share, 0.78 + 0.02 * np.sin(np.pi * share)])
    box = NamedShape("box A", "cube", np.array([x, -0.05, 0.79]), UPRIGHT, np.array([0.1, 0.05, 0.12]))
    known = {"person": person, "moved_s": f"{REST_S + late_s}", "reached_s": f"{REST_S + move_s}"}
    known["origin"] = "recorded"
    return Demonstration(f"{person}_{number}", time, position, provenance=known, shapes=(box, *WALLS))


@lru_cache
def made_up_reaches():
    """Three people, each with a blocked reach, a free one and another blocked one."""
    trials = [
        made_up_trial(f"p{place}", number, bow, x)
        for place in range(3)
        for number, bow, x in (
            (0, 0.12 + 0.01 * place, 0.0),
            (1, 0.01, -0.2),
            (2, -0.12 - 0.01 * place, 0.08),
        )
    ]
    return reaches_past_obstacles(trials, PARAMETERS)


@lru_cache
def made_up_results():
    reaches, left_out = made_up_reaches()
    folds = folds_of_people(reaches, PARAMETERS)
    return learning.judge_folds(reaches, left_out, folds, PARAMETERS)


def test_a_reach_begins_at_its_onset_and_ends_at_the_target():
    (reach,), left_out = reaches_past_obstacles([made_up_trial("p1", 0, 0.1)], PARAMETERS)
    assert left_out.empty
    speed = np.gradient(minimum_jerk(np.linspace(0.0, 1.0, 2001)))
    begins = MOVE_S * np.argmax(speed > ONSET_SHARE * speed.max()) / 2000
    assert reach.duration_s == pytest.approx(MOVE_S - begins, abs=0.04)
    assert np.allclose(reach.in_base_frame[-1], [0.0, 0.15, 0.78], atol=2e-3)
    assert np.allclose(reach.path.position[0], 0.0)
    assert np.allclose(reach.goal[1:], 0.0)  # x points to the goal
    assert (len(reach.obstacles), len(reach.walls)) == (1, 2)
    peak = np.abs(reach.path.velocity).max()
    slope = np.gradient(reach.path.position, reach.path.time, axis=0)
    assert np.abs(slope - reach.path.velocity).max() < 0.1 * peak


def test_reaches_are_left_out_with_their_reason():
    """They take long, jump, or their times are not of the recording."""
    long, jumping = made_up_trial("p1", 1, move_s=6.0, late_s=2.0), made_up_trial("p2", 2)
    position = jumping.position.copy()
    position[100] += 0.2
    late = made_up_trial("p3", 0)
    late = replace(late, provenance=late.provenance | {"moved_s": "100", "reached_s": "101"})
    trials = [long, replace(jumping, position=position), late]
    reaches, left_out = reaches_past_obstacles(trials, PARAMETERS)
    assert (reaches, left_out["trial"].tolist()) == ([], ["p1_1", "p2_2", "p3_0"])
    prefixes = ("takes 5.", "tracking jumps, 31", "does not move before it ends")
    assert all(map(str.startswith, left_out["reason"], prefixes))


def test_a_recording_begins_with_its_slowest_sample_or_without_times_with_the_motion():
    trial = made_up_trial("p1", 0, 0.1)
    first = int((REST_S + 0.15 * MOVE_S) * RATE_HZ)
    shift = trial.time[first] - 0.1
    known = {key: f"{float(trial.provenance[key]) - shift}" for key in ("moved_s", "reached_s")}
    time, position = trial.time[first:] - trial.time[first], trial.position[first:]
    late = replace(trial, time=time, position=position, provenance=trial.provenance | known)
    (reach,), _ = reaches_past_obstacles([late], PARAMETERS)
    assert reach.in_base_frame[0] == pytest.approx(late.position[0], abs=2e-3)
    (reach,), _ = reaches_past_obstacles([replace(trial, provenance={"person": "p1"})], PARAMETERS)
    assert reach.duration_s == pytest.approx(MOVE_S, abs=0.2)
    assert reach.in_base_frame[[0, -1]] == pytest.approx(trial.position[[0, -1]], abs=5e-3)


def test_trials_must_say_whose_they_are_and_have_obstacles():
    trial = made_up_trial("p1", 0)
    with pytest.raises(InputError, match="p1_0: has no obstacles, nor have the others; name"):
        reaches_past_obstacles([replace(trial, shapes=WALLS)], PARAMETERS)
    with pytest.raises(InputError, match="p1_0: its provenance does not say whose"):
        reaches_past_obstacles([replace(trial, provenance={})], PARAMETERS)
    reaches, left_out = reaches_past_obstacles([trial, replace(trial, name="free", shapes=())], PARAMETERS)
    assert [reach.name for reach in reaches] == ["p1_0"]
    assert left_out[["trial", "reason"]].to_numpy().tolist() == [["free", "has no obstacles"]]


def test_nobody_is_judged_by_what_was_learned_from_them():
    results = made_up_results()
    assert set(results.reaches["person"]) == {"p1", "p2"}  # p0 is only learned from
    assert results.reaches.groupby("person")["fold"].nunique().eq(1).all()
    assert results.reaches.groupby("model").size().to_dict() == dict.fromkeys(learning.ALL_MODELS, 6)
    # pictures are chosen by the scene alone
    assert results.paths["reach"].unique().tolist() == ["p1_0", "p1_2", "p2_0", "p2_2"]
    shuffled = results.reaches.assign(hit=~results.reaches["hit"]).sample(frac=1.0, random_state=0)
    assert learning.pictured_reaches(shuffled) == ["p1_0", "p1_2", "p2_0", "p2_2"]


def test_few_people_are_left_out_one_at_a_time():
    reaches, _ = made_up_reaches()
    more = PARAMETERS.model_copy(update={"folds": 3})
    assert folds_of_people(reaches, more) == [["p1"], ["p2"]]
    assert folds_of_people(reaches[:6], more) == [["p1"]]  # p0 is learned from
    assert folds_of_people(reaches[3:], more) == [["p1"], ["p2"]]
    anybody = more.model_copy(update={"tuned_on": ()})  # dealt out by how straight they reach
    assert folds_of_people(reaches, anybody) == [["p0"], ["p1"], ["p2"]]
    for few in (reaches[:3], reaches[3:6]):
        with pytest.raises(MissingInputError, match=r"reaches of 1 people, \d of them on whom nothing"):
            folds_of_people(few, more)


def test_scores_tell_blocked_from_free_and_the_sides():
    rows = made_up_results().reaches.set_index(["model", "reach"])
    none = rows.loc["none"]
    assert none["blocked"].tolist() == [True, False, True] * 2
    assert none["hit"].tolist() == [True, False, True] * 2
    assert none["clearance_mm"].to_numpy()[[1, 4]].min() > 100
    planned = rows.loc["planned"]
    assert not planned["hit"].any()
    assert planned["left_mm"].max() < 1e-6
    assert planned.loc["p1_1", "same_gaps"]
    assert rows.loc["scene", "left_mm"].max() < 1e3 * scene_models.END_LIMIT_M + 5.0
    reaches, _ = made_up_reaches()
    own = np.array([reach.in_base_frame for reach in reaches])  # who is the same as themselves
    rows = learning.reach_scores(reaches, own, np.zeros(len(own)), PARAMETERS.hand_radius_m)
    assert (rows["same_gaps"].all(), rows["path_mm"].max()) == (True, 0.0)
    pairs = learning.beside_each_other(reaches)
    assert len(pairs) == 9  # three scenes, three pairs of people
    assert (pairs["path_mm"].max() < 30.0, pairs["same_gaps"].all()) == (True, True)


def test_the_text_sees_the_nearest_box():
    reaches, _ = made_up_reaches()
    scenes = scene_models.reach_scenes(reaches, PARAMETERS)
    rng = np.random.default_rng(0)
    position, velocity = rng.normal(0.1, 0.1, (2, len(reaches), 3))
    clouds = np.stack([scenes.clouds[:, 0] + [0.0, 0.5, 0.0], scenes.clouds[:, 0]], axis=1)
    seen, x = scene_models.nearest_seen(position, velocity, clouds)
    near = clouds[:, 1]
    expected = obstacle_features(position, velocity, 1.0, near, near.mean(axis=1))
    assert np.allclose(seen, expected)
    assert np.allclose(x, near[..., 0])


def test_without_feedback_it_is_the_primitive_and_with_its_target_the_demonstration():
    reaches, _ = made_up_reaches()
    baseline = scene_models.straight_baseline(reaches)
    bent = [one for one in reaches if one.name.endswith("_0")]  # none is straight, the first straightest
    alone, both = (scene_models.straight_baseline(some) for some in (bent[:1], bent))
    assert np.array_equal(alone.unroll(0.01, duration=1.0).position, both.unroll(0.01, duration=1.0).position)
    goals, samples = np.array([reach.goal for reach in reaches]), PARAMETERS.reaches.samples
    alone = scene_models.unroll_through(baseline, goals, None, samples)
    one = baseline.unroll(1.0 / (samples - 1), start=np.zeros(3), goal=goals[0], duration=1.0)
    assert np.allclose(alone.position[0], one.position)
    states = scene_models.scene_states([reach.path for reach in reaches], baseline, 1)
    target = states.target.reshape(len(reaches), samples, 3)
    shown = scene_models.unroll_through(baseline, goals, lambda k, x, v: target[:, k], samples)
    own = np.array([reach.path.position for reach in reaches])
    assert np.abs(shown.position - own).max() < 0.015  # of 0.12; it begins as the baseline's reaches did
    assert np.abs(alone.position - own).max() > 0.1
    pushed = scene_models.unroll_through(
        baseline, goals, lambda k, x, v: np.full(x.shape, 40.0), samples, 0.02, 20.0
    )
    left = np.linalg.norm(pushed.position[:, -1] - alone.position[:, -1], axis=1)
    assert left.max() < 0.02 + 1e-9
    assert np.abs(pushed.position - alone.position).max() > 0.05


def test_states_elsewhere_lead_back():
    reaches, _ = made_up_reaches()
    baseline = fit_position([reach.path for reach in reaches]).local
    states = scene_models.scene_states([reach.path for reach in reaches], baseline, 10)
    beside = scene_models.displaced_states(states, PARAMETERS.network, (0, 0))
    count = len(states.time)
    assert len(beside.time) == 2 * count
    assert np.array_equal(beside.position[:count], states.position)
    off = beside.position[count:] - states.position
    assert np.allclose(beside.target[count:], states.target - 60.0 * off)
    assert 0.5 < off.std() / PARAMETERS.network.displaced_m < 1.5
    few = PARAMETERS.network.model_copy(update={"demonstrations": 2})
    assert len(np.unique(scene_models.displaced_states(states, few, (0, 0)).scene)) == 2
    scenes = scene_models.reach_scenes(reaches, PARAMETERS)
    dataset = scene_models.samples_of_scene(states, scenes)
    one = states.where(states.scene == 4)
    alone = scene_models.samples_of_scene(one, scenes)
    assert np.array_equal(dataset.features[states.scene == 4], alone.features)


def recordings():
    """Reaches of a task, each a person of its own: blocked and free ones in turn, their times not known."""
    runs = []
    for n in range(3):
        for name, bow, x in (
            (f"blocked {n}", 0.12 + 0.01 * n, 0.03 * n),
            (f"free {n}", 0.01, 0.03 * n + 0.3),
        ):
            one = made_up_trial(name, n, bow, x)
            crate = replace(one.shapes[0], name="crate")
            runs.append(replace(one, name=name, shapes=(crate,), provenance={"person": name}))
    return runs


def test_a_single_reach_is_too_few():
    parameters = committed(SceneLearningParameters, "defaults.obstacles", **QUICK)
    with pytest.raises(InputError, match=r"^reaches of 1 people, 1 of them"):
        learn_past_obstacles(recordings()[:1], parameters)


PEOPLE, REACHES = 24, 20


@lru_cache
def made_up_ways():
    """Reaches in which every claim holds.

    Person 1 touches a box once and takes another gap: if nobody did, how people differ would be unknown.
    """
    touching = dict.fromkeys(ALL_MODELS, 10) | {"none": 11, "human_inspired": 11, "nearest": 8}
    touching |= {scene_models.PUBLISHED: 5, scene_models.SCENE: 0, "planned": 0}
    keys = [
        (model, person, number)
        for model, person, number in product(ALL_MODELS, range(PEOPLE), range(REACHES))
    ]
    rows = pd.DataFrame(keys, columns=["model", "fold", "number"])
    people, number, scene = rows["fold"], rows["number"], rows["model"] == scene_models.SCENE
    most = rows["model"].map(touching)
    rows = rows.assign(
        reach=[f"p{person}_{one}" for _, person, one in keys],
        person=[f"p{person}" for _, person, _ in keys],
        fold=people % 4,
        blocked=number < 12,
        hit=number < most - ((people % 3 == 0) & (most > 1)) + (people == 1),
        hit_wall=False,
        clearance_mm=30.0,
        left_mm=3.0,
        path_mm=np.where(scene, 15.0 + 0.1 * people, 40.0),
        same_gaps=(people != 1) | (number != 0) | ~scene,
    ).drop(columns="number")
    errors = pd.DataFrame(product(MODELS, "xyz", range(4)), columns=["model", "axis", "fold"])
    time, reaches = np.linspace(0.0, 1.5, 20), ("p0_1", "p1_1", "p2_1")
    paths = [
        pd.DataFrame(
            {"reach": reach, "model": model, "time_s": time, "x_m": 0.1, "y_m": time / 3, "z_m": 0.8}
        )
        for reach, model in product(reaches, ("recorded", *ALL_MODELS))
    ]
    shapes = pd.DataFrame(product(reaches, (True, True, False)), columns=["reach", "box"])
    place = {"x_m": 0.2 * shapes["box"], "y_m": -0.05, "z_m": 0.79}
    pair = {"first": ["p0"], "second": "p1", "reach": "p0_1", "path_mm": 28.0, "same_gaps": True}
    return SceneWays(
        {
            "reaches": rows,
            "errors": errors.assign(squared=4.0, variance=8.0),
            "people": pd.DataFrame(pair),
            "left_out": pd.DataFrame({"trial": ["p0_9"], "person": ["p0"], "reason": ["takes 5.0 s"]}),
            "paths": pd.concat(paths, ignore_index=True),
            "shapes": shapes.assign(**place, width_m=0.1, depth_m=0.05, height_m=0.12),
        }
    )


def verdicts(root, found):
    claims, find = read_claims(root / "src/dissertation/recorded/claims/boxes.yaml"), scene_findings(found)
    return {claim.evidence: claim.verdict(find[claim.evidence]) for claim in claims}


def test_where_no_reach_touches_an_obstacle_people_are_few(root):
    """Of 12 people none touches in 20 reaches each: others may in up to 5.5 %."""
    reaches = made_up_ways()["reaches"].assign(hit=False)
    few = reaches[reaches["person"].isin([f"p{person}" for person in range(12)])]
    found = SceneWays(made_up_ways() | {"reaches": few})
    assert scene_findings(found)["hits"].high == rate_interval(np.zeros(12), np.full(12, 20))[1] > 0.05
    words = verdicts(root, found)
    rates = ("published_hits", "hits", "published_hits_fewer_than_rai", "features_alone")
    assert {words[name] for name in rates} == {"undecided"}
    assert words["published_hits_ratio"] == "not tested"


def test_a_ratio_of_shares_is_that_of_the_sums_and_exact_if_people_agree():
    reaches = made_up_ways()["reaches"]
    both = reaches[reaches["model"].isin(["none", "planned"])]

    def ratio(hit):
        return SceneWays(made_up_ways() | {"reaches": both.assign(hit=hit)}).hits_ratio("planned", "none")

    first = both.groupby(["model", "person"]).cumcount()
    half = ratio(first < np.where(both["model"] == "none", 10, 5))
    assert (half.value, half.low, half.high, half.n) == (0.5, 0.5, 0.5, PEOPLE)
    lone = (both["person"] == "p1") & (both["model"] == "planned")  # of one person only, twice as many
    spread = ratio(first < np.where(both["model"] == "none", 10, np.where(lone, 10, 5)))
    assert spread.value == pytest.approx(0.5 + 0.5 / PEOPLE)
    assert spread.low < 0.5 < spread.high


def test_findings_pool_reaches_and_cluster_people(root):
    assert set(verdicts(root, made_up_ways()).values()) == {"yes"}
    find = scene_findings(made_up_ways())
    assert find["hits"].value == 1 / (PEOPLE * REACHES)
    assert find["hits"].low < find["hits"].value < find["hits"].high
    hits = made_up_ways().of("none").groupby("person")["hit"].mean()
    assert find["none_hits"].value == pytest.approx(hits.mean())
    assert find["none_hits"].low < hits.mean() < find["none_hits"].high
    assert find["goal"].value == 3.0
    assert find["path"].value == pytest.approx(15.0 + 0.1 * np.arange(PEOPLE).mean())


def test_one_person_alone_in_scenes_of_their_own_without_a_blocked_reach(root):
    tables = dict(made_up_ways())
    reaches = tables["reaches"].query("person == 'p1' and not blocked")
    tables |= {name: tables[name][:0] for name in ("people", "left_out", "paths", "shapes")}
    found = SceneWays(tables | {"reaches": reaches})
    assert set(scene_pictures(found)) == {"obstacles_rates"}
    words = verdicts(root, found)
    assert words["hits_blocked"] == "not tested"
    assert words["path"] == "undecided"  # one person has no interval
    assert "people_apart" not in scene_findings(found)


ROWS = 12
KEYS = ["representation", "inputs", "axis"]


def tables(rows=ROWS, seed=0):
    rng = np.random.default_rng(seed)
    features = rng.normal(size=(rows, 17))
    features[:, 15] = np.linalg.norm(features[:, :3], axis=1)
    time = np.linspace(0.0, 1.0, rows)
    p, u = canonical.phase(time, canonical.TAU_PER_DURATION)
    modulation = kernels.features(p, u)
    return {"features": features, "target": rng.normal(size=(rows, 3)), "modulation": modulation}, time


def write(folder, found):
    for name, path in coupling_samples.sample_files(folder).items():
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savetxt(path, found[name])


def test_samples_and_their_phase_are_read(tmp_path):
    found, time = tables()
    write(tmp_path, found)
    dataset, provenance = coupling_samples.read_coupling(tmp_path)
    np.testing.assert_array_equal(dataset.features, found["features"])
    np.testing.assert_array_equal(dataset.target, found["target"])
    p, u = canonical.phase(time, canonical.TAU_PER_DURATION)
    np.testing.assert_allclose(dataset.time, time, atol=2e-4)
    np.testing.assert_allclose(dataset.phase, p, atol=1e-3)
    np.testing.assert_allclose(dataset.phase_velocity, u, atol=1e-12)
    assert len(np.unique(dataset.demonstration)) == ROWS
    assert provenance["origin"] == "recorded"
    assert len(provenance["sha256"].split()) == 3


def test_faults_name_the_file(tmp_path):
    with pytest.raises(InputError, match="holds no samples of obstacle avoidance"):
        coupling_samples.read_coupling(tmp_path)
    found, _ = tables()
    wrong = found["features"].copy()
    wrong[3, 15] += 0.5
    for changes, message in (
        ({"target": found["target"][:-1]}, r"Ct_target_obs_avoid\.txt: has 11 rows, .*X_raw.* has 12"),
        ({"features": wrong}, r"X_raw_obs_avoid\.txt: row 3: distance to the centre"),
        (
            {"modulation": found["modulation"] + np.eye(ROWS, 25)},
            r"PSI_mult_phase_V_obs_avoid\.txt: row \d+: no time of a movement",
        ),
    ):
        write(tmp_path, found | changes)
        with pytest.raises(InputError, match=message):
            coupling_samples.read_coupling(tmp_path)


def phase_dependent(count=120, seed=0):
    """Linear in the features, but for a factor that only the phase tells."""
    rng = np.random.default_rng(seed)
    time = rng.uniform(0.0, 1.0, count)
    p, u = canonical.phase(time, canonical.TAU_PER_DURATION)
    features = rng.normal(size=(count, 17))
    target = features[:, :3] * u[:, None] + 0.05 * rng.normal(size=(count, 3))
    return AvoidanceDataset(features, target, p, u, np.zeros(count, int), np.arange(count), time)


def test_representations_are_compared_on_the_same_held_out_samples():
    dataset = phase_dependent()
    network = {"hidden": (6,), "members": 2, "training": {"iterations": 12}}
    pmnn = {"steps": 60, "dropout": 0.0, "evaluate_every": 30}
    its = {"folds": 2, "network": network, "pmnn": pmnn, "pmnn_hidden": (8,)}
    parameters = committed_entry("avoidance", **its)
    with pytest.raises(InputError, match="too few for 2 folds"):
        coupling_representations.representation_scores(phase_dependent(3), parameters)
    results = coupling_representations.representation_scores(dataset, parameters)
    scores = results["scores"].set_index(KEYS)
    assert list(scores.index.droplevel("axis").unique()) == list(coupling_representations.REPRESENTATIONS)
    # the pooled error is the mean over folds of the share of each, and ridge regression can be redone by hand
    found = scores.loc[("ridge", "features", "y"), "nmse"]
    assert results["folds"].groupby(KEYS)["nmse"].mean()["ridge", "features", "y"] == pytest.approx(found)
    squared, target = 0.0, dataset.target[:, 1]
    for block in np.array_split(np.arange(120), 2):
        rest = np.setdiff1d(np.arange(120), block)
        seen = dataset.features[rest]
        design, offset = (dataset.features - seen.mean(axis=0)) / seen.std(axis=0), target[rest].mean()
        normal = design[rest].T @ design[rest] + np.eye(17)
        weights = np.linalg.solve(normal, design[rest].T @ (target[rest] - offset))
        squared += np.square(design[block] @ weights + offset - target[block]).sum()
    assert found == pytest.approx(squared / (120 * target.var()))
    worth = results["phase_worth"].set_index(KEYS)
    assert worth.loc[("ensemble", "phase_velocity", "y"), "gain"] > 0.0


def made_up_scores():
    """Tables in which every claim holds."""
    ranks = {"human_inspired": 4, "network_validation": 3, "ridge": 3}
    ranks |= {"network": 2, "pmnn": 1, "ensemble": -4}

    def error(name, inputs):
        return 0.6 + 0.1 * ranks[name] + (0 if inputs == "phase" else 0.05)

    folds = [
        (name, inputs, axis, fold, error(name, inputs) + noise)
        for name, inputs in coupling_representations.REPRESENTATIONS
        for axis in "xyz"
        for fold, noise in enumerate(0.002 * np.array([-1.0, 0.5, 0.0, -0.5, 1.0]))
    ]
    folds = pd.DataFrame(folds, columns=[*KEYS, "fold", "nmse"]).assign(samples=20)
    scores = folds.groupby(KEYS, sort=False)["nmse"].mean().reset_index().assign(train=0.05)
    worth = scores[(scores["inputs"] != "features") & (scores["representation"] != "pmnn")][KEYS]
    return {"folds": folds, "scores": scores, "phase_worth": worth.assign(gain=0.1, half_width=0.02)}


def test_claims_follow_the_tables(root):
    kinds = [dict.fromkeys(pair) for pair in zip(*coupling_representations.REPRESENTATIONS, strict=True)]
    written = [set(section.REPRESENTATIONS), set(section.INPUTS)]
    assert written == [set(names) for names in kinds]  # they stand as text there
    claims = read_claims(root / "src/dissertation/recorded/claims/avoidance.yaml")
    find = section.representation_findings(made_up_scores())
    words = [claim.verdict(one, case) for claim in claims for case, one in find[claim.evidence].items()]
    assert set(words) == {"yes"}
    best = made_up_scores()["scores"].set_index(KEYS)["nmse"]
    assert find["nmse_x"].value == best["ensemble", "phase", "x"]
    assert section.representation_facts(made_up_scores())["best"]["name"] == "ensemble of networks"


def test_the_recorded_samples():
    dataset, _ = coupling_samples.read_coupling(recorded_data("clmc"))
    assert len(dataset) == 823
    _, u = canonical.phase(dataset.time, canonical.time_constant(1.0))
    np.testing.assert_allclose(dataset.phase_velocity, u, atol=0.07)  # two models to the same phase
    # a phase that were not the samples' own would not tell the speed along the reach
    correlation = np.corrcoef(dataset.features[:, 12], np.sin(np.pi * np.clip(dataset.time, 0.0, 1.0)))[0, 1]
    assert correlation > 0.5
