import numpy as np
import pandas as pd
import pytest
from rerun.chunk import RrdReader
from scipy.spatial.transform import Rotation
from test_viewer import contents, view_names

from structlearn.ground import quaternion
from structlearn.palette import ORANGE, SKY
from structlearn.recordings import write_recordings
from structlearn.recordings.demonstration import Demonstration
from structlearn.recordings.recording import Recording, Stream
from structlearn.recordings.source import ClockParameters
from structlearn.tactile.electrodes import SKIN_RADIUS_MM
from structlearn.testbeds.scraping.recordings.executions_recording import write_executions
from structlearn.testbeds.scraping.recordings.finger_electrodes import electrodes
from structlearn.testbeds.scraping.recordings.robot_recording import write_robot
from structlearn.testbeds.scraping.recordings.shown_execution import execution
from structlearn.testbeds.scraping.recordings.shown_runs import read_shown_runs
from structlearn.testbeds.scraping.world import scraping_robot
from structlearn.testbeds.scraping.world.layout import CONTACT_M, EDGE_M, FLAT_ORIENTATION, ROLL_AXIS
from structlearn.viewer.electrode_colours import RESTING, deviation_colours

PRIMITIVES = ("down", "turn", "scrape")
SEGMENTS = np.array([[0.0, 0.3], [0.3, 0.9], [0.9, 1.2]])
RATE_HZ = 200
FELT = (("turn", 0.6), ("scrape", 0.3))


def about_roll(degrees):
    return quaternion.from_rotation_vector(np.radians(degrees)[..., None] * ROLL_AXIS)


def board_run(name="01", hand_deg=10.0, tool_on_board_deg=0.0):
    """The hand turns to `hand_deg` about the roll axis and slides along the board; the tool lies as asked."""
    time = np.arange(1 + int(1.3 * RATE_HZ)) / RATE_HZ
    share = time / time[-1]
    position = CONTACT_M + 0.06 * share[:, None] * ROLL_AXIS
    orientation = quaternion.product(about_roll(hand_deg * share), FLAT_ORIENTATION)
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
    tables = {}
    for name, duration in FELT:
        columns = {"time_s": np.linspace(0.0, duration, 10), "coupling": np.full(10, coupling)}
        channels = {f"channel_{channel:02d}": np.full(10, channel - 19.0) for channel in range(38)}
        tables[name] = pd.DataFrame(columns | channels)
    return tables


def shown(label="feedback", board_deg=10.0, **run):
    return execution(label, board_run(**run), board_deg, PRIMITIVES, traces())


def test_traces_of_the_primitives_lie_on_the_clock_of_the_run():
    one = shown()
    assert one.time[[0, 9, 10, 19]] == pytest.approx([0.3, 0.9, 0.9, 1.2])
    assert one.deviation.shape == (20, 38)
    assert one.deviation[0, [0, 37]] == pytest.approx([-19.0, 18.0])


def test_a_tool_flat_on_the_board_is_parallel_to_it_and_meets_the_hand_that_turned_as_far():
    one = shown(hand_deg=10.0, tool_on_board_deg=0.0)
    normal = quaternion.rotate(one.board_orientation, np.array([0.0, 0.0, 1.0]))
    down = quaternion.rotate(one.tool_orientation, np.array([0.0, 0.0, 1.0]))
    assert normal == pytest.approx([np.sin(np.radians(10.0)), 0.0, np.cos(np.radians(10.0))])
    assert down == pytest.approx(np.tile(-normal, (len(down), 1)))
    assert one.hand_roll[[0, -1]] == pytest.approx([0.0, 10.0], abs=1e-9)
    assert one.roll_on_board == pytest.approx(0.0, abs=1e-9)
    edge = one.grasp + EDGE_M * down  # with the hand turned as far as the board it is where the hand says
    assert edge[-1] == pytest.approx(one.run.position[-1])


def test_a_tool_that_gives_way_is_drawn_with_its_own_roll():
    one = shown(hand_deg=0.0, tool_on_board_deg=-7.0)
    across = quaternion.rotate(one.tool_orientation, np.array([1.0, 0.0, 0.0]))
    lies = np.radians(10.0 - 7.0)  # of the edge in the base frame; the flat tool's x points to -x
    assert across[-1] == pytest.approx([-np.cos(lies), 0.0, np.sin(lies)])
    assert one.roll_on_board[-1] == pytest.approx(-7.0)


def test_electrodes_lie_under_the_skin_and_face_each_other():
    left, right = 1e3 * electrodes()
    for side, finger in ((1.0, left), (-1.0, right)):
        depth = side * finger[:, 0] - 10.0  # from the pad, into the finger; the axis is at the skin's radius
        assert depth.min() > 0.0
        assert (np.hypot(depth - SKIN_RADIUS_MM, finger[:, 1]) < SKIN_RADIUS_MM).all()
        assert depth[18] < SKIN_RADIUS_MM / 2  # electrode 19 is among those under the flat of the pad
    assert left[0, 1] == -right[0, 1]  # electrode 1 is at the side, and the two fingers are turned


def test_colours_of_deviations():
    colours = deviation_colours(np.array([-50.0, -20.0, 0.0, 20.0, 500.0]), 20.0)
    names = [f"#{colour >> 8:06x}" for colour in colours.tolist()]
    assert names == [SKY, SKY, RESTING, ORANGE, ORANGE]
    assert (colours & 0xFF == 0xFF).all()


def test_executions_in_several_settings_share_one_time_line(tmp_path):
    path = tmp_path / "feedback.rrd"
    settings = {
        deg: [shown(label, deg, hand_deg=hand) for label, hand in (("nominal", 0.0), ("feedback", deg))]
        for deg in (10.0, 2.5)
    }
    write_executions(path, settings, "Executions")
    rows, entities, timelines = contents(path)
    assert timelines == {"time"}
    samples = (len(settings[10.0][0].run.time) + 1) // 2  # 100 Hz of 200
    for tab in ("10\\ degrees", "2.5\\ degrees"):
        for label in ("nominal", "feedback"):
            scene = f"/{tab}/runs/{label}"
            assert {f"{scene}/{part}" for part in ("board", "path", "hand/fingers", "tool/edge")} <= entities
            assert rows[f"{scene}/hand"] == rows[f"{scene}/tool"] == samples
            assert rows[f"{scene}/hand/electrodes"] == rows[f"/{tab}/electrodes/{label}"] == 21
            for kind in ("roll\\ on\\ board", "hand\\ roll", "force", "torque"):
                assert rows[f"/{tab}/{kind}/{label}"] == samples, kind
            assert rows[f"/{tab}/coupling/{label}"] == 21
        assert rows[f"/{tab}/primitive"] == 4
    assert "nominal, board at 10 degrees (simulated)" in view_names(path)


def test_the_arm_of_the_robot_holds_the_hand(tmp_path):
    path = tmp_path / "robot.rrd"
    one = shown()
    write_robot(path, one, "Robot")
    rows, entities, timelines = contents(path)
    assert timelines == {"time"}
    samples = -(-len(one.run.time) // 4)  # 50 Hz of 200
    assert rows["/joints"] == rows["/run/hand"] == samples
    assert "/arm/lbr_iiwa/visual_geometries/lbr_iiwa_link_7/visual_0" in entities
    assert not any("collision" in name for name in entities)
    assert "Robot (simulated)" in view_names(path)

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


@pytest.mark.parametrize("joints", [None, np.zeros((261, 6))])
def test_a_robot_of_another_make_is_refused(tmp_path, joints):
    run = board_run()
    other = Demonstration(**{**vars(run), "joint_positions": joints})
    with pytest.raises(ValueError, match="01: needs the positions of 7 joints"):
        write_robot(tmp_path / "robot.rrd", execution("odd", other, 10.0, PRIMITIVES, traces()))


def streams(run):
    stamps = np.round(1e9 * run.time).astype(np.int64)
    signals = {
        "pose": np.hstack([run.position, run.orientation]),
        "joint_positions": run.joint_positions,
        "wrench": run.wrench,
        "tool_to_board": run.tool_to_board,
    }
    return Recording(
        run.name,
        tuple(Stream(f"/{kind}", kind, stamps, values) for kind, values in signals.items()),
        run.true_segments,
        run.provenance,
    )


def test_runs_are_found_where_the_stages_wrote_them(tmp_path):
    raw, feedback = tmp_path / "raw", tmp_path / "feedback"
    for folder in ("closed_loop/nominal/0", "closed_loop/pointwise/0"):  # 0 degrees: nothing to correct
        write_recordings([streams(board_run())], raw / folder)
    for folder in ("closed_loop/nominal", "closed_loop/pointwise", "corrections"):
        for setting in ("2.5", "10"):
            write_recordings([streams(board_run(name)) for name in ("01", "02")], raw / folder / setting)
    settings = (0.0, 2.5, 10.0)
    executed = pd.concat(
        table.assign(model=model, primitive=name, setting_deg=setting, run=run, coupling=coupling)
        for name, table in traces().items()
        for model, coupling in (("nominal", 0.0), ("pointwise", 2.0))
        for setting in settings
        for run in ("01", "02")
    )
    (feedback / "evaluation").mkdir(parents=True)
    executed.to_parquet(feedback / "evaluation" / "traces.parquet")
    (feedback / "dataset").mkdir()
    for name, table in traces().items():
        corrected = pd.concat(
            table.drop(columns="coupling").assign(
                setting_deg=setting, demonstration=number, target=number + 3.0
            )
            for setting in settings[1:]
            for number in (0, 1)
        )
        corrected.to_parquet(feedback / "dataset" / f"{name}.parquet")

    clock = ClockParameters(rate_hz=RATE_HZ, max_gap_s=0.2)
    runs = read_shown_runs(raw, feedback, "pointwise", PRIMITIVES, clock)
    assert list(runs) == [10.0, 2.5]
    assert [one.label for one in runs[2.5]] == ["nominal", "corrected", "feedback"]
    assert [one.coupling.tolist() for one in runs[2.5]] == [[0.0] * 20, [3.0] * 20, [2.0] * 20]
    assert runs[10.0][1].board_deg == 10.0
    write_executions(tmp_path / "feedback.rrd", runs)


def test_without_executions_nothing_is_shown(tmp_path):
    (tmp_path / "evaluation").mkdir()
    clock = ClockParameters(rate_hz=RATE_HZ, max_gap_s=0.2)
    assert read_shown_runs(tmp_path, tmp_path, "pointwise", PRIMITIVES, clock) == {}
