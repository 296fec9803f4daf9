"""Stamps that repeat and run back, under each policy, and what is said of the clocks of raw messages."""

from itertools import pairwise

import numpy as np
import pytest
from committed import topic_map
from hypothesis import given, settings
from hypothesis import strategies as st
from readers_bags import joint_messages, pose_messages, pose_rows, write_bag

from structlearn.core.errors import InputError
from structlearn.readers import StampPolicy, read_demonstrations, read_recording
from structlearn.readers.bag import read_bag
from structlearn.readers.clock import in_order, longest_increase
from structlearn.readers.source import AS_WRITTEN
from structlearn.tasks.inspection import clocks as survey

DROP, SORT, LOG = (
    StampPolicy(clock=clock, disorder=disorder)
    for clock, disorder in (("header", "drop"), ("header", "sort"), ("log", "error"))
)
TOOL = topic_map(pose="/tool")
STAMPS = st.lists(st.integers(0, 12), min_size=1, max_size=10)


@settings(max_examples=80, deadline=None)
@given(stamps=STAMPS)
def test_as_few_as_possible_are_dropped(stamps):
    rows = longest_increase(np.array(stamps))
    kept = np.array(stamps)[rows]
    assert (np.diff(rows) > 0).all()
    assert (np.diff(kept) > 0).all()
    longest = []  # of the increases that end with each, by trying all
    for place, stamp in enumerate(stamps):
        longest.append(1 + max((longest[i] for i in range(place) if stamps[i] < stamp), default=0))
    assert len(rows) == max(longest)


@settings(max_examples=80, deadline=None)
@given(stamps=STAMPS)
def test_sorting_keeps_the_first_of_each_stamp(stamps):
    rows, note = in_order("here", np.array(stamps), SORT)
    assert rows.tolist() == [stamps.index(stamp) for stamp in sorted(set(stamps))]
    assert (note is None) == (stamps == sorted(set(stamps)))
    if note is not None:
        assert note.endswith(f"{len(stamps) - len(set(stamps))} dropped of {len(stamps)}")


@given(stamps=STAMPS)
def test_what_is_in_order_is_left_alone_and_nothing_else_passes(stamps):
    increases = all(a < b for a, b in pairwise(stamps))
    if increases:
        for policy in (AS_WRITTEN, DROP, SORT):
            rows, note = in_order("here", np.array(stamps), policy)
            assert (rows.tolist(), note) == (list(range(len(stamps))), None)
    else:
        with pytest.raises(InputError, match=r"here: row \d+ .*`disorder: drop` or `sort` under `stamps`"):
            in_order("here", np.array(stamps), AS_WRITTEN)


@pytest.fixture
def swapped(tmp_path):
    """Ten poses; the fourth and fifth have each other's stamps, the eighth repeats the seventh's."""
    stamps = [10**9 + row * 10**7 for row in range(10)]
    stamps[3], stamps[4], stamps[7] = stamps[4], stamps[3], stamps[6]
    logged = [2 * 10**9 + row * 10**7 for row in range(10)]
    write_bag(tmp_path / "bag.mcap", pose_messages(stamps, pose_rows(10), logged=logged))
    return tmp_path / "bag.mcap", np.array(stamps)


def test_the_policy_decides_and_is_told_of_in_provenance(swapped):
    path, stamps = swapped
    with pytest.raises(InputError, match=r"bag\.mcap: topic '/tool': row 4 .* runs back in time; with"):
        read_recording(path, TOOL)
    dropped = read_recording(path, TOOL, DROP)
    assert dropped.provenance["stamps"] == "/tool: 2 dropped of 10"
    assert len(dropped.streams[0].stamps) == 8
    sorted_ = read_recording(path, TOOL, SORT)
    assert sorted_.provenance["stamps"] == "/tool: 1 moved and 1 dropped of 10"
    np.testing.assert_array_equal(sorted_.streams[0].stamps, np.unique(stamps))
    np.testing.assert_array_equal(sorted_.streams[0].values, pose_rows(10)[[0, 1, 2, 4, 3, 5, 6, 8, 9]])
    (demonstration,) = read_demonstrations(path, TOOL, stamps=SORT)
    assert demonstration.provenance["stamps"] == sorted_.provenance["stamps"]


def test_log_times_may_be_wanted(swapped):
    path, _ = swapped
    recording = read_recording(path, TOOL, LOG)
    np.testing.assert_array_equal(recording.streams[0].stamps, 2 * 10**9 + 10**7 * np.arange(10))
    assert recording.provenance["clock"] == "log"
    assert "stamps" not in recording.provenance


def test_joints_of_each_publisher_have_an_order_of_their_own(tmp_path):
    """Two publishers may have one stamp: neither repeats its own."""
    stamps = [10**9 + row * 10**7 for row in range(5)]
    arm = joint_messages(stamps, ["a", "b"], np.arange(10.0).reshape(5, 2))
    hand = joint_messages([*stamps[:4], stamps[3]], ["f"], np.arange(5.0)[:, None])
    write_bag(tmp_path / "bag.mcap", [*pose_messages(stamps, pose_rows(5)), *arm, *hand])
    both = topic_map(pose="/tool", joint_states="/joint_states", joints=("a", "b", "f"))
    with pytest.raises(InputError, match=r"'/joint_states': joints f: row 4 .* repeats"):
        read_recording(tmp_path / "bag.mcap", both)
    recording = read_recording(tmp_path / "bag.mcap", both, DROP)
    assert recording.provenance["stamps"] == "/joint_states: 1 dropped of 5 of f"
    assert [len(stream.stamps) for stream in recording.streams] == [5, 5, 4]


MS = 10**6


def test_rates_gaps_and_disorder_are_numbers():
    steps = np.tile([8, 12], 100) * MS
    steps[150] = 500 * MS
    stamps = np.append(0, np.cumsum(steps))
    found = survey.stamps_of(stamps)
    assert (found.count, found.repeated, found.backward) == (201, 0, 0)
    assert found.rate_hz == pytest.approx(1e3 / 12)  # by the median step
    assert found.largest_gap_s == pytest.approx(0.5)
    assert found.gap_at_s == pytest.approx(1e-9 * stamps[150])
    stamps[[20, 21]] = stamps[[21, 20]]
    stamps[40] = stamps[39]
    found = survey.stamps_of(stamps)
    assert (found.backward, found.repeated) == (1, 1)
    assert np.isnan(survey.stamps_of(np.array([7])).rate_hz)


def test_delays_of_the_log_behind_the_header(tmp_path):
    taken = 10**9 + 10 * MS * np.arange(1000)
    late = taken + 30 * MS + np.linspace(0, 100 * MS, 1000).astype(int)  # a clock that runs 1 % fast
    rows = pose_messages(taken.tolist(), pose_rows(1000), logged=late.tolist())
    write_bag(tmp_path / "bag.mcap", rows)
    clocks = survey.topic_clocks("", read_bag(tmp_path / "bag.mcap", ["/tool"]).messages["/tool"])
    assert clocks.delay_s == pytest.approx(0.080, abs=1e-4)
    assert clocks.own is clocks.header
    assert clocks.header.rate_hz == pytest.approx(100.0)
