from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd
import pytest
from committed import committed
from rerun.chunk import RrdReader
from scipy.spatial.transform import Rotation
from viewer_files import PRIMITIVES as MOVEMENTS
from viewer_files import colour_of, contents, demonstration, note, values, view_names

from dissertation.scraping.names import CUT_METHODS, ROLLOUTS, RUNS
from dissertation.scraping.protocol.execution_scores import AFTER, BEFORE, NOMINAL
from dissertation.scraping.protocol.feedback_models import POINTWISE
from dissertation.scraping.recordings import executions_recording, nominal_recordings
from dissertation.scraping.recordings.scraping_scene import Execution
from dissertation.scraping.recordings.search_recording import CHEAP, cost_colours, searches
from dissertation.scraping.world import layout, scraping_robot
from structlearn.core import quaternion
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import cut
from structlearn.viewer.items import entity, rgba
from structlearn.viewer.recording import write

PRIMITIVES = ("down", "turn", "scrape")
SEGMENTS = np.array([[0.0, 0.3], [0.3, 0.9], [0.9, 1.2]])
RATE_HZ = 200
FELT = (("turn", 0.6), ("scrape", 0.3))
LENGTH = 40  # samples of a rollout, at 100 Hz


def about_roll(degrees):
    return quaternion.from_rotation_vector(np.radians(degrees)[..., None] * layout.ROLL_AXIS)


def board_run(name="01", hand_deg=10.0, tool_on_board_deg=0.0):
    """The hand turns to `hand_deg` about the roll axis and slides along the board; the tool lies as asked."""
    time = np.arange(1 + int(1.3 * RATE_HZ)) / RATE_HZ
    share = time / time[-1]
    position = layout.CONTACT_M + 0.06 * share[:, None] * layout.ROLL_AXIS
    orientation = quaternion.product(about_roll(hand_deg * share), layout.FLAT_ORIENTATION)
    rotations = Rotation.from_quat(quaternion.to_xyzw(orientation)).as_matrix()
    joints = [scraping_robot.joint_angles(position[at], rotations[at]) for at in (0, -1)]
    return Demonstration(
        name,
        time,
        position,
        orientation=quaternion.sign_continuous(orientation),
        joint_positions=joints[0] + share[:, None] * (joints[1] - joints[0]),
        wrench=np.tile([0.0, 0.0, -1.0, 0.0, -0.003, 0.0], (len(time), 1)),
        tool_to_board=about_roll(np.full(len(time), tool_on_board_deg)),
        true_segments=SEGMENTS,
        provenance={"origin": "simulated"},
    )


def traces(coupling=2.0):
    """Ten samples per primitive with feedback; channel k deviates by k - 19 counts."""
    channels = {f"channel_{channel:02d}": channel - 19.0 for channel in range(38)} | {"coupling": coupling}
    tables = [
        pd.DataFrame({"primitive": name, "time_s": np.linspace(0.0, duration, 10)} | channels)
        for name, duration in FELT
    ]
    return pd.concat(tables, ignore_index=True)


def shown(kind=POINTWISE, board_deg=10.0, cost=None, **run):
    return Execution(RUNS[kind], board_run(**run), board_deg, PRIMITIVES, traces(), cost)


def refined(board_deg=10.0):
    """The tool lies the flatter the more feedback there is; costs are shorter than the runs."""
    return [
        shown(
            kind, board_deg, np.full(200, np.radians(off)), hand_deg=board_deg - off, tool_on_board_deg=-off
        )
        for kind, off in ((NOMINAL, board_deg), (BEFORE, 4.0), (AFTER, 1.0))
    ]


def rollouts(primitives=("turn", "scrape"), iterations=2, samples=3, failed=()):
    """Constant coupling terms; `failed` has (primitive, iteration, kind, number)."""
    history, felt = [], []
    counts = {"sample": samples, "improved": 2, "feedback": 2}
    for primitive, iteration, (kind, count) in product(primitives, range(iterations + 1), counts.items()):
        for number in range(count if iteration or kind == "feedback" else 0):
            keys = {"primitive": primitive, "iteration": iteration, "kind": kind, "number": number}
            bad = tuple(keys.values()) in failed
            cost = 10.0 - iteration + number
            history.append(keys | {"cost_rad": np.nan if bad else cost, "fault": "x" * bad})
            if not bad:
                columns = {"time_s": np.arange(LENGTH) / 100, "target": 10.0 * iteration + number}
                felt.append(pd.DataFrame(columns | {"cost_rad": cost / LENGTH} | keys))
    return pd.DataFrame(history), pd.concat(felt, ignore_index=True)


def test_a_tool_flat_on_the_board_is_parallel_to_it_and_meets_the_hand_that_turned_as_far():
    one = shown(hand_deg=10.0, tool_on_board_deg=0.0)
    normal = quaternion.rotate(layout.board_orientation(10.0), np.array([0.0, 0.0, 1.0]))
    down = quaternion.rotate(layout.tool_orientation(one.run, 10.0), np.array([0.0, 0.0, 1.0]))
    assert normal == pytest.approx([np.sin(np.radians(10.0)), 0.0, np.cos(np.radians(10.0))])
    assert down == pytest.approx(np.tile(-normal, (len(down), 1)))
    assert layout.hand_roll_deg(one.run)[[0, -1]] == pytest.approx([0.0, 10.0], abs=1e-9)
    assert layout.tool_roll_deg(one.run) == pytest.approx(0.0, abs=1e-9)
    # with the hand turned as far as the board the edge is where the hand says
    edge = layout.grasp_place(one.run) + layout.EDGE_M * down
    assert edge[-1] == pytest.approx(one.run.position[-1])


def test_runs_before_and_after_share_a_scene_and_the_search_has_a_time_line_of_its_own(tmp_path):
    path = tmp_path / "refinement.rrd"
    group = refined(5.0)
    write(path, executions_recording.executions({5.0: group}, rollouts()))
    rows, entities, timelines = contents(path)
    assert timelines == {"time", "iteration"}
    samples = -(-len(group[0].run.time) // 4)  # 50 Hz of 200
    tab = "5 degrees"
    after, before = (entity(tab, "runs", RUNS[kind].name) for kind in (AFTER, BEFORE))
    assert {f"{after}/board", f"{after}/path", f"{after}/hand/electrodes"} <= entities
    assert not {f"{before}/board", f"{before}/path", f"{before}/hand/electrodes"} & entities  # a shadow
    assert rows[f"{before}/hand"] == rows[f"{before}/tool"] == rows[f"{after}/tool"] == samples
    for kind in (NOMINAL, BEFORE, AFTER):
        cost = entity(tab, "cost", RUNS[kind].name)
        assert rows[cost] == 50  # of 200 costs at 200 Hz
        assert colour_of(path, cost) == RUNS[kind].colour
    assert entity(tab, "force", RUNS[AFTER].name) not in entities
    for name in ("turn", "scrape"):
        for column, kind in product(("target", "cost_rad"), ("sample", "improved", "feedback")):
            assert rows[f"/search/{name}/{column}/{kind}"] == (3 if kind == "feedback" else 2)
        for kind, look in ROLLOUTS.items():
            assert colour_of(path, f"/search/{name}/costs/all/{kind}", "Points2D") == look.colour
        assert f"/search/{name}/costs/failed" not in entities
    names = view_names(path)
    assert all("(simulated)" in name for name in names if "every rollout" in name)
    assert "simulated" in note(path)


def test_the_search_of_one_primitive_with_failures_and_the_cheapest_on_top(tmp_path):
    path = tmp_path / "refinement.rrd"
    failed = [("turn", 1, "sample", 0), ("turn", 1, "improved", 1)]
    history, samples = rollouts(("turn",), failed=failed)
    write(path, executions_recording.executions({10.0: refined()}, (history, samples)))
    _, entities, _ = contents(path)
    assert not any(name.startswith("/search/scrape") for name in entities)
    assert values(path, "/search/turn/costs/failed", "Points2D:labels") == [[], ["2 failed"], []]
    strips = values(path, "/search/turn/target/sample", "LineStrips2D:strips")
    assert [len(curves) for curves in strips] == [2, 3]
    means = values(path, "/search/turn/costs/sample/mean", "Points2D:labels")
    assert means == [["10.5"], ["9.0"]]  # of the two and of the three that did not fail
    heights = [strip[0][1] for strip in strips[1]]
    assert heights == sorted(heights)  # downwards: number 2, which costs most, is the highest and drawn first
    drawn = values(path, "/search/turn/target/sample", "LineStrips2D:colors")[1]
    (search,) = searches(history, samples)
    assert drawn == cost_colours(np.array([10.0, 9.0, 8.0]), search.cost_range).tolist()
    assert drawn[-1] == rgba([CHEAP])[0]


def test_the_arm_of_the_robot_holds_the_hand(tmp_path):
    path = tmp_path / "robot.rrd"
    one = shown()
    write(path, executions_recording.robot(one))
    rows, _, timelines = contents(path)
    assert timelines == {"time"}
    samples = -(-len(one.run.time) // 4)  # 50 Hz of 200
    assert rows["/joints"] == rows["/run/hand"] == samples
    assert "Scraping: robot with feedback (simulated)" in view_names(path)
    assert "simulated" in note(path)
    assert colour_of(path, "/run/path", "LineStrips3D") == RUNS[POINTWISE].colour

    pose = np.eye(4)  # of the first sample, down the chain of frames as the viewer goes
    joints = arm_transforms(path)
    assert joints["arm/lbr_iiwa_link_0"][0] == "tf#/"
    for number in range(1, 8):
        parent, transform = joints[f"arm/lbr_iiwa_link_{number}"]
        assert parent == f"arm/lbr_iiwa_link_{number - 1}"
        pose = pose @ transform
    flange_to_edge = scraping_robot.HAND_TO_FLANGE_M + scraping_robot.GRASP_M + scraping_robot.EDGE_M
    assert (pose @ [0.0, 0.0, flange_to_edge, 1.0])[:3] == pytest.approx(one.run.position[0], abs=1e-5)


def arm_transforms(path):
    """By frame: the frame that it is in, and the first transform (4, 4) between them."""
    found = {}
    for chunk in RrdReader(path).stream().to_chunks():
        if chunk.entity_path.startswith("/arm/frames/"):
            columns = chunk.to_record_batch().to_pydict()
            first = {name.split(":")[-1]: values[0] for name, values in columns.items() if values[0]}
            transform = np.eye(4)
            if "quaternion" in first:
                transform[:3, :3] = Rotation.from_quat(first["quaternion"][0]).as_matrix()
                transform[:3, 3] = first["translation"][0]
            found[first["child_frame"][0]] = (first["parent_frame"][0], transform)
    return found


def test_demonstrations_over_the_board_and_one_step_of_the_alignment_per_demonstration(tmp_path):
    path = tmp_path / "alignment.rrd"
    parameters = committed(SegmentParameters, "segment", primitives=MOVEMENTS)
    demonstrations = [demonstration("1"), demonstration("2", delay=0.1), demonstration("3", delay=-0.1)]
    segmentation = cut(demonstrations, parameters)
    write(path, nominal_recordings.alignment(demonstrations, segmentation, parameters))
    rows, entities, timelines = contents(path)
    assert timelines == {"demonstration"}
    for primitive in ("down", "along"):
        assert rows[f"/{primitive}/guess/curve"] == rows[f"/{primitive}/pairs"] == 2
        assert f"/{primitive}/reference/curve" in entities
        for method in ("zvc", "wls"):
            bars = f"/{primitive}/guess/{method}"
            assert colour_of(path, bars, "LineStrips2D") == CUT_METHODS[method].colour
    assert "simulated" in note(path)

    over_the_board = tmp_path / "demonstrations.rrd"
    write(over_the_board, nominal_recordings.demonstrations(demonstrations, segmentation))
    assert "/scenery/board" in contents(over_the_board)[1]
    assert "simulated" in note(over_the_board)

    kept = segmentation.cuts[segmentation.cuts["demonstration"] != "3"]
    left = replace(segmentation, cuts=kept, left_out=pd.DataFrame())
    write(path, nominal_recordings.alignment(demonstrations, left, parameters))
    assert contents(path)[0]["/down/guess/curve"] == 1
