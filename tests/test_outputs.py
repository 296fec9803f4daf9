"""What a robot commands beside its movement: learned with known truth, in the skill, run, and exported."""

from dataclasses import replace

import numpy as np
import pyarrow.parquet
import pytest
from committed import EXAMPLE_TASK, topic_map
from hypothesis import given
from hypothesis import strategies as st
from own_skills import FIT
from test_segmentation_strokes import SEGMENT, wiped

from dissertation.simulation.pick_and_place import CLOSED_M, OPEN_M, takes, write_takes
from structlearn.core.artefacts import read_description, read_tensors, write_tensors
from structlearn.core.errors import InputError
from structlearn.feedback.cpp_export import header
from structlearn.feedback.runtime import Controller
from structlearn.feedback.skill import ReactiveSkill, demonstrated_workspace
from structlearn.feedback.skill_file import read_skill, write_skill
from structlearn.primitives import canonical
from structlearn.primitives.fitting import learn_sequence
from structlearn.primitives.outputs import Switching, hysteresis, switched
from structlearn.primitives.sequence import default_start, unroll
from structlearn.readers import read_demonstrations, read_recordings, synchronise
from structlearn.readers.demonstration import Stream
from structlearn.readers.lerobot import read_movement
from structlearn.readers.messages import to_messages
from structlearn.readers.raw_messages import write_bag
from structlearn.segmentation.segments import cut
from structlearn.tasks.inspection.recordings_report import find_out
from structlearn.tasks.movement.lerobot_export import write_lerobot
from structlearn.tasks.movement.movement_learning import edge_times, output_errors

RATE_HZ = 200.0
FINGER = "/gripper/joint_states[panda_finger_joint1]"
TOPICS = topic_map(pose="/gripper/pose", outputs={"opening": FINGER}, digital={"grasp": "/gripper/grasp"})
PAUSES = [{"name": name, "axis": "between"} for name in ("close", "open")]
PRIMITIVES = ["reach", PAUSES[0], "carry", PAUSES[1], "retreat"]
GRASPING = EXAMPLE_TASK.segment.model_validate(EXAMPLE_TASK.segment.model_dump() | {"primitives": PRIMITIVES})


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bags")
    made = takes(1, 3, 4)
    write_takes(made, folder)
    return folder, made


@pytest.fixture(scope="module")
def runs(bags):
    return [synchronise(one, RATE_HZ) for one in read_recordings(bags[0], TOPICS, EXAMPLE_TASK.stamps)]


@pytest.fixture(scope="module")
def cuts(runs):
    return cut(runs, GRASPING)


@pytest.fixture(scope="module")
def skill(runs, cuts) -> ReactiveSkill:
    workspace = demonstrated_workspace([run.position for run in runs], 0.05)
    learned = learn_sequence(runs, cuts.results, FIT)
    return ReactiveSkill(learned, workspace=workspace, outputs=("opening",), digital=("grasp",))


def ticked(skill: ReactiveSkill) -> tuple[np.ndarray, np.ndarray]:
    """Primitive (T,) and outputs (T, K) of every tick."""
    controller, start = Controller(skill, RATE_HZ), default_start(skill.primitives)
    controller.start(start.position, start.orientation)
    rows, places = [], []
    while not controller.finished:
        controller.tick(None)
        rows.append(controller.outputs.copy())
        places.append(controller.primitive)
    return np.array(places), np.array(rows)


def test_the_gripper_closes_and_opens_where_it_did(skill, runs, cuts, bags):
    places, outputs = ticked(skill)
    begins = np.searchsorted(places, np.arange(5)) / RATE_HZ
    changes = np.flatnonzero(np.diff(outputs[:, 1])) / RATE_HZ
    assert len(changes) == 2
    for change, place, name, edge in zip(changes, (1, 3), ("close", "open"), (0, 1), strict=True):
        shares = []
        for run, take in zip(runs, bags[1], strict=True):
            start, end = cuts.result(name).loc[run.name, ["start_s", "end_s"]]
            true = take.time[np.flatnonzero(np.diff(take.grasps.astype(int)))[edge]]
            shares.append((true - start) / (end - start))
        true = begins[place] + np.median(shares) * skill.primitives[place].duration
        assert change == pytest.approx(true, abs=0.040)  # the gripper says it at 30 Hz, on its own clock
    opening = outputs[:, 0]
    assert opening[places == 0] == pytest.approx(OPEN_M, abs=1e-3)
    carried = opening[places == 2]
    assert carried[: len(carried) * 9 // 10] == pytest.approx(CLOSED_M, abs=1e-3)
    assert opening[-1] == pytest.approx(OPEN_M, abs=1e-4)
    assert np.abs(np.diff(opening)).max() < 1.5 * (OPEN_M - CLOSED_M) / (0.2 * RATE_HZ)  # no jump


def test_what_is_left_out_is_nearly_reproduced(runs, cuts, skill):
    errors = output_errors(runs, cuts.results, FIT, 1).query("left_out").set_index("primitive")
    assert errors["range"].unique() == pytest.approx([OPEN_M - CLOSED_M], rel=1e-6)
    assert errors["mean"].max() < 0.2 * (OPEN_M - CLOSED_M)  # of closing, whose pause differs
    assert errors.loc[["reach", "carry", "retreat"], "mean"].max() < 0.03 * (OPEN_M - CLOSED_M)
    times = edge_times(runs, cuts.results, skill.primitives).set_index("primitive")
    assert times["alike"].tolist() == [4] * 5
    assert times["starts_on"].tolist() == [False, False, True, True, False]


def test_the_file_keeps_outputs_and_the_controller_those_of_the_sequence(skill, tmp_path):
    path = tmp_path / "skill.safetensors"
    write_skill(skill, path, {})
    again = read_skill(path)
    assert (again.outputs, again.digital) == (("opening",), ("grasp",))
    (_, found), (_, read) = ticked(skill), ticked(again)
    np.testing.assert_array_equal(found, read)
    whole = unroll(skill.primitives, 1.0 / RATE_HZ)
    np.testing.assert_allclose(found[:, 0], whole.outputs.position[:, 0], atol=1e-9)
    np.testing.assert_array_equal(found[:, 1], whole.digital[:, 0])
    plain = replace(
        skill,
        primitives=[replace(one, outputs=None, switching=None) for one in skill.primitives],
        outputs=(),
        digital=(),
    )
    write_skill(plain, path, {})
    assert '"version": 1' in read_description(path)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("close.switching.first", [0.5], "'close': digital outputs begin with"),
        ("close.switching.edges", [[3.0, 0.5]], "'close': digital outputs begin with"),
        ("close.switching.first", [0.0, 1.0], "'close' has 2 digital outputs, the skill 1: grasp"),
        ("close.outputs.goal", [0.0, 1.0], "'close': start and goal have shapes"),
    ],
)
def test_damaged_outputs_are_refused(skill, tmp_path, name, value, message):
    path = tmp_path / "skill.safetensors"
    write_skill(skill, path, {})
    tensors = read_tensors(path) | {f"primitives.{name}": np.array(value)}
    write_tensors(tensors, path, read_description(path))
    with pytest.raises(InputError, match=message):
        read_skill(path)


def test_the_header_for_cpp_does_not_know_outputs(skill):
    with pytest.raises(InputError, match=r"the skill has outputs, which the C\+\+ header does not know"):
        header(skill, "skill_pick", "of a test")


def test_the_exported_action_has_them_and_they_come_back(runs, cuts, tmp_path):
    write_lerobot(runs, cuts, tmp_path / "set", "grasp", 5.0, fps=50)
    table = pyarrow.parquet.read_table(tmp_path / "set/data/chunk-000/file-000.parquet").to_pandas()
    actions, states = (np.stack(table[name]) for name in ("action", "observation.outputs"))
    assert actions.shape[1] == 7 + 2
    first = (table["episode_index"] == 0).to_numpy()
    np.testing.assert_array_equal(actions[first][:-1, 7:], states[first][1:])
    topics = topic_map(
        pose="observation.pose",
        outputs={"opening": "observation.outputs[opening]"},
        digital={"grasp": "observation.outputs[grasp]"},
    )
    entry = EXAMPLE_TASK.model_copy(update={"topics": topics})
    back = [synchronise(one) for one in read_movement(tmp_path / "set", entry, {})]
    assert back[0].output_names == ("opening",)
    np.testing.assert_array_equal(back[0].digital[:, 0] > 0.5, states[first][:, 1] > 0.5)
    wide = topics.model_copy(update={"outputs": (("opening", "observation.outputs"),)})
    with pytest.raises(InputError, match="has 2 columns; an output is one of them"):
        read_movement(tmp_path / "set", entry.model_copy(update={"topics": wide}), {})


def test_an_output_that_does_not_change_is_kept_through_strokes():
    runs = []
    for run in wiped():
        held = np.full((len(run.time), 1), 0.02)
        runs.append(
            replace(run, outputs=held, output_names=("opening",), digital=0 * held + 1, digital_names=("on",))
        )
    skill = ReactiveSkill(
        learn_sequence(runs, cut(runs, SEGMENT).results, FIT), outputs=("opening",), digital=("on",)
    )
    _, outputs = ticked(skill)
    np.testing.assert_allclose(outputs, [[0.02, 1.0]] * len(outputs), atol=1e-9)


def test_inspection_offers_digital_outputs(bags):
    proposal = find_out(str(bags[0])).proposal
    assert proposal.entry["topics"]["digital"] == {"gripper_grasp": "/gripper/grasp"}


@pytest.mark.parametrize(
    ("topics", "message"),
    [
        (
            {"outputs": {"a": "/gripper/joint_states[thumb]"}},
            "no joint thumb; it has panda_finger",
        ),
        (
            {"outputs": {"a": "/gripper/grasp"}},
            "Bool; outputs can be read from std_msgs/Float32",
        ),
        ({"outputs": {"a": "/nowhere"}}, "has no topic '/nowhere' for outputs"),
        ({"digital": {"a": "/wrist/wrench"}}, "digital can be read from std_msgs/Bool"),
    ],
)
def test_an_output_that_cannot_be_read_is_named(bags, topics, message):
    with pytest.raises(InputError, match=message):
        read_recordings(bags[0], topic_map(pose="/gripper/pose", **topics), EXAMPLE_TASK.stamps)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([0.0, np.nan, 0.1], "row 1 .*value of opening is nan"),
        ([0.0], "needs at least two samples, has 1"),
    ],
)
def test_a_faulty_output_is_reported_by_row(tmp_path, values, message):
    stamps = 10**9 + 10**8 * np.arange(20)
    pose = np.column_stack([0.01 * np.arange(20), np.zeros((20, 2)), np.ones(20), np.zeros((20, 3))])
    messages = {
        "/pose": to_messages("", Stream("", "pose", stamps, pose)),
        "/opening": to_messages("", Stream("", "outputs", stamps[: len(values)], np.array([values]).T)),
    }
    write_recorded(tmp_path / "a.mcap", messages)
    with pytest.raises(InputError, match=message):
        read_demonstrations(tmp_path, topic_map(pose="/pose", outputs={"opening": "/opening"}))


def test_a_digital_output_keeps_its_value_until_the_next_message(tmp_path):
    stamps = 10**9 + 10**8 * np.arange(20)
    pose = np.column_stack([0.01 * np.arange(20), np.zeros((20, 2)), np.ones(20), np.zeros((20, 3))])
    told = Stream("", "digital", stamps[[3, 12]] + 5, np.array([[1.0], [0.0]]))
    write_recorded(
        tmp_path / "a.mcap",
        {"/pose": to_messages("", Stream("", "pose", stamps, pose)), "/on": to_messages("", told)},
    )
    (run,) = read_demonstrations(tmp_path, topic_map(pose="/pose", digital={"on": "/on"}), 10.0)
    np.testing.assert_array_equal(run.digital[:, 0], [1.0] * 13 + [0.0] * 7)


def test_a_table_may_have_outputs(tmp_path):
    rows = "".join(f"{0.1 * n:.1f},{0.01 * n},0,0,{n}\n" for n in range(20))
    (tmp_path / "a.csv").write_text("time_s,x,y,z,output.force\n" + rows)
    (run,) = read_demonstrations(tmp_path, topic_map(pose="/pose", outputs={"force": "/output/force"}))
    np.testing.assert_allclose(run.outputs[:, 0], np.arange(20))


def write_recorded(path, messages):
    write_bag(path, {"provenance": '{"origin": "recorded"}', "true_segments": "null"}, messages.items())


def test_edges_are_at_their_phase():
    p, _ = canonical.phase(np.linspace(0.0, 1.0, 101), canonical.TAU_PER_DURATION)
    switching = Switching(np.array([True, False]), np.array([[0, p[30]], [1, p[50]], [0, p[60]]]))
    states = switching.states(p)
    assert np.flatnonzero(np.diff(states[:, 0].astype(int))).tolist() == [29, 59]
    assert np.flatnonzero(np.diff(states[:, 1].astype(int))).tolist() == [49]


@given(st.lists(st.booleans(), min_size=2, max_size=60), st.integers(0, 2**16), st.floats(0.01, 100.0))
def test_noise_below_a_third_of_the_range_makes_no_edge(on, seed, scale):
    steps = np.array(on, dtype=float)[:, None]
    if steps.min() == steps.max():
        steps[0] = 1.0 - steps[0]
    noise = np.random.default_rng(seed).uniform(-0.19, 0.19, steps.shape)
    values = scale * (steps + noise)
    found = switched(values, *hysteresis([values]))
    np.testing.assert_array_equal(found, steps > 0.5)
