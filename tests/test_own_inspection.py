"""What is said of recordings before anything is configured, and the entry that is proposed for them."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import yaml
from committed import ROOT, own_tasks
from conftest import minimum_jerk
from readers_bags import (
    header,
    joint_messages,
    pose_messages,
    transform_messages,
    transform_stamped,
    write_bag,
)

from structlearn.core.errors import InputError
from structlearn.readers import bag
from structlearn.readers.computed_pose import TransformSeries
from structlearn.simulation.arm import urdf_path
from structlearn.tasks.inspection.proposal import from_home, task_name
from structlearn.tasks.inspection.recordings_report import as_yaml, find_out, inspect
from structlearn.tasks.inspection.source_survey import frame_pairs
from structlearn.tasks.pick_and_place_world import TIP, URDF, takes, write_takes
from structlearn.tasks.project import CLONE
from structlearn.tasks.task_entry import read_task

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
    own_tasks(folder)
    (folder / CLONE / "own.yaml").write_text((ROOT / CLONE / "own.yaml").read_text() + entry)
    (name,) = yaml.safe_load(entry)
    return read_task(name, folder / CLONE)


def rewritten(source, target, topics, change=lambda topic, messages: messages):
    """Some topics of every bag of a folder, each changed or not."""
    target.mkdir()
    for path in sorted(source.iterdir()):
        found = bag.read_bag(path, topics).messages
        changed = {topic: change(topic, messages) for topic, messages in found.items()}
        bag.write_bag(target / path.name, {"provenance": "{}", "true_segments": "null"}, changed.items())
    return target


def moving_rows(count=400, seed=0, far=0.3):
    """Poses x, y, z, qw .. of a hand that rests, goes `far` along x, and rests."""
    phase = np.clip(np.linspace(-0.2, 1.2, count), 0.0, 1.0)
    rows = np.zeros((count, 7))
    rows[:, 3] = 1.0
    rows[:, 0] = far * (10 * phase**3 - 15 * phase**4 + 6 * phase**5)
    rows[:, :3] += np.random.default_rng(seed).normal(scale=2e-4, size=(count, 3))
    return rows


@pytest.mark.parametrize("moves", [2, 3, 5])
def test_the_proposed_entry_is_a_task_with_as_many_primitives_as_moves(tmp_path, capsys, moves):
    source = tmp_path / f"{moves} moves"
    source.mkdir()
    write_takes(takes(11, moves, 3), source)
    inspect(str(source), None, tmp_path / "entry.yaml")
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
    for question in (
        "Do runs of motion agree in number?",
        "Are joints' positions in rad?",
    ):
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
    assert any("04 (2)" in doubt for doubt in found.proposal.doubts[PRIMITIVES])


def test_a_short_run_that_all_have_is_asked_about(tmp_path):
    time = np.arange(0.0, 5.0, 0.01)
    x = 0.4 * minimum_jerk(time - 0.5) + 0.02 * minimum_jerk((time - 2.5) / 0.5)
    table = pd.DataFrame({"time_s": time + 1.0, "x": x, "y": 0.0, "z": 0.0})
    for name in ("one", "two"):
        table.to_csv(tmp_path / f"{name}.csv", index=False)
    proposal = find_out(str(tmp_path)).proposal
    assert proposal.entry["segment"]["primitives"] == 2
    assert any("move 2 is of " in doubt and "idle?" in doubt for doubt in proposal.doubts[PRIMITIVES])


def test_joint_states_alone_ask_for_the_robot(example, tmp_path):
    source = rewritten(example, tmp_path / "joints", ["/joint_states"])
    for joints, robot in ((source, None), (tmp_path / "other.mcap", PANDA)):
        if robot:
            write_bag(joints, joint_messages(STAMPS, ["a1", "a2"], moving_rows()[:, :2]))
        found = find_out(str(joints), robot)
        assert found.proposal is None
        hand = answer(found, "Is there a pose of the hand?")
        assert hand.verdict == "no"
        assert f"joints in /joint_states ({'a1' if robot else 'panda_joint1'}, " in hand.advice
        assert "URDF=" in hand.advice


def test_joint_states_and_a_robot_give_the_hand(example, tmp_path):
    source = rewritten(example, tmp_path / "joints", ["/joint_states"])
    found = find_out(str(source), PANDA)
    assert found.motion.number == 3
    assert found.proposal.entry["topics"]["pose"] == {"urdf": PANDA, "tip": TIP, "topic": "/joint_states"}
    task = as_task("\n".join(as_yaml(found.proposal)), tmp_path)
    assert (task.robot.urdf, task.robot.tip) == (PANDA, TIP)
    assert task.robot.locked_joints == ("panda_finger_joint1", "panda_finger_joint2")
    captured = find_out(str(example)).sources[0]
    for name, path in found.sources[0].paths.items():
        assert path.extent_m == pytest.approx(captured.paths[name].extent_m, rel=0.01)


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
    inspect(str(tmp_path), None, None)
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
    assert "source" not in found.proposal.doubts


def test_of_several_poses_the_one_that_moves_most_is_taken(tmp_path):
    rows = pose_messages(STAMPS, moving_rows(far=0.02), "/a_part")
    rows += pose_messages(STAMPS, moving_rows(far=0.0), "/camera")
    rows += pose_messages(STAMPS, moving_rows(far=0.4), "/tool")
    write_bag(tmp_path / "1.mcap", sorted(rows, key=lambda row: row[3]))
    found = find_out(str(tmp_path))
    assert [one.source for one in found.sources] == ["/tool", "/a_part", "/camera"]
    assert "also there: /a_part" in found.proposal.doubts["topics.pose"][0]


def test_topics_neither_steer_the_terminal_nor_write_an_entry_of_their_own(tmp_path, capsys):
    evil = '/a\x1b]0;title\x07\x1b[2J\u202e\n  "x; touch PWNED": {source: bags}\n  '
    rows = pose_messages(STAMPS, moving_rows(far=0.02), evil) + pose_messages(
        STAMPS, moving_rows(), evil[:-1]
    )
    rows += joint_messages(STAMPS, [evil], np.zeros((400, 1)), evil[:-2])
    bag = tmp_path / "bags" / "1.mcap"
    bag.parent.mkdir()
    write_bag(bag, sorted(rows, key=lambda row: row[3]))
    inspect(str(bag.parent), None, tmp_path / "entry.yaml")
    printed, entry = capsys.readouterr().out, (tmp_path / "entry.yaml").read_text()
    for text in (printed, entry):
        assert all(line.isprintable() for line in text.split("\n"))
        assert "touch PWNED" in text
    assert list(yaml.safe_load("movement:\n" + entry)["movement"]) == ["bags"]
    assert as_task(entry, tmp_path).topics.pose == evil[:-1]
    with pytest.raises(InputError) as error:
        raise InputError(f"1.mcap: topic '{evil}' is missing")
    assert str(error.value).isprintable()


def test_a_turn_between_two_moves_is_a_doubt(tmp_path):
    rows = np.vstack([moving_rows(), moving_rows()])
    rows[400:, 0] = rows[399, 0] - rows[400:, 0]
    angle = np.radians(5.0) * np.clip(np.linspace(-10.0, 10.0, 800), 0.0, 1.0)  # half way, in half a second
    rows[:, 3], rows[:, 4] = np.cos(angle / 2), np.sin(angle / 2)
    stamps = (10**9 + 10 * MS * np.arange(800)).tolist()
    write_bag(tmp_path / "1.mcap", pose_messages(stamps, rows))
    found = find_out(str(tmp_path))
    assert found.motion.turns_deg == pytest.approx([5.0], abs=0.1)
    assert any(
        "turns by 5 degrees between moves 1 and 2" in doubt for doubt in found.proposal.doubts[PRIMITIVES]
    )


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
    assert "out of step" in found.proposal.doubts["stamps"][0]


@pytest.mark.parametrize(("fault", "policy"), [("repeat", "drop"), ("swap", "sort")])
def test_disorder_of_stamps_is_counted_and_a_policy_is_proposed(tmp_path, fault, policy):
    logs = 10**9 + 10 * MS * np.arange(400)
    stamps = logs.copy()
    if fault == "swap":
        stamps[[100, 101]] = stamps[[101, 100]]
    else:
        stamps[100] = stamps[99]
    rows = pose_messages(stamps.tolist(), moving_rows())
    rows = [(*row[:3], int(log)) for row, log in zip(rows, logs, strict=True)]
    write_bag(tmp_path / "1.mcap", rows)
    found = find_out(str(tmp_path))
    assert answer(found, "Do stamps increase?").verdict == "doubtful"
    assert found.proposal.entry["stamps"] == {"clock": "header", "disorder": policy}
    assert "of 400 stamps" in found.proposal.doubts["stamps"][0]
    assert found.motion.number == 1


def joint_message(stamp, names, position, effort=(), velocity=()):
    fields = {"position": list(position), "velocity": list(velocity), "effort": list(effort)}
    content = {"header": header(stamp), "name": list(names)} | fields
    return ("/joint_states", "sensor_msgs/msg/JointState", content, stamp)


def test_two_publishers_of_joint_states_are_no_disorder(tmp_path):
    stamps = 10**9 + 10 * MS * np.arange(400)
    rows = pose_messages(stamps.tolist(), moving_rows())
    rows += [joint_message(stamp, ("a", "b"), (0.0, 1.0)) for stamp in stamps.tolist()]
    late = [joint_message(stamp - 15 * MS, ("finger",), (0.0,)) for stamp in stamps[::3].tolist()]
    rows += [(*row[:3], row[3] + 15 * MS) for row in late]
    write_bag(tmp_path / "1.mcap", sorted(rows, key=lambda row: row[3]))
    found = find_out(str(tmp_path))
    joints = found.seen.files[0].topics["/joint_states"].joints
    assert {one.names for one in joints} == {("a", "b"), ("finger",)}
    assert answer(found, "Do stamps increase?").verdict == "yes"
    assert "stamps" not in found.proposal.entry


def test_messages_without_headers_are_stamped_by_the_log(tmp_path, capsys):
    for number in range(2):
        rows = [
            ("/hand", "geometry_msgs/msg/Pose", row[2]["pose"], row[3])
            for row in pose_messages((10**9 + 20 * MS * np.arange(400)).tolist(), moving_rows(seed=number))
        ]
        write_bag(tmp_path / f"{number}.mcap", rows)
    inspect(str(tmp_path), None, None)
    (line,) = {line for line in capsys.readouterr().out.splitlines() if "geometry_msgs/Pose" in line}
    assert line.split() == ["/hand", "geometry_msgs/Pose", "400", "50", "Hz", "0.02", "s", "log"]
    found = find_out(str(tmp_path))
    assert answer(found, "Do messages say when they were taken?").verdict == "doubtful"
    assert found.motion.number == 1


def test_a_file_without_the_pose_of_the_others_is_named(tmp_path):
    for name in "123":
        topic = "/other" if name == "2" else "/tool"
        write_bag(tmp_path / f"{name}.mcap", pose_messages(STAMPS, moving_rows(), topic))
    found = find_out(str(tmp_path))
    assert answer(found, "Does every file have the hand's pose?").number == "/tool: 2 of 3"
    assert found.proposal.doubts["topics.pose"][0].startswith("not in 2,")


def test_a_hand_that_does_not_move_has_no_runs(tmp_path, capsys):
    write_bag(tmp_path / "1.mcap", pose_messages(STAMPS, moving_rows(far=0.0)))
    found = find_out(str(tmp_path))
    assert found.motion is None
    assert answer(found, "Does the hand move in all?").verdict == "no"
    assert "no motion" in found.proposal.doubts[PRIMITIVES][0]
    inspect(str(tmp_path), None, None)
    assert "it does not move" in capsys.readouterr().out


def test_joints_in_degrees_are_doubtful(tmp_path):
    joints = np.linspace(0.0, 30.0, 400)[:, None]
    messages = pose_messages(STAMPS, moving_rows()) + joint_messages(STAMPS, ["elbow"], joints)
    write_bag(tmp_path / "1.mcap", messages)
    found = answer(find_out(str(tmp_path)), "Are joints' positions in rad?")
    assert (found.verdict, found.advice) == ("doubtful", "degrees? look at /joint_states in 1")


def test_a_stamp_of_another_age_is_named(tmp_path, capsys):
    """A uniform clock over it would have more ticks than the memory."""
    stamps = (1_600_000_000 * 10**9 + 10 * MS * np.arange(400)).tolist()
    write_bag(tmp_path / "1.mcap", pose_messages([10**9, *stamps[1:]], moving_rows()))
    inspect(str(tmp_path), None, None)
    text = capsys.readouterr().out
    assert "no path of /tool: /tool has stamps that lie 1.6e+09 s apart" in text
    assert "No entry can be proposed" in text


def test_damaged_files_are_left_out_and_named(example, tmp_path, capsys):
    for path in sorted(example.iterdir()):
        content = path.read_bytes()
        (tmp_path / path.name).write_bytes(content[:-100] if path.stem == "02" else content)
    inspect(str(tmp_path), None, None)
    text = capsys.readouterr().out
    assert len([line for line in text.splitlines() if line.startswith("02: left out: ")]) == 1
    assert "Can all files be read?" in text
    assert "2 of 3" in text
    for path in tmp_path.iterdir():
        path.write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"01\.mcap"):
        inspect(str(tmp_path), None, None)
    with pytest.raises(InputError, match="no such"):
        inspect(str(tmp_path / "nowhere"), None, None)


def test_a_bag_without_a_pose_has_no_entry(tmp_path, capsys):
    write_bag(tmp_path / "1.mcap", [("/note", "std_msgs/msg/String", {"data": "hello"}, 10**9)])
    inspect(str(tmp_path), None, tmp_path / "entry.yaml")
    assert "No entry can be proposed" in capsys.readouterr().out
    assert not (tmp_path / "entry.yaml").exists()


def test_a_name_for_the_task_is_one_for_folders(tmp_path):
    assert task_name("~/my bags (new)") == "my_bags_new"
    (tmp_path / "a-b.mcap").write_bytes(b"")
    assert task_name(str(tmp_path / "a-b.mcap")) == "a_b"


def test_the_home_folder_is_not_written_out(monkeypatch):
    monkeypatch.setenv("HOME", "/home/somebody")
    assert from_home("/home/somebody/bags") == "~/bags"
    assert [from_home(path) for path in ("~/bags", "bags", "/data")] == ["~/bags", "bags", "/data"]
