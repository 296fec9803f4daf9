"""Repeats of a task within one recording."""

import numpy as np
import pytest
from committed import EXAMPLE_TASK

from dissertation.simulation.pick_and_place import as_recording, session
from structlearn.core.errors import InputError
from structlearn.readers import synchronise
from structlearn.segmentation.repeats import split_repeats


def split_up(sessions, primitives, count=None):
    """Repeats that were found in sessions (seed, moves, repeats), and the recordings."""
    task = EXAMPLE_TASK
    parameters = task.segment.model_validate(task.segment.model_dump() | {"primitives": primitives})
    recordings = []
    for number, (seed, moves, repeats) in enumerate(sessions):
        odd = bool(seed % 2)
        made = session(seed, moves, repeats, f"{number:02d}", twitch=odd, hesitation=odd)
        recordings.append(synchronise(as_recording(made), 100.0))
    return recordings, *split_repeats(recordings, parameters, count)


@pytest.mark.parametrize(
    ("sessions", "primitives"),
    [
        ([(101, 2, 12)], 2),
        ([(103, 5, 7)], 5),
        ([(104, 3, 1), (105, 3, 2), (106, 3, 1)], 3),  # one of three was made twice
        ([(107, 3, 5)], 2),  # the way back is no primitive
        ([(108, 2, 4)], ["reach", {"name": "turn", "axis": "rot"}, "retreat"]),
        ([(109, 2, 6)], 3),  # two primitives may be one run
    ],
)
def test_every_repeat_becomes_a_demonstration(sessions, primitives):
    recordings, parts, table = split_up(sessions, primitives)
    assert table["recording"].value_counts().to_dict() == {
        one.name: repeats for one, (_, _, repeats) in zip(recordings, sessions, strict=True)
    }
    assert [part.name for part in parts] == table["demonstration"].tolist()
    used = 2 if sessions[0][0] == 107 else sessions[0][1]
    for part, row in zip(parts, table.itertuples(), strict=True):
        whole = next(one for one in recordings if one.name == row.recording)
        first = int(row.demonstration[-2:]) - 1
        moves = whole.true_segments.reshape(-1, sessions[0][1], 2)[first, :used]
        np.testing.assert_allclose(part.true_segments, moves - row.start_s, atol=1e-9)
        assert part.time[-1] == pytest.approx(row.end_s - row.start_s)
        start = round(row.start_s / whole.dt)
        np.testing.assert_array_equal(part.position, whole.position[start : start + len(part.time)])


@pytest.mark.parametrize(
    ("sessions", "primitives", "count", "message"),
    [
        ([(110, 3, 4)], 3, 5, r"^00: has 4 repeats of the task \(.*, .*, .*, .* s\), not 5$"),
        ([(111, 5, 1)], 5, None, r"^repeats: the moves of the recordings do not repeat: at most"),
        ([(51, 5, 6)], 4, None, r"^00: where a repeat begins is ambiguous: .*; name all moves, also the way"),
    ],
)
def test_what_is_ambiguous_is_told(sessions, primitives, count, message):
    with pytest.raises(InputError, match=message):
        split_up(sessions, primitives, count)
