from dataclasses import replace

import numpy as np
import pytest
from feedback_toy import toy_dataset

from structlearn.feedback import coupling_dataset
from structlearn.ground import artefacts
from structlearn.primitives import canonical, kernels


def test_modulation_is_that_of_the_forcing_term():
    data = toy_dataset(demonstrations=2, settings=(0.0,), samples=(30, 30))
    features = data.modulation()
    assert features.shape == (60, kernels.KERNEL_COUNT)
    np.testing.assert_allclose(features[:30], kernels.unit_features(30), atol=1e-12)
    np.testing.assert_allclose(features.sum(axis=1), data.phase_velocity, atol=1e-12)
    _, u = canonical.phase(np.linspace(0.0, 1.0, 30), 2.0)
    np.testing.assert_allclose(data.modulation(5).sum(axis=1)[:30], u, atol=1e-12)


def test_axes_of_one_primitive_share_a_table(tmp_path):
    """Settings are labels there, and channels of another unit a group of their own."""
    data = replace(toy_dataset(channels=10), groups=(4, 3, 3))
    labels = np.array(["5", "tilt_left"])[(data.setting > 5.0).astype(int)]
    shown = {"ry": replace(data, setting=labels), "z": replace(data, setting=labels, target=-data.target)}
    table = coupling_dataset.to_axes_table(shown)
    assert [name for name in table if name.startswith("target_")] == ["target_z", "target_ry"]
    assert {"channel_03", "channel_1_00", "channel_2_02"} < set(table)
    artefacts.write_table(table, tmp_path / "data.parquet")
    found = coupling_dataset.from_axes_table(artefacts.read_table(tmp_path / "data.parquet"))
    assert list(found) == ["z", "ry"]
    for axis, dataset in found.items():
        assert dataset.groups == (4, 3, 3)
        for name in coupling_dataset.COLUMNS:
            np.testing.assert_array_equal(getattr(dataset, name), getattr(shown[axis], name))
    with pytest.raises(KeyError, match="target_<axis>"):
        coupling_dataset.from_axes_table(coupling_dataset.to_table(data))
