import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import rerun as rr
from rerun.chunk import RrdReader
from rerun.error_utils import strict_mode

from structlearn.ground import quaternion
from structlearn.primitives import sequence
from structlearn.primitives.fitting import FitParameters, learn_primitive
from structlearn.primitives.trajectory import differentiated, differentiated_orientation
from structlearn.recordings.demonstration import Demonstration
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import cut
from structlearn.testbeds.scraping.recordings.alignment_recording import write_alignment
from structlearn.viewer.learned_primitives import write_primitives
from structlearn.viewer.recorded_demonstrations import write_demonstrations
from structlearn.viewer.rrd import recording

DT = 1 / 200
THINNED = 2  # samples of 200 Hz per row in a recording


def minimum_jerk(times, start, end):
    s = np.clip((times - start) / (end - start), 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def demonstration(name, delay=0.0, angle=0.5, **signals):
    """Down along z, a pause, then along y."""
    time = DT * np.arange(700)
    down, along = minimum_jerk(time - delay, 0.6, 1.4), minimum_jerk(time - delay, 1.9, 2.7)
    position = np.column_stack([0.3 + 0 * time, 0.06 * along, -0.08 * down])
    turn = quaternion.from_rotation_vector(angle * along[:, None] * np.array([0.0, 0.0, 1.0]))
    every = {
        "orientation": quaternion.sign_continuous(turn),
        "wrench": np.ones((len(time), 6)),
        "tactile": np.tile(np.arange(38.0), (len(time), 1)),
        "provenance": {"origin": "simulated"},
    }
    return Demonstration(name, time, position, **{**every, **signals})


ONLY_POSITION = {"orientation": None, "wrench": None, "tactile": None, "provenance": {}}


@pytest.fixture(scope="module")
def demonstrations():
    return [demonstration("1"), demonstration("two words/2", delay=0.1), demonstration("3", delay=-0.1)]


@pytest.fixture(scope="module")
def parameters():
    return SegmentParameters(
        primitives=[
            {"name": "down", "axis": "z", "threshold_m_s": 0.02},
            {"name": "between", "axis": "between"},
            {"name": "along", "axis": "y", "threshold_m_s": 0.02},
        ]
    )


@pytest.fixture(scope="module")
def segmentation(demonstrations, parameters):
    return cut(demonstrations, parameters)


def learned(demonstrations):
    """One primitive from whole demonstrations, and its unrolled path."""
    segments = [
        (
            differentiated(one.position, DT, 5.0),
            None if one.orientation is None else differentiated_orientation(one.orientation, DT, 5.0),
        )
        for one in demonstrations
    ]
    primitives = [learn_primitive("whole", segments, FitParameters())]
    return primitives, sequence.sequence_table(sequence.unroll(primitives, DT), ["whole"])


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
    for chunk in reader.stream().to_chunks():
        entities.add(chunk.entity_path)
        if not chunk.is_static:
            timelines |= set(chunk.timeline_names)
            rows[chunk.entity_path] = rows.get(chunk.entity_path, 0) + chunk.num_rows
    return rows, entities, timelines


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


def test_demonstrations_show_every_signal_on_one_time_line(tmp_path, demonstrations, segmentation):
    path = tmp_path / "all.rrd"
    write_demonstrations(path, demonstrations, segmentation, "Test")
    rows, entities, timelines = contents(path)
    assert timelines == {"time"}  # no wall clock
    samples = len(demonstrations[0].time) // THINNED
    for kind in ("hands", "moved", "turned", "force", "torque", "tactile\\ 1", "tactile\\ 2"):
        assert rows[f"/{kind}/1"] == samples, kind
    assert rows["/position/z/1"] == samples + 5  # and the colours of rest, three primitives, rest
    assert rows["/cuts/z/1"] == 4
    assert rows["/primitive/1"] == 4
    assert {"/paths/1", "/paths/two\\ words\\/2", "/paths/3"} <= entities
    assert "Test (simulated)" in view_names(path)


def test_demonstrations_without_orientation_wrench_and_tactile(tmp_path):
    path = tmp_path / "positions.rrd"
    write_demonstrations(path, [demonstration("1", **ONLY_POSITION), demonstration("2", **ONLY_POSITION)])
    rows, entities, _ = contents(path)
    assert rows["/hands/1"] == 350
    assert not any(path.startswith(("/turned", "/force", "/tactile", "/primitive")) for path in entities)
    assert "Demonstrations" in view_names(path)  # recorded: nothing is added to the title


def test_mixed_origins_and_signals_are_told_apart(tmp_path):
    path = tmp_path / "mixed.rrd"
    odd = demonstration("odd", **{**ONLY_POSITION, "tactile": np.zeros((700, 5))})
    write_demonstrations(path, [demonstration("1"), odd], None, "Mixed")
    rows, entities, _ = contents(path)
    assert rows["/tactile/odd"] == 350  # no multiple of a finger's electrodes: one plot
    assert "/turned/odd" not in entities
    assert {"Mixed (1 of 2 simulated)", "1 (simulated)", "odd"} <= set(view_names(path))


def test_alignment_has_one_step_per_demonstration(tmp_path, demonstrations, segmentation, parameters):
    path = tmp_path / "alignment.rrd"
    write_alignment(path, demonstrations, segmentation, parameters, "Alignment")
    rows, entities, timelines = contents(path)
    assert timelines == {"demonstration"}
    for primitive in ("down", "along"):
        assert rows[f"/{primitive}/guess/curve"] == 2
        assert rows[f"/{primitive}/pairs"] == 2
        assert f"/{primitive}/reference/curve" in entities
    assert not any(path.startswith("/between") for path in entities)


def test_alignment_without_the_demonstrations_left_out(tmp_path, demonstrations, segmentation, parameters):
    path = tmp_path / "alignment.rrd"
    cuts = segmentation.cuts[segmentation.cuts["demonstration"] != "3"]
    left = type(segmentation)(cuts, segmentation.pairs, pd.DataFrame(), segmentation.reference)
    write_alignment(path, demonstrations, left, parameters)
    write_demonstrations(tmp_path / "demonstrations.rrd", demonstrations, left)
    assert contents(path)[0]["/down/guess/curve"] == 1
    assert "/primitive/3" not in contents(tmp_path / "demonstrations.rrd")[1]


@pytest.mark.parametrize("turn", [None, 0.5, 7.0])  # no orientation, quaternion and twist-swing primitive
def test_primitives_run_on_time_and_phase(tmp_path, turn):
    signals = ONLY_POSITION if turn is None else {"angle": turn}
    demonstrations = [demonstration("1", **signals), demonstration("2", delay=0.1, **signals)]
    primitives, table = learned(demonstrations)
    path = tmp_path / "primitives.rrd"
    write_primitives(path, demonstrations, primitives, {"nominal": table, "other": table}, "Primitives")
    rows, entities, timelines = contents(path)
    assert timelines == {"time", "phase"}
    samples = rows["/hands/nominal"]
    assert samples == len(table) // THINNED + 1  # with the last one
    for entity in ("phase/nominal/p", "phase/other/u", "speed/nominal", "acceleration/other"):
        assert rows[f"/{entity}"] == samples, entity
    assert rows["/forcing/position"] == samples
    assert ("/forcing/orientation" in entities) == (turn is not None)
    assert {"/demonstrations/1", "/frames/whole", "/goals/whole", "/switches/nominal"} <= entities


def test_errors_of_rerun_raise_and_strictness_ends_with_the_recording(tmp_path):
    before = strict_mode()
    with (
        pytest.raises(ValueError, match="expected sequence"),
        recording(tmp_path / "broken.rrd", "Broken") as stream,
    ):
        stream.log("points", rr.Points3D([[0.0, 0.0, 0.0]], colors="no colour"))
    assert strict_mode() == before
