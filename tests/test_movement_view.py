"""Recordings of recorded data: names and colours of the page, a text panel, parts one after the other."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import two_move_demonstration
from structlearn.tasks.public.protocol.corrections import phase_networks
from structlearn.tasks.public.views.movement_recordings import CHART, write_unscrewing
from test_recorded_page import made_up
from viewer_files import colour_of, contents, note

from structlearn.palette import BLUE, VERMILION
from structlearn.tasks.public.public_names import LEARNED, PATHS
from structlearn.tasks.public.views import movement_recordings as movements


@pytest.fixture
def parts():
    """Three recorded parts with touch."""
    moved = two_move_demonstration("1")
    counts = np.ones((len(moved.time), 38))
    return [
        replace(moved, name=name, tactile=counts, true_segments=None, provenance={"origin": "recorded"})
        for name in ("prim1", "prim2", "prim3")
    ]


def test_higher_reaches_have_a_colour_per_path(tmp_path, parts):
    path = tmp_path / "higher.rrd"
    networks = dict(phase_networks([np.ones((50, 3))], 5))
    movements.write_higher_reaches(path, parts, made_up().reach_primitives, networks)
    for key, colour in (("nominal", BLUE), ("coupling", VERMILION)):
        assert PATHS[key].colour == colour
        entity = f"/paths/{PATHS[key].name}".replace(" ", "\\ ")
        assert colour_of(path, entity, "LineStrips3D") == colour
        assert PATHS[key].name in note(path)
    assert "recorded" in note(path)


def test_parts_of_the_execution_follow_each_other(tmp_path, parts):
    whole, cuts = movements.joined(parts)
    assert np.allclose(np.diff(whole.time), whole.dt)
    assert whole.tactile.shape == (3 * len(parts[0].time), 38)
    assert whole.velocity is None
    assert list(cuts.primitives) == [part.name for part in parts]
    table = cuts.cuts
    assert (table["start_s"].to_numpy()[1:] == table["end_s"].to_numpy()[:-1]).all()
    path = tmp_path / "execution.rrd"
    movements.write_execution(path, parts)
    assert "/hands/execution" in contents(path)[1]
    assert "prim1, prim2, prim3" in note(path)


def test_unscrewing_shows_every_log_and_the_primitive(tmp_path):
    path = tmp_path / "unscrewing.rrd"
    logs = [turn for _, turn in made_up().unscrewing_segments]
    write_unscrewing(path, logs, made_up().unscrewing_primitives[0])
    found = contents(path)[1]
    names = [*(f"log\\ {number}" for number in range(1, len(logs) + 1)), LEARNED.name]
    assert {f"/caps/{name}" for name in names} <= found
    for chart in CHART:
        assert {f"/{chart}/{name}".replace("second swing", "second\\ swing") for name in names} <= found
    assert colour_of(path, f"/twist/{LEARNED.name}") == LEARNED.colour
    assert "recorded" in note(path)


def test_reaches_and_the_sequence_are_written(tmp_path, parts):
    path = tmp_path / "reaches.rrd"
    movements.write_reaches(path, parts, made_up().reach_primitives)
    assert colour_of(path, f"/paths/{LEARNED.name}", "LineStrips3D") == LEARNED.colour
    assert note(path)
