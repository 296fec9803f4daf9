"""What is said of recordings before anything is configured, and the entry that is proposed for them."""

import re
import runpy
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import yaml
from conftest import minimum_jerk
from readers_bags import joint_messages, pose_messages, transform_messages, transform_stamped, write_bag

from dissertation.simulation.pick_and_place import TIP, URDF, takes, write_takes
from structlearn.core.errors import InputError
from structlearn.readers import raw_messages, read_recordings
from structlearn.readers.computed_pose import TransformSeries
from structlearn.readers.urdf_file import urdf_path
from structlearn.tasks.inspection.proposal import from_home, task_name
from structlearn.tasks.inspection.recordings_report import as_yaml, find_out, inspect_source
from structlearn.tasks.inspection.source_survey import frame_pairs
from structlearn.tasks.movement.recordings import read
from structlearn.tasks.project import ENTRIES
from structlearn.tasks.task_entry import read_task
from structlearn.tasks.task_import import on_clock

MS = 10**6
STAMPS = (10**9 + 10 * MS * np.arange(400)).tolist()
PRIMITIVES = "segment.primitives"
PANDA = str(urdf_path(URDF))


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    """Three demonstrations of three moves, with all their topics."""
    folder = tmp_path_factory.mktemp("bags") / "pick"
    folder.mkdir()
    write_takes(takes(2, 3, 3), folder)
    return folder


def answer(found, question):
    """The one answer to a question."""
    (one,) = [answer for answer in found.answers if answer.question == question]
    return one


def as_task(entry, folder):
    """The task that an entry becomes at the end of the parameter file."""
    (folder / ENTRIES).write_text(f"movement:\n{entry}")
    (name,) = yaml.safe_load(entry)
    return read_task(name, folder / ENTRIES)


def rewritten(source, target, topics, change=lambda topic, messages: messages):
    """Some topics of every bag of a folder, each changed or not."""
    target.mkdir()
    for path in sorted(source.iterdir()):
        found = raw_messages.read_bag(path, topics).messages
        changed = {topic: change(topic, messages) for topic, messages in found.items()}
        raw_messages.write_bag(
            target / path.name, {"provenance": "{}", "true_segments": "null"}, changed.items()
        )
    return target


def moving_rows(count=400, seed=0, far=0.3):
    """Poses x, y, z, qw .. of a hand that rests, goes `far` along x, and rests."""
    phase = np.clip(np.linspace(-0.2, 1.2, count), 0.0, 1.0)
    rows = np.zeros((count, 7))
    rows[:, 3] = 1.0
    rows[:, 0] = far * (10 * phase**3 - 15 * phase**4 + 6 * phase**5)
    rows[:, :3] += np.random.default_rng(seed).normal(scale=2e-4, size=(count, 3))
    return rows


@pytest.mark.parametrize("moves", [2, 5])
def test_the_proposed_entry_is_a_task_with_as_many_primitives_as_moves(tmp_path, capsys, moves):
    source = tmp_path / f"{moves} moves"
    source.mkdir()
    write_takes(takes(11, moves, 3), source)
    inspect_source(str(source), None, tmp_path / "entry.yaml")
    text = capsys.readouterr().out
    entry = (tmp_path / "entry.yaml").read_text()
    assert text.endswith(entry)
    task = as_task(entry, tmp_path)
    assert len(task.segment.primitives) == moves
    assert task.source == str(source)
    assert task.topics.pose == "/gripper/pose"
    assert task.topics.joint_states == ("/joint_states",)
    assert task.topics.wrench == "/wrist/wrench"


def test_sound_recordings_pass_and_their_runs_of_motion_are_the_moves(example):
    found = find_out(str(example))
    for question in ("Do runs of motion agree in number?", "Are joints' positions in rad?"):
        assert answer(found, question).verdict == "yes"
    for take in takes(2, 3, 3):
        runs = [(run.start_s, run.end_s) for run in found.motion.counted(take.name)]
        np.testing.assert_allclose(runs, take.segments, atol=0.15)


def test_hesitations_and_twitches_are_no_further_runs_and_a_missing_one_is_named(tmp_path):
    write_takes(takes(4, 3, 6, twitch=True, hesitation=True, without={"04": "carry"}), tmp_path)
    found = find_out(str(tmp_path))
    assert found.proposal.entry["segment"]["primitives"] == 3
    assert "04" not in found.motion.agreeing
    assert answer(found, "Do runs of motion agree in number?").verdict == "doubtful"
    assert any("04 (2)" in warning for warning in found.proposal.warnings[PRIMITIVES])
    assert found.proposal.entry["segment"]["skip_failures"] is True  # so that the entry runs as it is
    (left_out,) = found.proposal.warnings["segment.skip_failures"]
    assert left_out.startswith("left out: 04: has ")


def test_joint_states_and_a_robot_give_the_hand(example, tmp_path):
    source = rewritten(example, tmp_path / "joints", ["/joint_states"])
    found = find_out(str(source), URDF)  # a file that PyBullet ships
    assert found.motion.number == 3
    assert found.proposal.entry["topics"]["pose"] == {"urdf": PANDA, "tip": TIP, "topic": "/joint_states"}
    task = as_task("\n".join(as_yaml(found.proposal)), tmp_path)
    assert (task.robot.urdf, task.robot.tip) == (PANDA, TIP)
    assert task.robot.locked_joints == ("panda_finger_joint1", "panda_finger_joint2")
    captured = find_out(str(example)).sources[0]
    for name, path in found.sources[0].paths.items():
        assert path.extent_m == pytest.approx(captured.paths[name].extent_m, rel=0.01)


def test_a_robot_is_proposed_beside_a_topic_of_poses(example, tmp_path):
    topics = ["/joint_states", "/gripper/pose"]

    def lifted(topic, messages):
        if topic == "/joint_states":
            return messages
        data = np.array([list(one) for one in messages.data], np.uint8)
        data[:, -56:].view("<f8")[:, 2] += 0.1  # z; a pose is the end of its message
        return replace(messages, data=[one.tobytes() for one in data])

    proposal = find_out(str(rewritten(example, tmp_path / "both", topics)), URDF).proposal
    assert proposal.entry["topics"]["pose"] == "/gripper/pose"
    assert "robot" not in proposal.warnings  # the tip is where the hand is
    task = as_task("\n".join(as_yaml(proposal)), tmp_path)
    assert (task.robot.urdf, task.robot.tip) == (PANDA, TIP)
    found = find_out(str(rewritten(example, tmp_path / "lifted", topics, lifted)), URDF)
    assert "starts up to 0.1 m from /gripper/pose" in found.proposal.warnings["robot"][0]


def test_frames_are_listed_and_the_hand_is_the_end_of_what_moves(tmp_path, capsys):
    rest = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]
    kind = "tf2_msgs/msg/TFMessage"
    static = [transform_stamped(0, "world", "base_link", rest), transform_stamped(0, "arm", "tool0", rest)]
    for number in range(2):
        rows = [("/tf_static", kind, {"transforms": static}, 10**9)]
        for stamp, row in zip(STAMPS, moving_rows(seed=number), strict=True):
            links = [
                transform_stamped(stamp, "base_link", "arm", row),
                transform_stamped(stamp, "base_link", "lamp", rest),
            ]
            rows.append(("/tf", kind, {"transforms": links}, stamp))
        write_bag(tmp_path / f"{number}.mcap", rows)
    inspect_source(str(tmp_path), None, None)
    text = capsys.readouterr().out
    (line,) = {line for line in text.splitlines() if line.startswith("  /tf ")}
    assert line.split()[1:6] == ["tf2_msgs/TFMessage", "400", "100", "Hz", "0.01"]
    assert "header" in line
    assert "frames in /tf: base_link -> arm, base_link -> lamp (at rest)" in text
    assert "frames in /tf_static: arm -> tool0 (static), world -> base_link (static)" in text
    found = find_out(str(tmp_path))
    assert found.proposal.entry["topics"]["pose"] == {"parent": "base_link", "child": "tool0", "topic": "/tf"}
    assert found.motion.number == 1


def series(parent, child, moves=True):
    rows = moving_rows() if moves else moving_rows(far=0.0)[:1].repeat(400, axis=0)
    return TransformSeries(parent, child, 10**9 + 10 * MS * np.arange(400), rows)


@pytest.mark.parametrize("turns", [True, False])
def test_the_base_does_not_depend_on_which_joints_rest_and_the_hand_carries_no_end(turns):
    moving = [series("base", "link_1", turns), series("link_1", "flange"), series("base", "person")]
    static = [series("map", "base", False), series("flange", "tool0", False), series("tool0", "lens", False)]
    assert frame_pairs(moving, static) == [("base", "tool0"), ("base", "person")]


@pytest.mark.parametrize(
    ("chain", "base"),
    [
        (["map", "odom", "base_link", "link_1", "tool0"], "base_link"),
        (
            ["odom", "base_footprint", "left/base_link", "torso", "panda_link0", "panda_hand"],
            "left/base_link",
        ),
        (["world", "odom", "panda_link0", "panda_link1", "robotiq_base_link", "tcp"], "panda_link0"),
        (["map", "odom", "rover", "link_1", "tool0"], "map"),
    ],
)
def test_the_pose_is_in_the_base_of_the_robot_and_not_where_it_drives(chain, base):
    moving = [series(parent, child) for parent, child in pairwise(chain)]
    assert frame_pairs(moving, []) == [(base, chain[-1])]


def test_frames_above_the_base_are_listed(tmp_path):
    rows = moving_rows()
    for number in range(2):
        messages = [
            *transform_messages(STAMPS, "map", "odom", rows),
            *transform_messages(STAMPS, "odom", "base_link", rows),
            *transform_messages(STAMPS, "base_link", "tool0", rows),
        ]
        write_bag(tmp_path / f"{number}.mcap", sorted(messages, key=lambda message: message[3]))
    found = find_out(str(tmp_path))
    assert found.proposal.entry["topics"]["pose"]["parent"] == "base_link"
    (said,) = found.proposal.warnings["topics.pose"]
    assert said.startswith("base_link itself is in odom, map")


def test_fingers_and_other_frames_are_not_held_against_the_hand(tmp_path):
    slow, rows = STAMPS[::40], moving_rows()
    for number in range(2):
        messages = [
            *transform_messages(STAMPS, "base", "tool0", rows),
            *transform_messages(slow, "base", "person", 3.0 * rows[::40] + [0, 0, 0, -2, 0, 0, 0]),
            *joint_messages(STAMPS, ["a", "b"], rows[:, :2]),
            *joint_messages([stamp + MS for stamp in slow], ["finger"], rows[::40, :1]),
        ]
        write_bag(tmp_path / f"{number}.mcap", sorted(messages, key=lambda message: message[3]))
    found = find_out(str(tmp_path))
    assert found.proposal.entry["topics"]["pose"] == {"parent": "base", "child": "tool0", "topic": "/tf"}
    assert answer(found, "Are streams without gaps?").verdict == "yes"
    assert answer(found, "Are topics fast enough?").verdict == "yes"
    assert "source" not in found.proposal.warnings


def test_topics_neither_steer_the_terminal_nor_write_an_entry_of_their_own(tmp_path, capsys):
    evil = '/a\x1b]0;title\x07\x1b[2J\u202e\n  "x; touch PWNED": {source: bags}\n  '
    rows = pose_messages(STAMPS, moving_rows(far=0.02), evil) + pose_messages(
        STAMPS, moving_rows(), evil[:-1]
    )
    rows += joint_messages(STAMPS, [evil], np.zeros((400, 1)), evil[:-2])
    bag = tmp_path / "bags" / "1.mcap"
    bag.parent.mkdir()
    write_bag(bag, sorted(rows, key=lambda row: row[3]))
    inspect_source(str(bag.parent), None, tmp_path / "entry.yaml")
    printed, entry = capsys.readouterr().out, (tmp_path / "entry.yaml").read_text()
    for text in (printed, entry):
        assert all(line.isprintable() for line in text.split("\n"))
        assert "touch PWNED" in text
    assert list(yaml.safe_load("movement:\n" + entry)["movement"]) == ["bags"]
    assert as_task(entry, tmp_path).topics.pose == evil[:-1]
    with pytest.raises(InputError) as error:
        raise InputError(f"1.mcap: topic '{evil}' is missing")
    assert str(error.value).isprintable()


def there_and_back():
    """Two moves with a turn of 5 degrees between them, half way, in half a second."""
    rows = np.vstack([moving_rows(), moving_rows()])
    rows[400:, 0] = rows[399, 0] - rows[400:, 0]
    angle = np.radians(5.0) * np.clip(np.linspace(-10.0, 10.0, 800), 0.0, 1.0)
    rows[:, 3], rows[:, 4] = np.cos(angle / 2), np.sin(angle / 2)
    return pose_messages((10**9 + 10 * MS * np.arange(800)).tolist(), rows)


def two_moves():
    """The second is short."""
    time = np.arange(0.0, 5.0, 0.01)
    rows = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (500, 1))
    rows[:, 0] = 0.4 * minimum_jerk(time - 0.5) + 0.02 * minimum_jerk((time - 2.5) / 0.5)
    return pose_messages((10**9 + 10 * MS * np.arange(500)).tolist(), rows)


def stamped(*places, value=None):
    """Poses whose stamps change places, or one of which is another, by a sound clock of the recorder."""
    stamps = np.array(STAMPS)
    stamps[[*places]] = stamps[[*places][::-1]] if value is None else value
    rows = pose_messages(stamps.tolist(), moving_rows())
    return [(*row[:3], log) for row, log in zip(rows, STAMPS, strict=True)]


def two_publishers():
    """Of joint states, each with a clock of its own."""
    late = joint_messages([stamp - 15 * MS for stamp in STAMPS[::3]], ["finger"], np.zeros((134, 1)))
    rows = pose_messages(STAMPS, moving_rows()) + joint_messages(STAMPS, ["a", "b"], moving_rows()[:, :2])
    return rows + [(*row[:3], row[3] + 15 * MS) for row in late]


def poses(**far):
    """By topic, how far each moves."""
    return [
        one for topic, its in far.items() for one in pose_messages(STAMPS, moving_rows(far=its), f"/{topic}")
    ]


DEGREES = joint_messages(STAMPS, ["elbow"], np.linspace(0.0, 30.0, 400)[:, None])
BARE = [
    ("/hand", "geometry_msgs/msg/Pose", row[2]["pose"], row[3])
    for row in pose_messages(STAMPS, moving_rows())
]
ORDER, STILL = "Do stamps increase?", "Does the hand move in all?"
SEEN = {
    "turn": (there_and_back(), None, {PRIMITIVES: "turns by 5 degrees between moves 1 and 2"}, 2),
    "short": (two_moves(), None, {PRIMITIVES: "idle?"}, 2),
    "repeat": (stamped(100, value=STAMPS[99]), (ORDER, "doubtful"), {"stamps": "of 400 stamps"}, 1),
    "swap": (stamped(100, 101), (ORDER, "doubtful"), {"stamps": "of 400 stamps"}, 1),
    "publishers": (two_publishers(), (ORDER, "yes"), {}, 1),
    "several": (poses(a_part=0.02, camera=0.0, tool=0.4), None, {"topics.pose": "also there: /a_part"}, 1),
    "still": (poses(tool=0.0), (STILL, "no"), {PRIMITIVES: "no motion"}, None),
    "degrees": (poses(tool=0.3) + DEGREES, ("Are joints' positions in rad?", "doubtful"), {}, 1),
    "bare": (BARE, ("Do messages say when they were taken?", "doubtful"), {}, 1),
}
"""Messages of a bag, a question with its answer, warnings by key of the entry, and how many moves."""


@pytest.mark.parametrize("name", SEEN)
def test_what_is_seen_of_a_bag_is_answered_and_doubted(tmp_path, name):
    messages, asked, warned, moves = SEEN[name]
    write_bag(tmp_path / "1.mcap", sorted(messages, key=lambda row: row[3]))
    found = find_out(str(tmp_path))
    assert (found.motion and found.motion.number) == moves
    if asked:
        assert answer(found, asked[0]).verdict == asked[1]
    for key, words in warned.items():
        assert any(words in warning for warning in found.proposal.warnings[key])
    policy = {"repeat": "drop", "swap": "sort"}.get(name)
    stamps = {"clock": "header", "disorder": policy} if policy else None
    assert found.proposal.entry.get("stamps") == stamps
    assert found.sources[0].source in ("/tool", "/hand")


OLD = 1_600_000_000 * 10**9
NONE = {
    "no pose": ([("/note", "std_msgs/msg/String", {"data": "hello"}, 10**9)], "No entry can be proposed"),
    # a uniform clock over a stamp of another age would have more ticks than the memory
    "age": (
        pose_messages([10**9, *(OLD + stamp for stamp in STAMPS[1:])], moving_rows()),
        "no path of /tool: /tool has stamps that lie 1.6e+09 s apart",
    ),
    "joints": (
        joint_messages(STAMPS, ["elbow", "wrist"], moving_rows()[:, :2]),
        "joints in /joint_states (elbow, wrist)",
    ),
}


@pytest.mark.parametrize("name", NONE)
def test_a_bag_without_a_path_of_a_hand_has_no_entry(tmp_path, capsys, name):
    messages, words = NONE[name]
    write_bag(tmp_path / "1.mcap", messages)
    inspect_source(str(tmp_path), PANDA if name == "joints" else None, tmp_path / "entry.yaml")
    text = capsys.readouterr().out
    assert words in text
    assert "No entry can be proposed" in text
    assert ("--urdf FILE" in text) == (name == "joints")
    assert not (tmp_path / "entry.yaml").exists()


def test_a_file_without_the_pose_of_the_others_is_named(tmp_path):
    for name in "123":
        topic = "/other" if name == "2" else "/tool"
        write_bag(tmp_path / f"{name}.mcap", pose_messages(STAMPS, moving_rows(), topic))
    found = find_out(str(tmp_path))
    assert answer(found, "Does every file have the hand's pose?").number == "/tool: 2 of 3"
    assert found.proposal.warnings["topics.pose"][0].startswith("not in 2,")


def test_clocks_out_of_step_are_said_and_the_log_is_taken(example, tmp_path):
    def late(topic, messages):
        """The hand's header clock is one of another machine."""
        if topic != "/gripper/pose":
            return messages
        return replace(messages, log_times=messages.log_times + 400 * MS)

    source = rewritten(example, tmp_path / "late", ["/gripper/pose", "/joint_states"], late)
    found = find_out(str(source))
    step = answer(found, "Are the clocks in step?")
    assert step.verdict == "no"
    assert "400 ms" in step.number
    assert found.proposal.entry["stamps"] == {"clock": "log", "disorder": "error"}
    assert "out of step" in found.proposal.warnings["stamps"][0]


def test_damaged_files_are_left_out_and_named(example, tmp_path, capsys):
    for path in sorted(example.iterdir()):
        content = path.read_bytes()
        (tmp_path / path.name).write_bytes(content[:-100] if path.stem == "02" else content)
    inspect_source(str(tmp_path), None, None)
    text = capsys.readouterr().out
    assert len([line for line in text.splitlines() if line.startswith("02: left out: ")]) == 1
    assert "Can all files be read?" in text
    assert "2 of 3" in text
    for path in tmp_path.iterdir():
        path.write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"01\.mcap"):
        inspect_source(str(tmp_path), None, None)
    with pytest.raises(InputError, match="no such"):
        inspect_source(str(tmp_path / "nowhere"), None, None)


def test_a_name_for_the_task_is_one_for_folders_and_the_home_folder_is_not_written_out(tmp_path, monkeypatch):
    assert task_name("~/my bags (new)") == "my_bags_new"
    assert task_name("~/bags/2026-01-02") == "task_2026_01_02"  # a number in YAML
    assert task_name("~/---") == "task"
    (tmp_path / "a-b.mcap").write_bytes(b"")
    assert task_name(str(tmp_path / "a-b.mcap")) == "a_b"
    monkeypatch.setenv("HOME", "/home/somebody")
    assert from_home("/home/somebody/bags") == "~/bags"
    assert [from_home(path) for path in ("~/bags", "bags", "/data")] == ["~/bags", "bags", "/data"]


@pytest.mark.parametrize(
    ("name", "axes", "repeats"),
    [
        ("pour in place", ["xyz", "rot", "rot", "xyz"], 1),
        ("wipe, no pauses", ["xyz"] * 6, 1),
        ("wipe, 3 to 5 strokes", ["xyz", "strokes", "xyz"], 1),
        ("session of 5", ["xyz"] * 3, "auto"),
    ],
)
def test_turns_strokes_and_sessions_are_proposed_as_they_were_made(
    root, monkeypatch, tmp_path, name, axes, repeats
):
    monkeypatch.syspath_prepend(root / "benchmarks")
    made = runpy.run_path(str(root / "benchmarks/kinds_of_recordings.py"))["outcome"](name, 11, tmp_path)
    assert made.right
    assert made.warnings == 0
    assert made.errors_ms.mean() < 25.0
    task = read_task("bags", tmp_path / "structlearn.yaml")
    assert [primitive.axis for primitive in task.segment.primitives] == axes
    assert task.repeats == repeats


NAMES, ANGLES = ["finger", "elbow", "wrist"], np.linspace(0.0, 1.0, 400)[:, None] * [0.0, 1.0, -0.5]


def joint_states(effort, second=()):
    rows = pose_messages(STAMPS, moving_rows()) + joint_messages(STAMPS, NAMES, ANGLES, effort=effort)
    late = [stamp + 2 * MS for stamp in STAMPS[::5]] if second else []
    return rows + joint_messages(late, NAMES, np.ones((len(late), 3)), effort=np.ones((len(late), 3)))


def turned(quaternions):
    rows = moving_rows()
    rows[quaternions, 3:] = 0.0
    return pose_messages(STAMPS, rows)


def efforts(rows, columns):
    values = np.ones((400, 3))
    values[rows, columns] = np.nan
    return values


JUDGED = {
    "finger": (joint_states(efforts(slice(None), 0)), None, "joint_torques are not of finger and left out"),
    "activation": (joint_states(efforts(slice(5), 2)), "effort of wrist is nan", ""),
    "publishers": (joint_states(efforts([], 0), [1]), None, "position of finger, elbow, wrist: values go"),
    "no turns": (turned(slice(None)), None, "orientation: not recorded"),
    "one turn": (turned([200]), "row 200 .* quaternion has norm 0, not 1", ""),
}


@pytest.mark.parametrize("name", JUDGED)
def test_what_is_proposed_passes_the_import_or_its_reason_is_said(tmp_path, capsys, name):
    messages, refused, remark = JUDGED[name]
    write_bag(tmp_path / "1.mcap", sorted(messages, key=lambda row: row[3]))
    inspect_source(str(tmp_path), None, tmp_path / "entry.yaml")
    text, found = capsys.readouterr().out, find_out(str(tmp_path))
    readable = answer(found, "Can all files be read?")
    if refused:
        assert found.proposal is None
        assert readable.verdict == "no"
        assert re.search(f"No entry can be proposed: the import refuses every recording: .*{refused}", text)
        assert not (tmp_path / "entry.yaml").exists()
        return
    assert readable.verdict == "yes"
    assert remark in text
    assert remark in (tmp_path / "entry.yaml").read_text()
    task = as_task((tmp_path / "entry.yaml").read_text(), tmp_path)
    (recording,) = read_recordings(tmp_path, task.topics, task.stamps)
    assert "joint_torques" not in {stream.kind for stream in recording.streams}


def test_recordings_that_the_import_refuses_are_left_out_of_the_entry_with_their_reasons(tmp_path):
    rows = [moving_rows(seed=seed) for seed in range(4)]
    rows[1][200, 1] += 0.5
    rows[3][:, 3:] = rows[2][:, 3:]
    for number, values in enumerate(rows):
        messages = pose_messages(STAMPS, values)
        for message in messages if number == 3 else ():
            message[2]["header"]["frame_id"] = "tool"
        write_bag(tmp_path / f"{number}.mcap", messages)
    found = find_out(str(tmp_path))
    readable = answer(found, "Can all files be read?")
    assert (readable.verdict, readable.number) == ("doubtful", "2 of 4")
    task = as_task("\n".join(as_yaml(found.proposal)), tmp_path)
    left_out = {}
    kept = list(on_clock(task, read(tmp_path, task, left_out), task.clock, left_out))
    assert [one.name for one in kept] == ["0", "2"]
    for name, reason in (("1", "position jumps"), ("3", "frame_id is tool, in 0 it is base_link")):
        assert reason in found.refused[name]
        assert any(reason in warning for warning in found.proposal.warnings["segment.skip_failures"])


def test_a_hand_of_which_no_pose_can_be_read_says_why(tmp_path, capsys):
    messages = pose_messages([*STAMPS[:200], *STAMPS[:200]], moving_rows(), logged=STAMPS)
    write_bag(tmp_path / "1.mcap", messages)
    inspect_source(str(tmp_path), None, None)
    assert "pose of a hand: " in (text := capsys.readouterr().out)
    assert re.search(r"No entry can be proposed: .*the clock goes back by 1\.99 s at row 200", text)
