"""What tests of recordings share: a demonstration to show, and what stands in a file."""

import shutil
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

import numpy as np
from conftest import minimum_jerk
from rerun.chunk import RrdReader

from structlearn.core import quaternion
from structlearn.readers.demonstration import Demonstration

DT = 1 / 200
ONLY_POSITION = {"orientation": None, "wrench": None, "tactile": None, "provenance": {}}
PRIMITIVES = [
    {"name": "down", "axis": "z", "threshold_m_s": 0.02},
    {"name": "between", "axis": "between", "threshold_m_s": None},
    {"name": "along", "axis": "y", "threshold_m_s": 0.02},
]


def demonstration(name, delay=0.0, angle=0.5, **signals):
    """Down along z, a pause, then along y."""
    time = DT * np.arange(700)
    down, along = (minimum_jerk((time - delay - begin) / 0.8) for begin in (0.6, 1.9))
    position = np.column_stack([0.3 + 0 * time, 0.06 * along, -0.08 * down])
    turn = quaternion.from_rotation_vector(angle * along[:, None] * np.array([0.0, 0.0, 1.0]))
    every = {
        "orientation": quaternion.sign_continuous(turn),
        "wrench": np.ones((len(time), 6)),
        "tactile": np.tile(np.arange(38.0), (len(time), 1)),
        "provenance": {"origin": "simulated"},
    }
    return Demonstration(name, time, position, **{**every, **signals})


def verify(path):
    """`rerun rrd verify`, by the script that belongs to this interpreter."""
    script = shutil.which("rerun", path=str(Path(sys.executable).parent)) or shutil.which("rerun")
    subprocess.run([script, "rrd", "verify", str(path)], check=True, capture_output=True)


def contents(path):
    """Rows that change over time by entity, all entities, and all time lines of a verified file."""
    verify(path)
    reader = RrdReader(path)
    assert len(reader.recordings()) == 1
    assert len(reader.blueprints()) == 1
    rows, entities, timelines = {}, set(), set()
    for chunk in chunks(path):
        entities.add(chunk.entity_path)
        if not chunk.is_static:
            timelines |= set(chunk.timeline_names)
            rows[chunk.entity_path] = rows.get(chunk.entity_path, 0) + chunk.num_rows
    return rows, entities, timelines


def chunks(path):
    """Chunks of a file, which is read once for all that is asked of it."""
    return _read(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=2)
def _read(path, written_ns):
    return RrdReader(path).stream().to_chunks()


def values(path, entity, component):
    """Values of a component of an entity in the order of time, static ones first."""
    batches = [chunk.to_record_batch() for chunk in chunks(path) if chunk.entity_path == entity]
    columns = [batch.column(component).to_pylist() for batch in batches if component in batch.schema.names]
    return [value for column in columns for value in column if value is not None]


def note(path, place="/notes"):
    """Text of a panel."""
    return values(path, place, "TextDocument:text")[0][0]


def colour_of(path, entity, archetype="SeriesLines"):
    """The first of an entity's colours, without its opacity."""
    return f"#{values(path, entity, f'{archetype}:colors')[0][0] >> 8:06x}"


def view_names(path):
    """Headings of the blueprint's views."""
    reader = RrdReader(path)
    names = []
    for chunk in reader.stream(store=reader.blueprints()[0]).to_chunks():
        batch = chunk.to_record_batch()
        names += [
            value[0]
            for column, values in zip(batch.schema.names, batch.columns, strict=True)
            if column == "ViewBlueprint:display_name"
            for value in values.to_pylist()
            if value
        ]
    return names
