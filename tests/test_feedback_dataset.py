import numpy as np
from feedback_toy import toy_dataset

from structlearn.feedback import coupling_dataset
from structlearn.ground import artefacts
from structlearn.primitives import canonical, kernels


def test_a_stored_dataset_is_the_same_bit_for_bit(tmp_path):
    data = toy_dataset(channels=38)
    artefacts.write_table(coupling_dataset.to_table(data), tmp_path / "data.parquet")
    found = coupling_dataset.from_table(artefacts.read_table(tmp_path / "data.parquet"))
    for name, values in vars(data).items():
        np.testing.assert_array_equal(getattr(found, name), values)
    assert found.demonstration.dtype.kind == "i"


def test_a_mask_and_indices_choose_the_same_samples():
    data = toy_dataset()
    mask = data.setting == 5.0
    by_mask, by_index = data.where(mask), data.where(np.flatnonzero(mask))
    assert len(by_mask.target) == mask.sum() > 0
    for name, values in vars(by_mask).items():
        np.testing.assert_array_equal(getattr(by_index, name), values)
        assert len(values) == mask.sum()


def test_modulation_is_that_of_the_forcing_term():
    data = toy_dataset(demonstrations=2, settings=(0.0,), samples=(30, 30))
    features = data.modulation()
    assert features.shape == (60, kernels.KERNEL_COUNT)
    np.testing.assert_allclose(features[:30], kernels.unit_features(30), atol=1e-12)
    np.testing.assert_allclose(features.sum(axis=1), data.phase_velocity, atol=1e-12)
    _, u = canonical.phase(np.linspace(0.0, 1.0, 30), 2.0)
    np.testing.assert_allclose(data.modulation(5).sum(axis=1)[:30], u, atol=1e-12)


def test_datasets_are_put_one_after_the_other():
    whole = toy_dataset()
    parts = [whole.where(whole.demonstration == number) for number in np.unique(whole.demonstration)]
    together = coupling_dataset.concatenated(parts)
    order = np.argsort(whole.demonstration, kind="stable")
    for name, values in vars(together).items():
        np.testing.assert_array_equal(values, getattr(whole, name)[order])
