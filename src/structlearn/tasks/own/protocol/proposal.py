"""An entry of `stages/tasks/own.yaml` for recordings without an entry, with its warnings.

It holds what the files tell and the defaults do not. What was chosen among several, and what may go wrong, is
said beside the key that it is about.
"""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from structlearn.readers.clock import MAX_GAP_S
from structlearn.readers.messages import READERS
from structlearn.readers.topics import JointPose
from structlearn.rigid_body.urdf import moving_joints
from structlearn.tasks.own.protocol.fitness import IN_STEP_S, out_of_step
from structlearn.tasks.own.protocol.hand_paths import Candidate
from structlearn.tasks.own.protocol.inspection import (
    FileSeen,
    SourceSeen,
    TopicSeen,
    arm_of,
    clocks_of,
    series_of,
)
from structlearn.tasks.own.protocol.motion_survey import MotionSurvey
from structlearn.tasks.task_files import local_path

TOUCH = re.compile(r"tactile|biotac|finger|skin|taxel|touch|press", re.IGNORECASE)
"""What topics of tactile arrays are mostly called; other arrays are commands and the like."""

TURN_DEG = 3.0
"""Degrees that a hand turns while its position rests, from which on this may be a primitive: sensors are ten
times as good."""


@dataclass(frozen=True)
class Proposal:
    """What to paste below `movement:`.

    Attributes:
        name: of the task.
        entry: its values, nested as in the file.
        doubts: of a value, by its keys joined by dots, in words.
        read: topics that the entry makes the reader read.
    """

    name: str
    entry: Mapping[str, Any]
    doubts: Mapping[str, Sequence[str]]
    read: Sequence[str]


def propose(
    seen: SourceSeen, hand: Candidate, others: Sequence[Candidate], motion: MotionSurvey | None
) -> Proposal:
    """The entry for what was seen: the chosen source of poses, others, the likelier first, and its motion."""
    topics, doubts = _topics(seen, hand, others)
    entry: dict[str, Any] = {"source": from_home(seen.source), "topics": topics}
    read = _read(hand, topics)
    stamps, doubts["stamps"] = _stamps(seen.files, read, hand)
    if stamps:
        entry["stamps"] = stamps
    number, doubts["segment.primitives"] = _primitives(motion)
    entry["segment"] = {"primitives": number}
    if seen.urdf is not None and isinstance(hand.source, JointPose) and hand.source.urdf == seen.urdf:
        known = [name for file in seen.files if (arm := arm_of(file.topics)) for name in arm[1].names]
        locked = [joint for joint in moving_joints(local_path(seen.urdf)) if joint not in known]
        entry["robot"] = {"urdf": from_home(seen.urdf), "tip": hand.source.tip, "locked_joints": locked}
    damaged = [f"cannot be read, and has to go: {', '.join(seen.damaged)}"] if seen.damaged else []
    doubts["source"] = damaged + [
        f"{topic} of {name} has a gap of {one.largest_gap_s:.3g} s at {one.gap_at_s:.3g} s: refused where "
        "it is longer than `clock: {max_gap_s: ...}`"
        for name, topic, one in series_of(seen.files, read, hand.source)
        if one.largest_gap_s > MAX_GAP_S
    ]
    doubts = {key: said for key, said in doubts.items() if said}
    return Proposal(task_name(seen.source), entry, doubts, read)


def task_name(source: str) -> str:
    """A name for a task whose files lie at a path: lower-case letters, digits and _ of its last part."""
    path = local_path(source).absolute()
    words = re.findall(r"[a-z0-9]+", (path.stem if path.is_file() else path.name).lower())
    return "_".join(words)[:60] or "task"


def from_home(path: str) -> str:
    """A path as it can be kept in a file that others read: with `~` for the home folder, else as it is."""
    home = Path.home()
    return f"~/{Path(path).relative_to(home)}" if Path(path).is_relative_to(home) else path


def _read(hand: Candidate, topics: Mapping[str, Any]) -> list[str]:
    """Topics that are named, but those of transforms at rest, whose stamps say nothing."""
    pose = hand.source if isinstance(hand.source, str) else hand.source.topic
    joints = topics.get("joint_states", [])
    rest = [
        *([joints] if isinstance(joints, str) else joints),
        topics.get("wrench"),
        *topics.get("tactile", []),
    ]
    return list(dict.fromkeys([pose, *(topic for topic in rest if topic)]))


def _topics(
    seen: SourceSeen, hand: Candidate, others: Sequence[Candidate]
) -> tuple[dict[str, Any], dict[str, list[str]]]:
    source = hand.source
    topics: dict[str, Any] = {"pose": source if isinstance(source, str) else source.model_dump()}
    doubts: dict[str, list[str]] = {"topics.pose": list(_pose_doubts(seen, hand, others))}
    arms = [found[0] for file in seen.files if (found := arm_of(file.topics))]
    if arms:
        arm = max(sorted(set(arms)), key=arms.count)
        if arm in _of_types(seen.files, READERS["joint_states"]):
            parts = [arm, *_other_kinds(seen.files, arm)]
            topics["joint_states"] = parts if parts[1:] else arm
            doubts["topics.joint_states"] = list(_joint_doubts(seen.files, parts))
    if wrenches := _of_types(seen.files, READERS["wrench"]):
        topics["wrench"] = wrenches[0]
        doubts["topics.wrench"] = [f"also there: {', '.join(wrenches[1:])}"] if wrenches[1:] else []
    arrays = _of_types(seen.files, READERS["tactile"])
    if touch := [topic for topic in arrays if TOUCH.search(topic)]:
        topics["tactile"] = touch
        doubts["topics.tactile"] = ["by their names; are these tactile sensors?"]
    if left := [topic for topic in arrays if topic not in touch]:
        doubts.setdefault("topics.tactile" if touch else "topics.pose", []).append(
            f"arrays that may be tactile sensors: {', '.join(left)}"
        )
    return topics, doubts


def _pose_doubts(seen: SourceSeen, hand: Candidate, others: Sequence[Candidate]) -> Iterator[str]:
    files = seen.files
    if not hand.moves:
        yield "it does not move"
    missing = [file.name for file in files if file.name not in hand.paths]
    if missing:
        yield f"not in {_listed(missing)}, which cannot be read by this entry"
    if isinstance(hand.source, str):
        frames = {frame for _, _, clocks in clocks_of(files, [hand.source]) for frame in clocks.frames}
        if len(frames) > 1:
            yield f"its messages are of several frames: {', '.join(sorted(frames))}"
    for other in others[:3]:
        yield f"also there: {other.words}, which goes {other.travelled:.4g} m"
    if len(others) > 3:
        yield f"and {len(others) - 3} more"


def _other_kinds(files: Sequence[FileSeen], arm: str) -> list[str]:
    """Topics on which velocities or torques of the same joints are by themselves."""
    first = files[0].topics
    names = {name for joints in first[arm].joints for name in joints.names}
    kinds, found = _kinds(first[arm]), []
    for topic in _of_types(files, READERS["joint_states"]):
        same = {name for joints in first[topic].joints for name in joints.names} == names
        if topic != arm and same and not kinds & _kinds(first[topic]):
            kinds |= _kinds(first[topic])
            found.append(topic)
    return found


def _kinds(seen: TopicSeen) -> set[str]:
    return {kind for joints in seen.joints for kind in joints.values}


def _joint_doubts(files: Sequence[FileSeen], parts: Sequence[str]) -> Iterator[str]:
    arm = parts[0]
    sets = set()
    for file in files:
        by_publisher: dict[int, tuple[str, ...]] = {}
        for joints in file.topics[arm].joints if arm in file.topics else ():
            by_publisher[joints.publisher] = by_publisher.get(joints.publisher, ()) + joints.names
        sets |= set(by_publisher.values())
    if len(sets) > 1:
        most = max(sorted(sets), key=len)
        others = "; ".join(", ".join(names) for names in sorted(sets - {most}))
        yield f"several publish on it; taken is {', '.join(most)}, not {others} (`joints` names others)"
    if any("joint_torques" in _kinds(file.topics[arm]) for file in files if arm in file.topics):
        yield f"it has efforts: `motion: {{source: ..., topic: {arm}, urdf: ...}}` identifies the arm"
    if elsewhere := [topic for topic in _of_types(files, READERS["joint_states"]) if topic not in parts]:
        yield f"also there: {', '.join(elsewhere)}"


def _stamps(
    files: Sequence[FileSeen], read: Sequence[str], hand: Candidate
) -> tuple[dict[str, str], list[str]]:
    """What differs from header stamps that increase, and why."""
    off = max((out_of_step(file, read) for file in files), default=0.0)
    by_log = off > IN_STEP_S[1]
    logs = [(name, topic, one.log) for name, topic, one in clocks_of(files, read)]
    taken = logs if by_log else series_of(files, read, hand.source)
    repeated, backward = (sum(getattr(one, kind) for _, _, one in taken) for kind in ("repeated", "backward"))
    if not (by_log or repeated or backward):
        return {}, []
    disorder = "sort" if backward else "drop" if repeated else "error"
    doubts = []
    if by_log:
        doubts.append(f"header clocks are out of step by {off:.3g} s: the recorder's clock is taken")
    if repeated or backward:
        where = sorted({f"{name} {topic}" for name, topic, one in taken if one.repeated or one.backward})
        total = sum(one.count for _, _, one in taken)
        doubts.append(
            f"of {total} stamps {repeated} repeat and {backward} run back, in {_listed(where)}; "
            "`error` would refuse them"
        )
    return {"clock": "log" if by_log else "header", "disorder": disorder}, doubts


def _primitives(motion: MotionSurvey | None) -> tuple[int, list[str]]:
    """Their number, and what speaks against it."""
    if motion is None:
        return 1, ["no motion was found; how many moves are there?"]
    if motion.number == 0:
        return 1, ["runs of motion do not agree; how many moves are there?"]
    doubts = ["or their names, e.g. [" + ", ".join(f"move_{n + 1}" for n in range(motion.number)) + "]"]
    others = [f"{name} ({len(motion.counted(name))})" for name in motion.runs if name not in motion.agreeing]
    if others:
        doubts.append(f"another number of runs: {_listed(others)}; take them out, or `skip_failures: true`")
    doubts += [
        f"the hand turns by {turn:.0f} degrees between moves {place + 1} and {place + 2}: a primitive of its "
        "own, with `axis: between`?"
        for place, turn in enumerate(motion.turns_deg)
        if turn > TURN_DEG
    ]
    for place, alike in enumerate(zip(*(motion.counted(name) for name in motion.agreeing), strict=True)):
        if alike[0].short:
            way = max(run.way for run in alike)
            doubts.append(f"move {place + 1} is of {1e3 * way:.3g} mm at most: idle? then it is one less")
    return motion.number, doubts


def _listed(words: Sequence[str], most: int = 4) -> str:
    """Words with commas, and how many more there are."""
    more = f" and {len(words) - most} more" if len(words) > most else ""
    return ", ".join(words[:most]) + more


def _of_types(files: Sequence[FileSeen], types: Collection[str]) -> list[str]:
    """Topics of such messages that every file has, in the order of their names."""
    return [
        topic
        for topic in sorted({topic for file in files for topic in file.topics})
        if all(
            topic in file.topics and file.topics[topic].clocks and set(file.topics[topic].types) <= set(types)
            for file in files
        )
    ]
