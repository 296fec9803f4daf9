"""One clock for all streams, what is refused before, and stamps that repeat and run back."""

from itertools import pairwise

import numpy as np
import pytest
from committed import topic_map
from hypothesis import given, settings
from hypothesis import strategies as st
from readers_bags import joint_messages, make_recording, pose_messages, pose_rows, write_bag

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.readers import (
    Recording,
    StampPolicy,
    Stream,
    read_demonstrations,
    read_recording,
    synchronise,
)
from structlearn.readers.clock import (
    check_recording,
    held_out_error,
    in_order,
    longest_increase,
    shared_stamps,
)
from structlearn.readers.raw_messages import read_bag
from structlearn.readers.source import AS_WRITTEN
from structlearn.tasks.inspection import clocks as survey

UNIX = 1581238055_716234152


def irregular(rng, count, rate_hz, start=UNIX):
    """(count,) ns: steps from a tenth to twice the mean one."""
    return start + np.cumsum(rng.uniform(0.1, 1.9, size=count) * 1e9 / rate_hz).astype(np.int64)


def pose_stream(stamps, position=None, orientation=None):
    values = np.zeros((len(stamps), 7))
    values[:, 3] = 1.0
    if position is not None:
        values[:, :3] = position
    if orientation is not None:
        values[:, 3:] = orientation
    return Stream("/tool", "pose", stamps, values)


def seconds(stamps, origin=UNIX):
    return (np.asarray(stamps) - origin) * 1e-9


@pytest.mark.parametrize(("frequency_hz", "seed"), [(0.5, 0), (3.0, 1)])
def test_the_error_of_interpolation_stays_below_its_bound(frequency_hz, seed):
    rng = np.random.default_rng(seed)
    omega = 2 * np.pi * frequency_hz
    stamps, other = irregular(rng, 400, 150), irregular(rng, 300, 100)
    wave = 0.1 * np.sin(omega * seconds(stamps))
    wrench = np.cos(omega * seconds(other))[:, None] * np.ones(6)
    streams = (pose_stream(stamps, wave[:, None] * np.ones(3)), Stream("/wrist", "wrench", other, wrench))
    demonstration = synchronise(Recording("waves", streams), rate_hz=333.0)
    time = demonstration.time + seconds(max(stamps[0], other[0]))
    for values, clock, exact in (
        (10 * demonstration.position, stamps, np.sin(omega * time)),
        (demonstration.wrench, other, np.cos(omega * time)),
    ):
        bound = (np.diff(clock).max() * 1e-9) ** 2 / 8 * omega**2  # max|x''| = omega^2
        error = np.abs(values - exact[:, None]).max()
        assert 0.05 * bound < error <= bound


@given(seed=st.integers(0, 10**6), rate_hz=st.floats(20, 2000), late_ms=st.integers(0, 60))
def test_the_clock_covers_what_all_streams_share(seed, rate_hz, late_ms):
    rng = np.random.default_rng(seed)
    stamps = irregular(rng, 50, 200)
    other = irregular(rng, 40, 200, UNIX + late_ms * 10**6)
    line = seconds(stamps)[:, None] * [1.0, -2.0, 0.5]
    twist = seconds(other)[:, None] * np.arange(6)
    streams = (pose_stream(stamps, line), Stream("/twist", "twist", other, twist))
    demonstration = synchronise(Recording("lines", streams), rate_hz)
    start, end = max(stamps[0], other[0]), min(stamps[-1], other[-1])
    time = demonstration.time
    assert time[0] == 0
    np.testing.assert_allclose(np.diff(time), 1 / rate_hz, rtol=1e-6)
    assert time[-1] <= seconds(end, start) + 1e-5 / rate_hz
    assert time[-1] + 1 / rate_hz > seconds(end, start)
    absolute = time[:, None] + seconds(start)
    np.testing.assert_allclose(demonstration.position, absolute * [1.0, -2.0, 0.5], atol=1e-7)
    np.testing.assert_allclose(demonstration.velocity, absolute * [0, 1, 2], atol=1e-7)
    np.testing.assert_allclose(demonstration.angular_velocity, absolute * [3, 4, 5], atol=1e-7)


@given(seed=st.integers(0, 10**6))
def test_a_steady_turn_is_met_exactly_whatever_the_signs(seed):
    rng = np.random.default_rng(seed)
    stamps = irregular(rng, 60, 100)
    axis = rng.normal(size=3)
    axis *= 2.0 / np.linalg.norm(axis)  # rad/s
    turn = quaternion.from_rotation_vector(seconds(stamps)[:, None] * axis)
    signs = rng.choice([-1.0, 1.0], size=(60, 1))
    scale = rng.uniform(0.9995, 1.0005, size=(60, 1))
    seen = Stream("/mocap", "tool_to_board", stamps, turn * signs[::-1] * scale)
    streams = (pose_stream(stamps, orientation=turn * signs * scale), seen)
    demonstration = synchronise(Recording("turn", streams), rate_hz=250.0)
    time = demonstration.time + seconds(stamps[0])
    exact = quaternion.from_rotation_vector(time[:, None] * axis)
    for path in (demonstration.orientation, demonstration.tool_to_board):
        assert quaternion.angle_between(path, exact).max() < 1e-7
        np.testing.assert_allclose(np.linalg.norm(path, axis=1), 1, atol=1e-12)
        assert (np.sum(path[1:] * path[:-1], axis=1) > 0).all()


def test_every_second_sample_is_predicted_without_it():
    stamps = irregular(np.random.default_rng(0), 21, 100.0)
    off = np.zeros((21, 2))
    off[1::2] = [3.0, -1.0]
    values = 1e-9 * (stamps - stamps[0])[:, None] + off
    error = held_out_error(Stream("skin", "tactile", stamps, values))
    np.testing.assert_allclose(error, (np.sqrt(5.0), 3.0), atol=1e-9)


def test_every_kind_of_stream_finds_its_signal():
    recording = make_recording(fingers=2)
    demonstration = synchronise(recording)
    assert demonstration.name == "demo"
    assert demonstration.simulated
    widths = {"position": 3, "orientation": 4, "velocity": 3, "angular_velocity": 3, "joint_positions": 7}
    widths |= {"joint_velocities": 7, "joint_torques": 7, "wrench": 6, "tactile": 38, "tool_to_board": 4}
    for signal, width in widths.items():
        assert getattr(demonstration, signal).shape == (len(demonstration.time), width)
    fingers = [stream for stream in recording.streams if stream.kind == "tactile"]
    start = max(stream.stamps[0] for stream in recording.streams)
    for place, finger in enumerate(fingers):
        expected = np.interp(demonstration.time, seconds(finger.stamps, start), finger.values[:, 18])
        np.testing.assert_allclose(demonstration.tactile[:, 18 + 19 * place], expected, rtol=1e-6)


def test_true_segments_move_with_the_start_and_stay_on_the_clock():
    pose = pose_stream(UNIX + np.arange(101) * 10**7)
    wrist = Stream("/wrist", "wrench", UNIX + 2 * 10**8 + np.arange(71) * 10**7, np.zeros((71, 6)))
    segments = np.array([[0.0, 0.4], [0.4, 0.75], [0.75, 1.0]])
    demonstration = synchronise(Recording("cut", (pose, wrist), segments))
    np.testing.assert_allclose(demonstration.true_segments, [[0, 0.2], [0.2, 0.55], [0.55, 0.7]], atol=1e-12)


def test_an_orientation_that_was_not_recorded_is_none():
    stamps = UNIX + np.arange(10) * 10**6
    streams = (pose_stream(stamps), Stream("/twist", "twist", stamps, np.ones((10, 6))))
    provenance = {"origin": "recorded", "orientation": "not recorded"}
    demonstration = synchronise(Recording("reach", streams, provenance=provenance))
    assert demonstration.orientation is None
    assert demonstration.angular_velocity is None
    assert demonstration.velocity.shape == (10, 3)


def test_a_gap_is_bridged_up_to_its_limit_and_named_beyond():
    recording = Recording("hole", (pose_stream(UNIX + np.r_[0:20, 35:60] * 10**7),))
    bridged = synchronise(recording, max_gap_s=0.16)
    assert (len(bridged.time), bridged.dt) == (60, pytest.approx(0.01))  # the median rate ignores the hole
    place = r"^hole: /tool: row 19 \(stamp 1581238055\.906234152 s\)"
    with pytest.raises(InputError, match=rf"{place} is followed by a gap of 0\.16 s, longer than 0\.15 s"):
        synchronise(recording, max_gap_s=0.15)
    pose = pose_stream(UNIX + np.r_[0:5, 100:200, 300:303] * 10**7)  # outside the time they share
    wrist = Stream("/wrist", "wrench", UNIX + np.arange(100, 200) * 10**7, np.zeros((100, 6)))
    assert synchronise(Recording("hole", (pose, wrist))).time[-1] == pytest.approx(0.99)
    apart = (pose, Stream("/wrist", "wrench", np.arange(10) * 10**7, np.zeros((10, 6))))
    complaint = r"^apart: /tool starts at row 0 \(stamp 1581238055\.7.*\), when /wrist has ended at row 9"
    with pytest.raises(InputError, match=complaint):
        synchronise(Recording("apart", apart))


def line_stream(change=lambda stamps, values: None):
    """A steady motion of which something is changed."""
    stamps = UNIX + np.arange(200) * 10**7
    stream = pose_stream(stamps, 0.1 * seconds(stamps)[:, None] * [1.0, 0.0, 0.0])
    change(stream.stamps, stream.values)
    return Recording("line", (stream,))


def late(rows, seconds_):
    return lambda stamps, values: stamps.__setitem__(rows, stamps[rows] + seconds_ * 10**9)


def off(size_m):
    return lambda stamps, values: values.__setitem__((70, 1), size_m)


def turned(stamps, values):
    values[60, 3:] = [0.0, 1.0, 0.0, 0.0]


def dense(stamps, values):
    stamps[:], values[:, :3] = UNIX + 9 * 10**4 * np.arange(200), 0.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        # a header that is 0 before the clock is known, or a clock that is set: ticks would fill terabytes
        *((late(*one), r"row \d+ .* is followed by a gap of") for one in ((0, -1_581_238_055), (199, 10**5))),
        *((late(slice(100, None), jump), "row 99 .* is followed by a gap") for jump in (10**5, 2 * 10**9)),
        *(
            (off(size), "row 70 .*: position jumps at .* m/s, more than 10 m/s")
            for size in (0.2, 100.0, 1e308)
        ),
        (turned, "row 60 .*: orientation jumps at 314 rad/s"),
        (dense, r"poses come at 1.11e\+04 Hz, more than 10000 Hz"),
    ],
)
def test_stamps_far_off_and_poses_that_jump_are_named_at_once(change, words):
    with pytest.raises(InputError, match=f"line: /tool: {words}"):
        synchronise(line_stream(change))


def bursts(stamps, values):
    """Stamps come in pairs 0.1 ms apart, of 1 m/s."""
    stamps[1::2] = stamps[::2] + 100_000
    values[:, 0] *= 10.0


def other_sign(stamps, values):
    values[50:, 3:] *= -1.0


@pytest.mark.parametrize("change", [bursts, other_sign])
def test_bursts_and_the_other_sign_of_a_quaternion_are_no_jumps(change):
    assert synchronise(line_stream(change), rate_hz=100.0).position.shape[1] == 3


@settings(max_examples=60, deadline=None)
@given(
    sources=st.lists(
        st.lists(st.integers(0, 60), min_size=2, max_size=25, unique=True).map(sorted), min_size=1, max_size=3
    )
)
def test_sources_share_the_stamps_of_the_slowest_but_for_holes(sources):
    arrays = [np.array(one) for one in sources]
    start, end = max(one[0] for one in sources), min(one[-1] for one in sources)
    inside = [[stamp for stamp in one if start <= stamp <= end] for one in sources]
    slowest = min(inside, key=len)
    shared = shared_stamps(arrays).tolist()
    if len(slowest) < 2:
        assert shared == slowest
        return
    longest = 2 * (slowest[-1] - slowest[0]) / (len(slowest) - 1)
    for tick in slowest:
        bridged = []
        for one in sources:
            before, after = max(s for s in one if s <= tick), min(s for s in one if s >= tick)
            bridged.append(after - before <= longest)
        assert (tick in shared) == all(bridged)


STAMPS = np.array([1581238055_716234152 + row * 10**7 for row in range(6)])


def recording(kind="wrench", topic="/wrist", width=6, stamps=STAMPS, values=None):
    """A pose, and a stream of zeros or of some values; a pose takes the place of the other."""
    values = np.zeros((len(stamps), width)) if values is None else values
    other = Stream(topic, kind, np.asarray(stamps), values)
    pose = Stream("/tool", "pose", STAMPS, pose_rows(6))
    return Recording("trial_3", (other,) if kind == "pose" else (pose, other))


def wrench(row, values):
    """A wrench of zeros but for one row."""
    its = np.zeros((6, 6))
    its[row] = values
    return recording(values=its)


def scaled(row, scale, kind="pose", topic="/tool"):
    """Poses, or only their orientations, of which one quaternion is scaled."""
    rows = pose_rows(6)
    rows[row, 3:] *= scale
    return recording(kind, topic, values=rows if kind == "pose" else rows[:, 3:])


def moved(row, nanoseconds):
    return recording(stamps=np.where(np.arange(6) == row, STAMPS + nanoseconds, STAMPS))


MOCAP = ("tool_to_board", "/mocap")


@pytest.mark.parametrize("sound", [recording(), scaled(2, 1.0, *MOCAP), scaled(4, 0.9991), scaled(4, 1.0009)])
def test_a_sound_recording_passes(sound):
    """Also where the norm of a quaternion is within the tolerance."""
    check_recording(sound)


@pytest.mark.parametrize(
    ("bad", "complaint"),
    [
        (wrench(3, np.nan), r"/wrist: row 3 \(stamp 1581238055\.746234152 s\), column 0: value is nan"),
        (wrench(5, [0, 0, -np.inf, 0, 0, 0]), r"/wrist: row 5 .*, column 2: value is -inf"),
        (moved(2, -(10**7)), r"/wrist: row 2 \(stamp 1581238055\.726234152 s\) repeats the stamp"),
        (moved(2, -(10**7) - 1), r"/wrist: row 2 \(.*26234151 s\) runs back in time"),
        (recording(stamps=STAMPS[:1]), "/wrist: needs at least two samples, has 1"),
        (scaled(4, 1.0011), r"/tool: row 4 .*: quaternion has norm 1\.0011, not 1"),
        (scaled(4, 0.0), r"/tool: row 4 .*: quaternion has norm 0, not 1"),
        (scaled(2, 0.9, *MOCAP), r"/mocap: row 2 .*: quaternion has norm 0\.9, not 1"),
        (recording(*MOCAP, width=3), r"/mocap: tool_to_board needs 4 columns, has 3"),
        (recording(width=5), "/wrist: wrench needs 6 columns, has 5"),
        (recording(values=np.zeros((5, 6))), r"/wrist: .*row per stamp, has shape \(5, 6\) and 6 stamps"),
        (recording(values=np.zeros(6)), r"/wrist: .*has shape \(6,\)"),
    ],
)
def test_each_fault_is_named_with_recording_topic_and_row(bad, complaint):
    with pytest.raises(InputError, match=f"^trial_3: {complaint}"):
        check_recording(bad)


DROP, SORT, LOG = (
    StampPolicy(clock=clock, disorder=disorder)
    for clock, disorder in (("header", "drop"), ("header", "sort"), ("log", "error"))
)
TOOL = topic_map(pose="/tool")
DISORDERED = st.lists(st.integers(0, 12), min_size=1, max_size=10)


@settings(max_examples=80, deadline=None)
@given(stamps=DISORDERED)
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
@given(stamps=DISORDERED)
def test_sorting_keeps_the_first_of_each_stamp(stamps):
    rows, note = in_order("here", np.array(stamps), SORT)
    assert rows.tolist() == [stamps.index(stamp) for stamp in sorted(set(stamps))]
    assert (note is None) == (stamps == sorted(set(stamps)))
    if note is not None:
        assert note.endswith(f"{len(stamps) - len(set(stamps))} dropped of {len(stamps)}")


@given(stamps=DISORDERED)
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
    found = survey.stamp_statistics(stamps)
    assert (found.count, found.repeated, found.backward) == (201, 0, 0)
    assert found.rate_hz == pytest.approx(1e3 / 12)  # by the median step
    assert found.largest_gap_s == pytest.approx(0.5)
    assert found.gap_at_s == pytest.approx(1e-9 * stamps[150])
    stamps[[20, 21]] = stamps[[21, 20]]
    stamps[40] = stamps[39]
    found = survey.stamp_statistics(stamps)
    assert (found.backward, found.repeated) == (1, 1)
    assert np.isnan(survey.stamp_statistics(np.array([7])).rate_hz)


def test_delays_of_the_log_behind_the_header(tmp_path):
    taken = 10**9 + 10 * MS * np.arange(1000)
    late = taken + 30 * MS + np.linspace(0, 100 * MS, 1000).astype(int)  # a clock that runs 1 % fast
    rows = pose_messages(taken.tolist(), pose_rows(1000), logged=late.tolist())
    write_bag(tmp_path / "bag.mcap", rows)
    clocks = survey.topic_clocks("", read_bag(tmp_path / "bag.mcap", ["/tool"]).messages["/tool"])
    assert clocks.delay_s == pytest.approx(0.080, abs=1e-4)
    assert clocks.own is clocks.header
    assert clocks.header.rate_hz == pytest.approx(100.0)
