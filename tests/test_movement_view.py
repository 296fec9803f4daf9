"""Recordings of movements: names and colours of the page, a text panel, parts one after the other."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import two_move_demonstration
from viewer_files import colour_of, contents, note

from structlearn.palette import PHASE_PATHS
from structlearn.primitives.fitting import (
    learn_sequence,
    orientations,
    segment_paths,
    whole_run_cuts,
)
from structlearn.tasks.movement import view
from structlearn.tasks.movement.movement_learning import segmented
from structlearn.tasks.movement.parameters import TaskFitParameters
from structlearn.tasks.movement.phase_corrections import phase_networks
from structlearn.viewer.demonstrations import demonstrations
from structlearn.viewer.recording import write

FIT = TaskFitParameters(
    smoothing_hz=5.0, kernel_count=10, regression="joint", scaled_axes=(False,) * 3, frame="auto"
)


@pytest.fixture
def parts():
    """Three recorded parts with touch."""
    moved = two_move_demonstration("1")
    half = np.linspace(0.0, 0.97 * np.pi, len(moved.time))
    turned = np.column_stack([np.cos(half), np.sin(half), np.zeros((len(half), 2))])
    counts = np.ones((len(moved.time), 38))
    origin = {"origin": "recorded"}
    return [
        replace(moved, name=name, orientation=turned, tactile=counts, true_segments=None, provenance=origin)
        for name in ("prim1", "prim2", "prim3")
    ]


def primitives(runs):
    return learn_sequence(runs, segmented(runs, "reach", None).results, FIT)


def test_corrected_runs_have_a_colour_per_path(tmp_path, parts):
    path = tmp_path / "corrected.rrd"
    plain = [replace(one, orientation=None) for one in parts]
    networks = dict(phase_networks([np.ones((50, 3))], 5))
    write(path, view.corrected(plain, primitives(plain), networks))
    for key in ("nominal", "coupling"):
        entity = f"/paths/{PHASE_PATHS[key].name}".replace(" ", "\\ ")
        assert colour_of(path, entity, "LineStrips3D") == PHASE_PATHS[key].colour
        assert PHASE_PATHS[key].name in note(path)
    assert "recorded" in note(path)


def test_parts_of_the_execution_follow_each_other(tmp_path, parts):
    (whole_run,), cuts = view.joined_execution(parts)
    assert np.allclose(np.diff(whole_run.time), whole_run.dt)
    assert whole_run.tactile.shape == (3 * len(parts[0].time), 38)
    assert whole_run.velocity is None
    assert list(cuts.primitives) == [part.name for part in parts]
    table = cuts.cuts
    assert (table["start_s"].to_numpy()[1:] == table["end_s"].to_numpy()[:-1]).all()
    path = tmp_path / "execution.rrd"
    write(path, demonstrations(*view.joined_execution(parts), "title", view.DEMONSTRATED))
    assert "/hands/execution" in contents(path)[1]


def test_turns_show_every_run_and_the_primitive(tmp_path, parts):
    path, runs = tmp_path / "turns.rrd", orientations(segment_paths(parts, whole_run_cuts(parts), 5.0))
    write(path, view.turns(runs, primitives(parts)[0]))
    found = contents(path)[1]
    names = [*(f"log\\ {number}" for number in range(1, len(runs) + 1)), view.PRIMITIVE.name]
    assert {f"/caps/{name}" for name in names} <= found
    for chart in view.CHART:
        assert {f"/{chart}/{name}".replace("second swing", "second\\ swing") for name in names} <= found
    assert colour_of(path, f"/twist/{view.PRIMITIVE.name}") == view.PRIMITIVE.colour
    assert "recorded" in note(path)
