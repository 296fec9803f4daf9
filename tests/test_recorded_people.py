"""Spreads between and within recorded people: made-up people whose spreads are known."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from committed import ROOT, run_stages

from dissertation.recorded.people import (
    COLUMNS,
    QUANTITIES,
    choice_spread,
    people_who_differ,
    spreads,
    spreads_of_repeats,
    trials_past_boxes,
)
from structlearn.avoidance.look_ahead import LookAheadParameters
from structlearn.avoidance.scene_reaches import SceneReach
from structlearn.avoidance.shapes import Obstacle
from structlearn.core.signals import minimum_jerk
from structlearn.primitives.trajectory import Trajectory
from structlearn.readers.demonstration import Demonstration
from structlearn.tasks.task_files import TaskFiles

PARAMETERS = SimpleNamespace(
    look_ahead=LookAheadParameters(clearance_m=0.045, blocked_cost=30.0, nearness_cost=3.0),
    hand_radius_m=0.0125,
)


def box(x: float, width: float) -> Obstacle:
    return Obstacle("cube", np.array([x, 0.2, 0.0]), np.array([0.5 * width, 0.02, 0.06]))


def reach(aside_m: float, duration_s: float = 1.5) -> SceneReach:
    """0.4 m ahead (the base frame's y), past a box from 30 mm left to 70 mm right of the straight line."""
    grid = np.linspace(0.0, 1.0, 151)
    s = minimum_jerk(grid)
    position = np.stack([0.4 * s, 4 * aside_m * s * (1 - s), 0.08 * s * (1 - s)], axis=1)
    velocity = np.gradient(position, grid, axis=0)
    frame = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    path = Trajectory(grid, position, velocity, np.gradient(velocity, grid, axis=0))
    return SceneReach("01", "me", path, np.zeros(3), frame, duration_s, (box(0.02, 0.1),), (box(0.3, 0.1),))


def test_what_is_measured_of_a_reach():
    trial = trials_past_boxes([reach(0.1)], PARAMETERS).iloc[0]
    assert trial["peak_m_s"] == pytest.approx(1.875 * 0.4 / 1.5, rel=0.02)
    assert trial["bow_m"] == pytest.approx(0.1, rel=0.01)
    assert trial["lift_m"] == pytest.approx(0.02, rel=0.01)
    assert 0.02 < trial["clearance_m"] < 0.07  # beside the box
    assert trial["blocked"]
    assert trial["left"]
    assert trial["needed"] == pytest.approx(0.04, abs=2e-3)  # 82 mm to the right, 42 mm to the left
    assert trial["distance"] == pytest.approx(np.log(0.4))
    assert trial["cost"] > trial["distance"]
    assert not trials_past_boxes([reach(-0.1)], PARAMETERS)["left"].item()


def test_spreads_of_made_up_people_are_recovered():
    rng = np.random.default_rng(1)
    found = []
    for _ in range(20):
        person = np.repeat(np.arange(16), rng.integers(2, 21, 16))
        own, layout = rng.integers(0, 10, (2, len(person)))
        slow = 0.25 * rng.standard_normal(16)[person]
        costs = rng.standard_normal(len(person))
        table = pd.DataFrame(dict.fromkeys([*QUANTITIES, "needed"], rng.random(len(person))))
        table["layout"] = np.where(own < 7, layout, 100 + np.arange(len(person))).astype(str)
        hard = np.where(own < 7, rng.standard_normal(10)[layout], costs)
        table = table.assign(
            person=person.astype(str), cost=hard, distance=costs, blocked=False, needed=np.nan
        )
        table["movement_s"] = np.exp(0.3 * hard + slow + 0.15 * rng.standard_normal(len(person)))
        rows = pd.DataFrame(list(spreads(table)))
        found.append(rows[rows["quantity"] == "movement_s"].set_index("case"))
    for case in ("shared", "all"):
        its = pd.DataFrame([one.loc[case] for one in found])
        assert np.sqrt((its["between_std"] ** 2).mean()) == pytest.approx(0.25, rel=0.1)
        assert np.sqrt((its["within_std"] ** 2).mean()) == pytest.approx(0.15, rel=0.05)
        truth = 0.25**2 / (0.25**2 + 0.15**2)
        assert ((its["low"] < truth) & (truth < its["high"])).mean() >= 0.85


def test_the_side_of_passing_tells_preference_and_its_spread():
    rng = np.random.default_rng(2)
    person = np.repeat(np.arange(40), 20)
    needed = rng.uniform(-0.2, 0.2, len(person))
    preferred = 0.05 + 0.06 * rng.standard_normal(40)[person]
    left = needed - preferred + 0.03 * rng.logistic(size=len(person)) > 0
    found = choice_spread(pd.DataFrame({"person": person, "needed": needed, "left": left}))
    assert found["mean"] == pytest.approx(0.05, abs=0.02)
    assert found["between_std"] == pytest.approx(0.06, rel=0.3)
    assert found["within_std"] == pytest.approx(0.03 * np.pi / np.sqrt(3), rel=0.2)
    assert found["low"] < found["share"] < found["high"]


def test_repeats_of_one_reach_vary_within_a_person():
    rng = np.random.default_rng(3)
    runs = []
    for slow, lift, end in rng.standard_normal((80, 3)):
        duration = 0.6 * np.exp(0.1 * slow)
        time = np.arange(0.0, duration + 0.4, 1e-3)
        s = minimum_jerk(np.clip((time - 0.2) / duration, 0.0, 1.0))[:, None]
        path = s * [0.3, 0.0, 0.0] + 4 * s * (1 - s) * [0.0, 0.0, 0.05 + 0.01 * lift]
        runs.append(Demonstration("01", time, path + s * [0.0, 0.005 * end, 0.0]))
    found = pd.DataFrame(spreads_of_repeats(runs)).set_index("quantity")
    assert found.loc["movement_s", "within_std"] == pytest.approx(0.1, rel=0.2)
    assert found.loc["lift_m", "within_std"] == pytest.approx(0.01, rel=0.2)
    assert found.loc["end_m", "within_std"] == pytest.approx(0.005 / np.sqrt(3), rel=0.2)


def test_sets_that_are_not_here_leave_an_empty_table_and_bad_files_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    sets = [TaskFiles(name) for name in ("boxes", "reaches")]
    for one in sets:
        one.recorded.mkdir(parents=True)
        (one.recorded / "absent.txt").write_text("not recorded here")
    found = people_who_differ(*sets)
    assert found.empty
    assert list(found) == COLUMNS
    (sets[1].recorded / "absent.txt").unlink()
    (sets[1].recorded / "demonstrations.parquet").write_bytes(b"PAR1")
    with pytest.raises(SystemExit):
        run_stages("", ROOT / "stages/recorded/people.py")
    error = capsys.readouterr().err
    assert error.startswith("error: data/tasks/reaches/recorded/demonstrations.parquet: ")
    assert error.count("\n") == 1
    assert not (tmp_path / "data/people.csv").exists()
