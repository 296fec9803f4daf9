import numpy as np
from structlearn.tasks.public.protocol.movement import mean_orientation_path

from structlearn.core import quaternion


def test_mean_orientation_path_is_the_middle_of_two():
    axis = np.array([0.0, 0.0, 1.0])
    angles = np.linspace(0.0, 3.0, 50)[:, None]
    paths = [quaternion.from_rotation_vector(factor * angles * axis) for factor in (0.8, 1.2)]
    mean = mean_orientation_path(paths, 70)
    expected = quaternion.from_rotation_vector(np.linspace(0.0, 3.0, 70)[:, None] * axis)
    assert quaternion.angle_between(mean, expected).max() < 1e-3
