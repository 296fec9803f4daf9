import resource
from contextlib import nullcontext

import numpy as np
import pytest
import rerun as rr
from committed import committed
from rigid_body_robots import joint, link
from viewer_files import DT, ONLY_POSITION, PRIMITIVES, contents, demonstration, values, verify, view_names

from structlearn.core.errors import InputError
from structlearn.palette import BLUE, LIGHT_BLUE, OCHRE
from structlearn.primitives import sequence
from structlearn.primitives.fitting import FitParameters, learn_primitive, segment_paths, whole_run_cuts
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import cut
from structlearn.viewer import items, views
from structlearn.viewer.arms import sticks
from structlearn.viewer.demonstrations import demonstrations as demonstrated
from structlearn.viewer.diagram import Diagram, tick_step
from structlearn.viewer.primitives import primitives as unrolled
from structlearn.viewer.recording import Recording, publish_recordings, write

THINNED = 2  # samples of 200 Hz per row in a recording


def learned(demonstrations):
    """One primitive from whole demonstrations, and its unrolled path."""
    segments = segment_paths(demonstrations, whole_run_cuts(demonstrations), 5.0)
    primitives = [learn_primitive("whole", segments, committed(FitParameters, "fit_primitives"))]
    return primitives, sequence.sequence_table(sequence.unroll(primitives, DT), ["whole"])


def test_demonstrations_show_every_signal_on_one_time_line(tmp_path):
    path = tmp_path / "all.rrd"
    demonstrations = [demonstration("1"), demonstration("two words/2", delay=0.1)]
    segmentation = cut(demonstrations, committed(SegmentParameters, "segment", primitives=PRIMITIVES))
    write(path, demonstrated(demonstrations, segmentation, "Test"))
    rows, entities, timelines = contents(path)
    assert timelines == {"time"}  # no wall clock
    samples = len(demonstrations[0].time) // THINNED
    for kind in ("hands", "moved", "turned", "force", "torque", "tactile\\ 1", "tactile\\ 2"):
        assert rows[f"/{kind}/1"] == samples, kind
    assert rows["/position/z/1"] == samples + 5  # and the colours of rest, three primitives, rest
    assert rows["/cuts/z/1"] == rows["/primitive/1"] == 4
    assert {"/paths/1", "/paths/two\\ words\\/2"} <= entities
    assert "Test (simulated)" in view_names(path)


@pytest.mark.parametrize("turn", [None, 0.5, 7.0])  # no orientation, quaternion and twist-swing primitive
def test_primitives_run_on_time_and_phase(tmp_path, turn):
    signals = ONLY_POSITION if turn is None else {"angle": turn}
    demonstrations = [demonstration("1", **signals), demonstration("2", delay=0.1, **signals)]
    primitives, table = learned(demonstrations)
    path = tmp_path / "primitives.rrd"
    write(path, unrolled(demonstrations, primitives, {"nominal": table, "other": table}))
    rows, entities, timelines = contents(path)
    assert timelines == {"time", "phase"}
    samples = rows["/hands/nominal"]
    assert samples == len(table) // THINNED + 1  # with the last one
    assert rows["/phase/nominal/p"] == rows["/speed/nominal"] == rows["/forcing/position"] == samples
    assert ("/forcing/orientation" in entities) == (turn is not None)


def test_errors_of_rerun_raise():
    with pytest.raises(ValueError, match="could not convert"):
        items.solid("points", rr.Boxes3D, BLUE, sizes="no size")


def test_a_full_disk_is_one_line_and_leaves_the_former_recordings(tmp_path):
    """Two recordings, of about 0.2 and 0.9 MB; the disk is full at once, in the data, or in the footer."""
    folder = tmp_path / "recordings"
    before, time = {}, np.arange(10_000.0)
    noise = [np.random.default_rng(curve).normal(size=len(time)) for curve in range(4)]
    curves = [items.series(f"curve/{one}", time, its, "curve", "#ffffff") for one, its in enumerate(noise)]
    shown = {
        name: Recording(name, views.plot(name, curves[:count]))
        for name, count in {"small": 1, "large": 4}.items()
    }
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    for most in (soft, 0, 140_000, None):
        limit = len(before["large.rrd"]) - 1000 if most is None else most
        complaint = pytest.raises(InputError, match="recordings: cannot be written: File too large")
        try:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
            with complaint if before else nullcontext():
                publish_recordings(folder, shown)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        found = {path.name: path.read_bytes() for path in folder.iterdir()}
        before = before or found
        assert found == before
    assert sorted(before) == ["large.rrd", "small.rrd"]
    verify(folder / "large.rrd")


def test_a_diagram_has_places_from_its_upper_left_corner_and_round_ticks():
    diagram = Diagram((1.0, 3.0), (-10.0, 10.0), width=20.0, height=5.0)
    found = diagram.points(np.array([1.0, 2.0, 3.0]), np.array([10.0, 0.0, -10.0]))
    assert found.tolist() == [[0.0, 0.0], [10.0, 2.5], [20.0, 5.0]]
    for low, high, step in ((0.0, 6.0, 1.0), (0.0, 7.0, 2.0), (-20.0, 5.0, 5.0)):
        assert tick_step(low, high) == pytest.approx(step)
        assert tick_step(low / 1000, high / 1000) == pytest.approx(step / 1000)


def test_notes_and_lanes(tmp_path):
    path = tmp_path / "lane.rrd"
    lane = views.lanes([items.lane("lane", np.arange(3.0), ["down", "turn"])])
    notes = views.notes(views.legend({"the one": LIGHT_BLUE}))
    write(path, Recording("Lane", views.row(lane, notes)))
    assert contents(path)[0] == {"/lane": 3}
    assert values(path, "/lane", "StateConfiguration:values") == [["down", "turn"]]
    shown = [f"#{colour >> 8:06x}" for colour in values(path, "/lane", "StateConfiguration:colors")[0]]
    assert shown == [BLUE, OCHRE]  # of primitives in their order
    assert values(path, "/notes", "TextDocument:text") == [["**light blue** the one"]]


def test_an_arm_is_shown_without_what_simulators_add(tmp_path):
    """A sensor's undeclared XML prefix, which rerun refuses."""
    sensor = '<gazebo reference="arm"><sensor:camera name="rgb"/></gazebo>'
    hinge = joint("hinge", "revolute", "base", "arm")
    robot = f'<robot name="r"><link name="base"/>{link("arm")}{hinge}{sensor}</robot>'
    (tmp_path / "arm.urdf").write_text(robot)
    times, angles = np.array([0.0, 1.0]), np.zeros((2, 1))
    shown, length = sticks("arm", tmp_path / "arm.urdf", ["hinge"], times, angles, (BLUE, OCHRE))
    assert length == pytest.approx(np.linalg.norm([0.1, 0.2, 0.3]))
    assert any("hinge" in item.path for item in shown)
