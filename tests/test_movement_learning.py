"""Cuts and primitives of tasks: what is learned from, and what primitives are held against."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from conftest import two_move_demonstration

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.primitives import sequence
from structlearn.primitives.fitting import learn_sequence
from structlearn.tasks.movement import movement_learning as learning
from structlearn.tasks.movement.parameters import PARTS, TaskFitParameters

FIT = TaskFitParameters(
    smoothing_hz=5.0, kernel_count=10, regression="joint", scaled_axes=(True, False, False), frame="auto"
)


@pytest.fixture
def runs():
    """Four runs with a bump to one side or the other, so that they are not their mean."""
    found = []
    for place in range(4):
        moved = two_move_demonstration(str(place), 1 + 0.1 * place)
        bump = 0.02 * (-1) ** place * np.sin(np.linspace(0, np.pi, len(moved.time)))
        found.append(replace(moved, position=moved.position + np.outer(bump, [1.0, 0.0, 0.0])))
    return found


def test_a_given_primitive_is_all_of_every_recording(runs):
    found = learning.segmented(runs, "reach", None)
    assert found.primitives == ["reach"]
    assert found.result("reach")["end_s"].tolist() == [one.time[-1] for one in runs]
    parts = learning.segmented(runs, PARTS, None)
    assert parts.primitives == [one.name for one in runs]
    assert all(len(cuts) == 1 for cuts in parts.results.values())


def test_flagged_demonstrations_are_not_learned_from_unless_told_so(runs):
    found = learning.segmented(runs, "reach", None)
    columns = ["demonstration", "primitive", "reason", "number"]
    warnings = pd.DataFrame([("2", "reach", "a pause", 1.2)], columns=columns)
    flagged = replace(found, warnings=warnings)
    assert learning.learned_cuts(flagged, False)["reach"].index.tolist() == ["0", "1", "3"]
    assert len(learning.learned_cuts(flagged, True)["reach"]) == 4
    assert learning.cut_metrics(runs, flagged)["cuts_warnings"] == 1
    with pytest.raises(InputError, match=r"no demonstration is without a cut warning \(a pause\)"):
        learning.learned_cuts(
            replace(found, warnings=pd.concat([warnings.assign(demonstration=k) for k in "0123"])), False
        )


def test_reproduction_tells_learned_from_left_out_and_as_published(runs):
    cuts = learning.segmented(runs, "reach", None).results
    table = learning.reproduction(runs, cuts, FIT, fold=2)
    counts = table.groupby(["regression", "left_out", "scaled"]).size()
    assert counts["joint"].to_dict() == {(False, False): 4, (False, True): 4, (True, True): 4}
    assert (table["from_mean_mm"] > 1.0).all()
    means = table.query("scaled and regression == 'joint'").groupby("left_out")["mean_mm"].mean()
    assert means[True] > means[False]
    assert learning.fit_metrics(table, FIT)["primitives_reach_left_out_mm"] == pytest.approx(means[True])
    unscaled = FIT.model_copy(update={"scaled_axes": (False,) * 3})
    assert learning.reproduction(runs, cuts, unscaled, fold=1)["scaled"].all()


def test_parts_of_an_execution_are_reproduced_as_a_sequence(runs):
    part = runs[0]
    moved = replace(part, name="second", position=part.position + part.position[-1] - part.position[0])
    parts = [replace(one, tactile=np.outer(one.time, np.ones(3))) for one in (part, moved)]
    primitives = learn_sequence(parts, learning.segmented(parts, PARTS, None).results, FIT)
    errors = learning.execution_errors(parts, sequence.unroll(primitives, part.dt))
    assert errors["primitive"].tolist() == ["0", "second"]
    assert errors["mean_mm"].max() < 15.0
    traces, scores, table = learning.learn_traces(parts, 3.0)
    assert list(traces) == ["0", "second"]
    assert scores["rms"].max() < 0.05 * scores["range"].max()
    assert len(table) == 3 * sum(len(one.time) for one in parts)


def test_a_turn_is_learned_from_each_run_and_from_all(runs):
    def turning(samples):
        half = np.linspace(0.0, 0.97 * np.pi, samples)
        return np.column_stack([np.cos(half), np.sin(half), np.zeros((samples, 2))])

    turned = [replace(one, orientation=turning(len(one.time))) for one in runs[:3]]
    (primitive,) = learn_sequence(turned, learning.segmented(turned, "turn", None).results, FIT)
    table = learning.turn_errors(turned, primitive, FIT)
    assert table["learned_from"].tolist() == ["0", "1", "2", "all"]
    assert table["turn_deg"].between(345.0, 350.0).all()
    assert table["mean_deg"].max() < 2.0


def test_mean_orientation_path_is_the_middle_of_two():
    axis = np.array([0.0, 0.0, 1.0])
    angles = np.linspace(0.0, 3.0, 50)[:, None]
    paths = [quaternion.from_rotation_vector(factor * angles * axis) for factor in (0.8, 1.2)]
    mean = learning.mean_orientation_path(paths, 70)
    expected = quaternion.from_rotation_vector(np.linspace(0.0, 3.0, 70)[:, None] * axis)
    assert quaternion.angle_between(mean, expected).max() < 1e-3
