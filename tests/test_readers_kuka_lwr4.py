"""Logs of a KUKA LWR4+: the reader on made-up archives, and on the recorded arm."""

import numpy as np
import pytest
from readers_bags import recorded_data

from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers import kuka_lwr4


def write(path, **changes):
    values = {name: np.arange(21.0).reshape(3, 7) for name in ("positions", "velocities", "torques")}
    np.savez(path, **({"times": np.array([1.46e9, 1.46e9 + 0.005, 1.46e9 + 0.01])} | values | changes))


def test_arrays_go_to_joints_and_samples(tmp_path):
    for name in ("measurements_10", "measurements_2"):
        write(tmp_path / f"{name}.npz")
    first, second = kuka_lwr4.read_motion(tmp_path)
    assert (first.name, second.name, first.joints) == ("measurements_2", "measurements_10", kuka_lwr4.JOINTS)
    np.testing.assert_allclose(first.time, [0.0, 0.005, 0.01], atol=1e-6)
    np.testing.assert_array_equal(first.torques[1], np.arange(7.0, 14.0))
    assert first.provenance["commit"] == kuka_lwr4.SOURCE.commit


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"torques": np.zeros((3, 6))}, r"torques have shape \(3, 6\), not 3 samples of 7 joints"),
        ({"times": np.array([0.0, np.nan, 1.0])}, "times are no times in s"),
        ({"times": np.array([0.0, 1.0, 1e30])}, "times are no times in s"),
        ({"positions": np.array([None] * 3, dtype=object)}, "cannot be read as arrays"),
    ],
)
def test_faults_are_named_with_the_file(tmp_path, changes, message):
    write(tmp_path / "measurements_1.npz", **changes)
    with pytest.raises(InputError, match=rf"measurements_1.*: .*{message}"):
        kuka_lwr4.read_motion(tmp_path)


def test_a_missing_array_or_log_is_told(tmp_path):
    with pytest.raises(MissingInputError, match="holds no logs"):
        kuka_lwr4.read_motion(tmp_path)
    np.savez(tmp_path / "measurements_1.npz", times=np.arange(3.0))
    (tmp_path / "measurements_2.npz").write_bytes(b"no archive")
    left_out: dict[str, str] = {}
    assert kuka_lwr4.read_motion(tmp_path, None, left_out) == []
    first, second = left_out.values()
    assert "has no array positions" in first
    assert "measurements_2.npz: cannot be read as arrays" in second


def test_the_recorded_logs_are_read_in_full():
    logs = kuka_lwr4.read_motion(recorded_data("kuka_lwr4"))
    assert [(log.name, log.positions.shape) for log in logs] == [
        ("measurements_1", (5027, 7)),
        ("measurements_2", (5027, 7)),
    ]
