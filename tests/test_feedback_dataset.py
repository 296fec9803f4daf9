from dataclasses import replace

import numpy as np
import pytest
from feedback_toy import toy_dataset
from readers_bags import make_recording

from dissertation.scraping.files import read_datasets, read_expected, read_settings
from structlearn.core import artefacts
from structlearn.core.artefacts import write_table
from structlearn.core.errors import InputError
from structlearn.feedback import coupling_dataset
from structlearn.feedback.coupling_dataset import leave_one_out, to_table, without_generalization
from structlearn.readers import synchronise
from structlearn.readers.demonstration import write_runs


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


@pytest.mark.parametrize("chunk", [1, 7])
def test_parts_are_disjoint_and_cover_everything(chunk):
    """Without generalisation none is left out, whatever the demonstrations' numbers."""
    data = toy_dataset()
    folds = leave_one_out(data, chunk, seed=0)
    assert [fold.number for fold in folds] == [0, 1, 2, 3]
    renumbered = replace(data, demonstration=data.demonstration - 2)
    whole = without_generalization(renumbered, chunk, seed=0)
    assert len(whole.generalization) == 0
    for fold in [*folds, whole]:
        rows = np.concatenate(fold.parts())
        np.testing.assert_array_equal(np.sort(rows), np.arange(len(data.target)))


def test_a_number_is_left_out_of_every_setting_and_other_samples_are_split_as_the_text_says():
    data = toy_dataset()
    for fold in leave_one_out(data, 1, seed=0):
        assert set(data.demonstration[fold.generalization]) == {fold.number}
        assert set(data.setting[fold.generalization]) == set(data.setting)
        for rows in (fold.train, fold.validation, fold.test):
            assert fold.number not in data.demonstration[rows]
        remaining = len(data.target) - len(fold.generalization)
        assert len(fold.validation) == len(fold.test) == round(0.075 * remaining)
        assert len(fold.train) / remaining == pytest.approx(0.85, abs=0.01)


@pytest.mark.parametrize("demonstrations", [1, 4])
def test_a_chunk_is_split_as_a_whole_and_ends_with_its_demonstration(demonstrations):
    """Also where the next demonstration has the same number, in another setting."""
    data = toy_dataset(demonstrations=demonstrations)
    fold = without_generalization(data, 7, seed=0)
    part = np.empty(len(data.target), dtype=int)
    for index, rows in enumerate(fold.parts()):
        part[rows] = index
    seen = set()
    for setting in np.unique(data.setting):
        for number in np.unique(data.demonstration):
            rows = part[(data.setting == setting) & (data.demonstration == number)]
            for start in range(0, len(rows), 7):
                assert len(set(rows[start : start + 7])) == 1
            seen |= set(rows)
    assert seen == {0, 1, 2}


def test_too_little_data_is_named():
    with pytest.raises(InputError, match="1 demonstration per setting: nothing is left"):
        leave_one_out(toy_dataset(demonstrations=1), 1, seed=0)
    with pytest.raises(InputError, match="6 chunks of samples are too few for train, validation and test"):
        leave_one_out(toy_dataset(demonstrations=3), 10_000, seed=0)


def test_settings_are_read_by_their_number_in_rising_order(tmp_path):
    for setting in (10.0, 2.5, -5.0, 0.0):
        runs = [synchronise(make_recording(name, seed=seed)) for seed, name in enumerate(("01", "02"))]
        write_runs(runs, tmp_path / f"{setting:g}.parquet")
    sets = read_settings(tmp_path)
    assert list(sets) == [-5.0, 0.0, 2.5, 10.0]
    for runs in sets.values():
        assert [run.name for run in runs] == ["01", "02"]


@pytest.mark.parametrize("read", [read_settings, read_expected, read_datasets])
def test_a_folder_that_no_stage_has_written_is_not_an_empty_one(tmp_path, read):
    with pytest.raises(InputError, match="nowhere: no such folder; run the stage that writes it"):
        read(tmp_path / "nowhere")


@pytest.fixture
def written(tmp_path):
    """Datasets of two primitives with settings 0, 5 and 10, and a table of checks."""
    datasets = {name: toy_dataset(seed=seed) for seed, name in enumerate(("scrape", "turn"))}
    for name, dataset in datasets.items():
        write_table(to_table(dataset), tmp_path / f"{name}.parquet")
        write_table(to_table(dataset), tmp_path / f"checks_{name}.parquet")
    return tmp_path, datasets


def test_datasets_come_back_without_their_checks_by_whole_settings(written):
    folder, datasets = written
    for read, least in ((read_datasets(folder), 0.0), (read_datasets(folder, (10.0, 5.0)), 5.0)):
        assert list(read) == ["scrape", "turn"]
        for name, dataset in read.items():
            for array, values in vars(datasets[name].where(datasets[name].setting >= least)).items():
                np.testing.assert_array_equal(getattr(dataset, array), values)


def test_settings_that_were_not_recorded_and_tables_of_another_kind_are_named(written):
    folder, datasets = written
    with pytest.raises(InputError, match=r"scrape\.parquet: has no corrections in the settings 2\.5, 7\.5$"):
        read_datasets(folder, (2.5, 5.0, 7.5))
    write_table(to_table(datasets["turn"]).drop(columns="target"), folder / "turn.parquet")
    with pytest.raises(InputError, match=r"turn\.parquet: holds no supervised data \(missing 'target'\)"):
        read_datasets(folder)
