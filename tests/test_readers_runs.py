"""Runs written as a table come back as they were, and a damaged table is an error."""

import dataclasses

import numpy as np
import pyarrow.parquet
import pytest

from structlearn.core.artefacts import write_arrow
from structlearn.core.errors import InputError
from structlearn.readers.demonstration import UNIT, Demonstration, NamedShape, read_runs, write_runs


def _runs() -> list[Demonstration]:
    rng = np.random.default_rng(3)
    shape = NamedShape("box", "cube", np.zeros(3), np.array([1.0, 0, 0, 0]), np.ones(3))
    full = Demonstration(
        name="2",
        time=np.arange(5) / 100,
        position=rng.normal(size=(5, 3)),
        orientation=np.tile([1.0, 0, 0, 0], (5, 1)),
        wrench=rng.normal(size=(5, 6)),
        tactile=np.round(rng.normal(size=(5, 12)) * 100),
        joint_positions=rng.normal(size=(5, 2)),
        joint_names=("a", "b"),
        true_segments=np.array([[0.0, 0.1], [0.1, 1 / 3]]),
        provenance={"origin": "simulated", "person": "1"},
        shapes=(shape,),
    )
    bare = Demonstration(name="10", time=np.arange(3) / 7, position=rng.normal(size=(3, 3)))
    return [full, bare]


def test_runs_come_back_bit_for_bit(tmp_path):
    write_runs([], tmp_path / "none.parquet")
    assert read_runs(tmp_path / "none.parquet") == []
    write_runs(_runs(), tmp_path / "runs.parquet")
    schema = pyarrow.parquet.read_schema(tmp_path / "runs.parquet")
    for column, unit in (("time", b"s"), ("position.x", b"m"), ("joint_positions.1", b"rad")):
        assert schema.field(column).metadata[UNIT] == unit
    for before, after in zip(_runs(), read_runs(tmp_path / "runs.parquet"), strict=True):
        for field in dataclasses.fields(before):
            its, their = getattr(before, field.name), getattr(after, field.name)
            if isinstance(its, np.ndarray):
                assert np.array_equal(its, their)
                assert their.dtype == its.dtype
                assert their.flags.c_contiguous
            else:
                assert str(its) == str(their)


def test_another_table_and_changed_provenance_are_refused(tmp_path):
    path = tmp_path / "runs.parquet"
    write_arrow(pyarrow.table({"a": [1]}), path)
    with pytest.raises(InputError, match="holds no runs"):
        read_runs(path)
    write_runs(_runs(), path)
    table = pyarrow.parquet.read_table(path)
    metadata = {key: value.replace(b"simulated", b"recorded") for key, value in table.schema.metadata.items()}
    pyarrow.parquet.write_table(table.replace_schema_metadata(metadata), path, write_page_checksum=True)
    with pytest.raises(InputError, match="damaged"):
        read_runs(path)
