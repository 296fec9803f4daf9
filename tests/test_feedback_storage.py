import numpy as np
import pytest
from feedback_toy import toy_dataset
from readers_bags import make_recording

from structlearn.core.artefacts import write_table
from structlearn.core.errors import InputError
from structlearn.feedback.coupling_dataset import to_table
from structlearn.readers import synchronise
from structlearn.readers.demonstration import write_runs
from structlearn.testbeds.scraping.files import read_datasets, read_expected, read_settings


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


def test_settings_that_were_not_recorded_are_named(written):
    with pytest.raises(InputError, match=r"scrape\.parquet: has no corrections in the settings 2\.5, 7\.5$"):
        read_datasets(written[0], (2.5, 5.0, 7.5))


def test_a_table_of_another_kind_is_named(written):
    folder, datasets = written
    write_table(to_table(datasets["turn"]).drop(columns="target"), folder / "turn.parquet")
    with pytest.raises(InputError, match=r"turn\.parquet: holds no supervised data \(missing 'target'\)"):
        read_datasets(folder)
