"""Samples of logs far beyond what the URDF allows."""

from dataclasses import replace

import numpy as np
import pytest
from rigid_body_robots import joint, link

from structlearn.core.errors import InputError
from structlearn.readers.joint_log import DriveLog, JointLog, signals_of, unusable_efforts
from structlearn.readers.joint_streams import JointSeries
from structlearn.rigid_body.log_limits import possible_samples
from structlearn.rigid_body.robot import Robot, read_urdf

COUNT = 1000


@pytest.fixture
def arm(tmp_path):
    def read(limit: str) -> Robot:
        path, hinge = tmp_path / "arm.urdf", joint("lift", "revolute", "base", "arm", limit=limit)
        path.write_text(f'<robot name="arm"><link name="base"/>{link("arm")}{hinge}</robot>')
        return read_urdf(path)

    return read


KNOWN = '<limit lower="-2.9" upper="2.9" velocity="2" effort="80"/>'
UNKNOWN = '<limit lower="-2.9" upper="2.9" velocity="0" effort="0"/>'
HUGE = '<limit lower="-2.9" upper="2.9" velocity="1e9" effort="1e9"/>'


def log(**changed) -> JointLog:
    """`changed`: value of a signal at rows 500 and 700."""
    t = 0.01 * np.arange(COUNT)
    q, qd, torque = np.sin(t), np.cos(t), 60.0 * np.sin(3.0 * t)
    made = JointLog("log_2", ("lift",), (1e9 * t).astype(np.int64), *(x[:, None] for x in (q, qd, torque)))
    for signal, value in changed.items():
        getattr(made, signal)[[500, 700]] = value
    return made


@pytest.mark.parametrize("limit", [KNOWN, UNKNOWN, HUGE])
@pytest.mark.parametrize(
    ("signal", "value", "words"),
    [
        ("torques", 1e6, "effort of joint 'lift' is 1e+06 N m, more than"),
        ("torques", -1e224, "effort of joint 'lift' is -1e+224 N m, more than"),
        ("velocities", 1e3, "velocity of joint 'lift' is 1000 rad/s, more than"),
        (
            "positions",
            -115.0,
            "position of joint 'lift' is -115 rad, more than 2 times half",
        ),
    ],
)
def test_a_few_impossible_samples_are_left_out_and_named(arm, limit, signal, value, words):
    kept, table = possible_samples(arm(limit), {"log_2": log(**{signal: value})})
    assert np.setdiff1d(log().stamps, kept["log_2"].stamps).tolist() == [5 * 10**9, 7 * 10**9]
    rows = np.delete(np.arange(COUNT), [500, 700])
    for name in signals_of(JointLog):
        np.testing.assert_array_equal(getattr(kept["log_2"], name), getattr(log(), name)[rows])
    (row,) = table.itertuples()
    assert (row.log, row.samples) == ("log_2", 2)
    assert row.text.startswith(f"log_2: row 500 (stamp 5.000000000 s): {words}")
    assert row.text.endswith("(and 1 more)")


def test_the_limit_is_named(arm):
    _, table = possible_samples(arm(KNOWN), {"log_2": log(torques=1e6)})
    assert "more than 2 times the URDF's limit of 80 N m" in table["text"][0]


@pytest.mark.parametrize(
    ("signal", "value"), [("torques", 82.0), ("torques", -120.0), ("velocities", 2.5), ("positions", 3.2)]
)
def test_what_exceeds_a_limit_a_little_stays(arm, signal, value):
    logs = {"log_2": log(**{signal: value})}
    kept, table = possible_samples(arm(KNOWN), logs)
    assert kept["log_2"] is logs["log_2"]
    assert table.empty


@pytest.mark.parametrize(
    ("signal", "factor", "unit"),
    [("positions", 57.3, "rad, not degrees"), ("torques", 1e3, "N m"), ("velocities", 57.3, "rad/s, not")],
)
def test_many_impossible_samples_are_refused(arm, signal, factor, unit):
    made = log()
    made = replace(made, **{signal: factor * getattr(made, signal)})
    with pytest.raises(InputError, match=rf"log_2: row \d+ .*'lift'.* % may be left out: is it in {unit}"):
        possible_samples(arm(KNOWN), {"log_2": made})


def test_garbage_beside_zeros_is_found_without_a_limit(arm):
    made = replace(log(), torques=np.zeros((COUNT, 1)))
    made.torques[[3, 4]] = 1.8e237
    kept, table = possible_samples(arm(UNKNOWN), {"log_2": made})
    assert not kept["log_2"].torques.any()
    assert "effort of joint 'lift' is 1.8e+237 N m, more than any arm has (and 1 more)" in table["text"][0]
    made.torques[:100] = 1.8e237
    with pytest.raises(InputError, match="10 % of its samples are as far off"):
        possible_samples(arm(UNKNOWN), {"log_2": made})


def test_currents_are_not_compared_with_limits_of_torque(arm):
    made = log()
    currents = np.full((COUNT, 1), 300.0)
    drive = DriveLog(
        *("log", made.joints, made.stamps, made.positions, made.velocities),
        *(currents, currents.copy(), made.torques),
    )
    assert possible_samples(arm(KNOWN), {"log": drive})[1].empty
    drive.currents[3] = 1e9
    assert possible_samples(arm(KNOWN), {"log": drive})[1]["samples"].tolist() == [1]


MOVING = np.sin(np.arange(6.0)).reshape(3, 2)


@pytest.mark.parametrize(
    ("efforts", "reason"),
    [
        (MOVING, ""),
        (MOVING * [1.0, np.nan], ""),  # of a gripper that measures none
        (None, "there are no efforts, or all are NaN"),
        (np.zeros((3, 2)), "all efforts are 0"),
        (np.zeros((3, 2)) * [1.0, np.nan], "all efforts are 0 or NaN"),
        (np.full((3, 2), 5.0), "no effort changes"),
    ],
)
def test_efforts_are_looked_at_before_identification_is_offered(efforts, reason):
    values = {"joint_positions": MOVING, "joint_velocities": MOVING}
    values |= {} if efforts is None else {"joint_torques": efforts}
    series = JointSeries("/joint_states", ("lift", "finger"), 0, np.arange(3), values)
    assert unusable_efforts(series) == reason
