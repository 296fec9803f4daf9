import numpy as np
import pytest
from readers_bags import pose_rows

from structlearn.core.errors import InputError
from structlearn.readers import Recording, Stream
from structlearn.readers.recording import at_row, check_recording

STAMPS = np.array([1581238055_716234152 + row * 10**7 for row in range(6)])


def with_stream(values, stamps=STAMPS, topic="/wrist", kind="wrench"):
    pose = Stream("/tool", "pose", STAMPS, pose_rows(6))
    return Recording("trial_3", (pose, Stream(topic, kind, np.asarray(stamps), values)))


def with_wrench(stamps=STAMPS, **cells):
    """A recording with a pose and a wrench of zeros, some of its rows replaced."""
    values = np.zeros((len(stamps), 6))
    for row, cell in cells.items():
        values[int(row.removeprefix("row"))] = cell
    return with_stream(values, stamps)


def with_pose(scale):
    values = pose_rows(6)
    values[4, 3:] *= scale
    return Recording("trial_3", (Stream("/tool", "pose", STAMPS, values),))


def with_tool_to_board(scale=1.0, columns=4):
    turns = np.hstack([pose_rows(6)[:, 3:], np.zeros((6, 1))])[:, :columns]
    turns[2] *= scale
    return with_stream(turns, topic="/mocap", kind="tool_to_board")


def moved(row, nanoseconds):
    stamps = STAMPS.copy()
    stamps[row] += nanoseconds
    return stamps


@pytest.mark.parametrize(
    "recording", [with_wrench(), with_tool_to_board(), with_pose(0.9991), with_pose(1.0009)]
)
def test_a_sound_recording_passes(recording):
    """Also where the norm of a quaternion is within the tolerance."""
    check_recording(recording)


@pytest.mark.parametrize(
    ("recording", "complaint"),
    [
        (
            with_wrench(row3=np.nan),
            r"/wrist: row 3 \(stamp 1581238055\.746234152 s\), column 0: value is nan",
        ),
        (with_wrench(row5=[0, 0, -np.inf, 0, 0, 0]), r"/wrist: row 5 .*, column 2: value is -inf"),
        (
            with_wrench(moved(2, -(10**7))),
            r"/wrist: row 2 \(stamp 1581238055\.726234152 s\) repeats the stamp",
        ),
        (with_wrench(moved(2, -(10**7) - 1)), r"/wrist: row 2 \(.*26234151 s\) runs back in time"),
        (with_wrench(STAMPS[:1]), "/wrist: needs at least two samples, has 1"),
        (with_pose(1.0011), r"/tool: row 4 .*: quaternion has norm 1\.0011, not 1"),
        (with_tool_to_board(0.9), r"/mocap: row 2 .*: quaternion has norm 0\.9, not 1"),
        (with_tool_to_board(columns=3), r"/mocap: tool_to_board needs 4 columns, has 3"),
        (with_pose(0.0), r"/tool: row 4 .*: quaternion has norm 0, not 1"),
        (with_stream(np.zeros((6, 5))), "/wrist: wrench needs 6 columns, has 5"),
        (with_stream(np.zeros((5, 6))), r"/wrist: .*one row per stamp, has shape \(5, 6\) and 6 stamps"),
        (with_stream(np.zeros(6)), r"/wrist: .*has shape \(6,\)"),
    ],
)
def test_each_fault_is_named_with_recording_topic_and_row(recording, complaint):
    with pytest.raises(InputError, match=f"^trial_3: {complaint}"):
        check_recording(recording)


def test_stamps_are_told_without_rounding():
    assert at_row(0, np.array([1581238055_000000001])) == "row 0 (stamp 1581238055.000000001 s)"
    assert at_row(0, np.array([-1_500_000_000])) == "row 0 (stamp -1.500000000 s)"
