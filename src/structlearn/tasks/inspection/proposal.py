"""An entry of `stages/tasks/own.yaml` for recordings of a movement, with its warnings.

It holds what the files tell and the defaults do not. What was chosen among several, and what may go wrong, is
said beside the key that it is about.
"""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from structlearn.readers.messages import READERS
from structlearn.readers.topics import JointPose
from structlearn.rigid_body.urdf import moving_joints
from structlearn.tasks.inspection.fitness import IN_STEP_S, out_of_step
from structlearn.tasks.inspection.hand_paths import Candidate
from structlearn.tasks.inspection.motion_survey import MotionSurvey
from structlearn.tasks.inspection.source_survey import (
    FileSeen,
    SourceSeen,
    TopicSeen,
    arm_of,
    clocks_of,
    series_of,
)
from structlearn.tasks.task_files import local_path

TOUCH = re.compile(r"tactile|biotac|finger|skin|taxel|touch|press", re.IGNORECASE)
"""What topics of tactile arrays are mostly called; other arrays are commands and the like."""

TURN_DEG = 3.0
"""Degrees that a hand turns while its position rests, from which on this may be a primitive: sensors are ten
times as good."""


@dataclass(frozen=True)
class Proposal:
    """What to paste below `movement:`, doubts by dotted keys, and the topics that are read then."""

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
    if seen.damaged:
        doubts["source"] = [f"cannot be read, and has to go: {', '.join(seen.damaged)}"]
    return Proposal(task_name(seen.source), entry, {key: said for key, said in doubts.items() if said}, read)


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
    joints = [joints] if isinstance(joints, str) else joints
    rest = [*joints, *([topics["wrench"]] if "wrench" in topics else []), *topics.get("tactile", [])]
    return list(dict.fromkeys([pose, *rest]))


def _topics(
    seen: SourceSeen, hand: Candidate, others: Sequence[Candidate]
) -> tuple[dict[str, Any], dict[str, list[str]]]:
    source, files = hand.source, seen.files
    topics: dict[str, Any] = {"pose": source if isinstance(source, str) else source.model_dump()}
    doubts: dict[str, list[str]] = {"topics.pose": list(_pose_doubts(seen, hand, others))}
    arms = [found[0] for file in files if (found := arm_of(file.topics))]
    states = _of_types(files, READERS["joint_states"])
    if arms and (arm := max(sorted(set(arms)), key=arms.count)) in states:
        parts = [arm, *_other_kinds(files[0].topics, arm, states)]
        topics["joint_states"] = parts if parts[1:] else arm
        doubts["topics.joint_states"] = list(_joint_doubts(files, parts, states))
    if wrenches := _of_types(files, READERS["wrench"]):
        topics["wrench"] = wrenches[0]
        doubts["topics.wrench"] = [f"also there: {', '.join(wrenches[1:])}"] if wrenches[1:] else []
    arrays = _of_types(files, READERS["tactile"])
    if touch := [topic for topic in arrays if TOUCH.search(topic)]:
        topics["tactile"] = touch
        doubts["topics.tactile"] = ["by their names; are these tactile sensors?"]
    if left := [topic for topic in arrays if topic not in touch]:
        doubts.setdefault("topics.tactile" if touch else "topics.pose", []).append(
            f"arrays that may be tactile sensors: {', '.join(left)}"
        )
    return topics, doubts


def _pose_doubts(seen: SourceSeen, hand: Candidate, others: Sequence[Candidate]) -> Iterator[str]:
    if not hand.moves:
        yield "it does not move"
    if missing := [file.name for file in seen.files if file.name not in hand.paths]:
        yield f"not in {_listed(missing)}, which cannot be read by this entry"
    if isinstance(hand.source, str):
        frames = {frame for _, _, clocks in clocks_of(seen.files, [hand.source]) for frame in clocks.frames}
        if len(frames) > 1:
            yield f"its messages are of several frames: {', '.join(sorted(frames))}"
    if others:
        ways = [f"{one.words}, which goes {one.travelled:.4g} m" for one in others]
        yield f"also there: {_listed(ways, 3)}"


def _other_kinds(topics: Mapping[str, TopicSeen], arm: str, states: Sequence[str]) -> list[str]:
    """Topics on which velocities or torques of the same joints are by themselves."""
    kinds, found = _kinds(topics[arm]), []
    for topic in states:
        if _names(topics[topic]) == _names(topics[arm]) and not kinds & _kinds(topics[topic]):
            kinds |= _kinds(topics[topic])
            found.append(topic)
    return found


def _kinds(seen: TopicSeen) -> set[str]:
    return {kind for joints in seen.joints for kind in joints.values}


def _names(seen: TopicSeen) -> set[str]:
    return {name for joints in seen.joints for name in joints.names}


def _joint_doubts(files: Sequence[FileSeen], parts: Sequence[str], states: Sequence[str]) -> Iterator[str]:
    arm = parts[0]
    sets = set()
    for file in files:
        by_publisher: dict[int, tuple[str, ...]] = {}
        for joints in file.topics[arm].joints:
            by_publisher[joints.publisher] = by_publisher.get(joints.publisher, ()) + joints.names
        sets |= set(by_publisher.values())
    if len(sets) > 1:
        most = max(sorted(sets), key=len)
        others = "; ".join(", ".join(names) for names in sorted(sets - {most}))
        yield f"several publish on it; taken is {', '.join(most)}, not {others} (`joints` names others)"
    if any("joint_torques" in _kinds(file.topics[arm]) for file in files):
        yield f"it has efforts: below `motion:` an entry {{source, topic: {arm}, urdf}} identifies the arm"
    if elsewhere := [topic for topic in states if topic not in parts]:
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
    disorder = "sort" if backward else "drop" if repeated else "error"
    doubts = [f"clocks of headers are out of step by {off:.3g} s: the log's is taken"] if by_log else []
    if repeated or backward:
        where = sorted({f"{name} {topic}" for name, topic, one in taken if one.repeated or one.backward})
        doubts.append(
            f"of {sum(one.count for _, _, one in taken)} stamps {repeated} repeat and {backward} run back, "
            f"in {_listed(where)}; `error` would refuse them"
        )
    return {"clock": "log" if by_log else "header", "disorder": disorder} if doubts else {}, doubts


def _primitives(motion: MotionSurvey | None) -> tuple[int, list[str]]:
    """Their number, and what speaks against it."""
    if motion is None or motion.number == 0:
        none = "no motion was found" if motion is None else "runs of motion do not agree"
        return 1, [f"{none}; how many moves are there?"]
    doubts = ["or their names, e.g. [" + ", ".join(f"move_{n + 1}" for n in range(motion.number)) + "]"]
    others = [f"{name} ({len(motion.counted(name))})" for name in motion.runs if name not in motion.agreeing]
    if others:
        doubts.append(f"another number of runs: {_listed(others)}; take them out, or `skip_failures: true`")
    doubts += [
        f"the hand turns by {turn:.0f} degrees between moves {place} and {place + 1}: a primitive of its "
        "own, with `axis: between`?"
        for place, turn in enumerate(motion.turns_deg, 1)
        if turn > TURN_DEG
    ]
    for place, alike in enumerate(zip(*(motion.counted(name) for name in motion.agreeing), strict=True), 1):
        if alike[0].short:
            way = max(run.way for run in alike)
            doubts.append(f"move {place} is of {1e3 * way:.3g} mm at most: idle? then it is one less")
    return motion.number, doubts


def _listed(words: Sequence[str], most: int = 4) -> str:
    """Words with commas, and how many more there are."""
    more = f" and {len(words) - most} more" if len(words) > most else ""
    return ", ".join(words[:most]) + more


def _of_types(files: Sequence[FileSeen], types: Collection[str]) -> list[str]:
    """Topics of such messages that every file has, in the order of their names."""

    def fits(seen: TopicSeen | None) -> bool:
        return seen is not None and seen.clocks is not None and set(seen.types) <= set(types)

    every = sorted({topic for file in files for topic in file.topics})
    return [topic for topic in every if all(fits(file.topics.get(topic)) for file in files)]
