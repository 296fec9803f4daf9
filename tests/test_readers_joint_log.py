import numpy as np
import pytest
from readers_bags import write_bag

from structlearn.core.errors import InputError
from structlearn.readers.bag_recording import JOINT_STATES, read_joint_log, write_joint_log
from structlearn.readers.joint_log import DriveLog, JointLog, read_log_table, signals_of, write_log_table

JOINT_STATE = "sensor_msgs/msg/JointState"
NAMES = ["shoulder", "elbow"]
SIGNALS = signals_of(JointLog)
VALUES = np.array([[0.1, 0.2], [0.3, 0.4]])


def log(**changes) -> JointLog:
    values = np.arange(6.0).reshape(3, 2)
    fields = {
        "name": "run",
        "joints": tuple(NAMES),
        "stamps": np.array([5, 7, 11]) * 10**6,
        "positions": values,
        "velocities": values + 10.0,
        "torques": values / 3.0,
        "provenance": {"origin": "simulated", "seed": "1"},
    }
    return JointLog(**(fields | changes))


def bag(path, **changes):
    """Three messages of joint states; a field set to None is left out."""
    rows = []
    for row in range(3):
        stamp = {"sec": 4, "nanosec": row * 10**7}
        message = {"header": {"stamp": stamp, "frame_id": ""}, "name": NAMES}
        message |= {"position": [row, 1.0], "velocity": [2.0, row], "effort": [0.5, -row]}
        message = {key: value for key, value in (message | changes).items() if value is not None}
        rows.append((JOINT_STATES, JOINT_STATE, message, row * 10**7))
    write_bag(path, rows)
    return path


def test_logs_go_through_a_file_and_a_table_bit_by_bit(tmp_path):
    signals = dict.fromkeys(SIGNALS, VALUES)
    other = log(name="other", joints=("a", "b"), stamps=np.array([-1, 2**62]), **signals)
    drives = DriveLog("drives", ("a", "b"), np.array([1, 2]), *[VALUES + number for number in range(5)])
    for logs in ([log(), other], [drives]):
        write_log_table(logs, tmp_path / "logs.parquet")
        back = read_log_table(tmp_path / "logs.parquet", type(logs[0]))
        for one, read in zip(logs, back, strict=True):
            assert (read.name, read.joints, read.provenance) == (one.name, one.joints, one.provenance)
            for field in ("stamps", *signals_of(type(one))):
                np.testing.assert_array_equal(getattr(read, field), getattr(one, field))
    write_joint_log(log(), tmp_path / "run.mcap")
    back = read_joint_log(tmp_path / "run.mcap")
    assert (back.name, back.joints, back.provenance) == ("run", log().joints, log().provenance)
    for field in ("stamps", *SIGNALS):
        np.testing.assert_array_equal(getattr(back, field), getattr(log(), field))
    np.testing.assert_allclose(back.time, [0.0, 0.002, 0.006], atol=1e-15)
    with pytest.raises(InputError, match=r"logs.parquet: no JointLog: drives has no 'torques.a'"):
        read_log_table(tmp_path / "logs.parquet")


def test_a_robots_bag_is_read_without_our_metadata(tmp_path):
    back = read_joint_log(bag(tmp_path / "robot.mcap"))
    assert back.joints == tuple(NAMES)
    np.testing.assert_array_equal(back.torques, [[0.5, 0.0], [0.5, -1.0], [0.5, -2.0]])
    assert back.provenance == {"origin": "recorded", "source": "robot.mcap"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"effort": None}, r"bag\.mcap: topic '/joint_states' has no joint torques"),
        ({"effort": [float("nan")] * 2}, "has no joint torques"),
        ({"velocity": None}, "has no joint velocities"),
        ({"name": None}, "does not name the joints"),
        ({"position": [1.0]}, "names 2 joints and has 1 joint_positions"),
        ({"effort": [1.0, float("nan")]}, r"row 0 .*torques of joint 'elbow' are nan"),
    ],
)
def test_what_a_model_cannot_be_learned_from_is_named(tmp_path, changes, message):
    with pytest.raises(InputError, match=message):
        read_joint_log(bag(tmp_path / "bag.mcap", **changes))
    with pytest.raises(InputError, match=r"has no topic '/arm' for joint_states; it has /joint_states"):
        read_joint_log(tmp_path / "bag.mcap", "/arm")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"stamps": np.array([1, 1, 2])}, r"row 1 .* does not come after the one before it"),
        ({"torques": np.ones((3, 1))}, r"torques have shape \(3, 1\), not 3 samples of 2 joints"),
        ({"stamps": np.array([1])}, "needs at least two samples, has 1"),
    ],
)
def test_a_log_that_does_not_hold_together_is_refused(changes, message):
    with pytest.raises(InputError, match=message):
        log(**changes)
