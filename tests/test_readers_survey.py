"""What raw messages say of their clocks, against numbers that were put into them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from readers_bags import pose_messages, pose_rows, write_bag

from structlearn.readers.bag import read_bag
from structlearn.tasks.inspection import clocks as survey

MS = 10**6


def messages_of(path, messages, topic):
    write_bag(path, messages)
    return read_bag(path, [topic]).messages[topic]


def test_a_regular_clock():
    stamps = survey.stamps_of(5 * 10**9 + 10 * MS * np.arange(101))
    assert (stamps.count, stamps.repeated, stamps.backward) == (101, 0, 0)
    assert stamps.rate_hz == pytest.approx(100.0)
    assert (stamps.first_s, stamps.last_s) == (5.0, pytest.approx(6.0))
    assert stamps.largest_gap_s == pytest.approx(0.01)


def test_gaps_and_disorder_are_numbers():
    steps = np.tile([8, 12], 100) * MS
    steps[150] = 500 * MS
    stamps = np.append(0, np.cumsum(steps))
    found = survey.stamps_of(stamps)
    assert found.largest_gap_s == pytest.approx(0.5)
    assert found.gap_at_s == pytest.approx(1e-9 * stamps[150])
    stamps[[20, 21]] = stamps[[21, 20]]
    stamps[40] = stamps[39]
    found = survey.stamps_of(stamps)
    assert (found.backward, found.repeated) == (1, 1)


def test_one_message_has_no_rate():
    assert np.isnan(survey.stamps_of(np.array([7])).rate_hz)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.integers(-(10**12), 10**12), min_size=1, max_size=50), st.integers(-(10**12), 10**12))
def test_counts_do_not_depend_on_where_the_clock_starts(stamps, shift):
    before = survey.stamps_of(np.array(stamps))
    after = survey.stamps_of(np.array(stamps) + shift)
    for name in ("count", "repeated", "backward", "rate_hz", "largest_gap_s"):
        np.testing.assert_equal(getattr(before, name), getattr(after, name))


def test_delays_of_the_log_behind_the_header(tmp_path):
    taken = 10**9 + 10 * MS * np.arange(1000)
    late = taken + 30 * MS + np.linspace(0, 100 * MS, 1000).astype(int)  # a clock that runs 1 % fast
    rows = [
        (topic, kind, content, int(log))
        for (topic, kind, content, _), log in zip(
            pose_messages(taken.tolist(), pose_rows(1000)), late, strict=True
        )
    ]
    clocks = survey.topic_clocks("", messages_of(tmp_path / "bag.mcap", rows, "/tool"))
    assert clocks.delay_s == pytest.approx(0.080, abs=1e-4)
    assert clocks.own is clocks.header
    assert clocks.header.rate_hz == pytest.approx(100.0)


@pytest.mark.parametrize(
    ("kind", "content"),
    [
        ("geometry_msgs/msg/Pose", {"position": {"x": 0.0, "y": 0.0, "z": 0.0}}),
        ("geometry_msgs/msg/PoseStamped", {"header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}}),
    ],
)
def test_the_log_time_stands_in_where_no_header_is_set(tmp_path, kind, content):
    rows = [("/tool", kind, content, 10**9 + 20 * MS * row) for row in range(50)]
    clocks = survey.topic_clocks("", messages_of(tmp_path / "bag.mcap", rows, "/tool"))
    assert clocks.header is None
    assert clocks.own.rate_hz == pytest.approx(50.0)
