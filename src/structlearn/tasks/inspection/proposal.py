"""Proposed entry of `structlearn.yaml` for recordings: what the files show and the defaults do not.

Choices among several options, and possible problems, are noted beside the key concerned.
"""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from structlearn.readers.joint_log import unusable_efforts
from structlearn.readers.messages import READERS
from structlearn.readers.source import JointPose, Role, TransformPose
from structlearn.rigid_body.urdf import moving_joints
from structlearn.tasks.inspection.fitness import IN_STEP_S, out_of_step
from structlearn.tasks.inspection.hand_motion import HandCandidate, JointMotion, MotionSurvey, pose_words
from structlearn.tasks.inspection.judgement import Judgement
from structlearn.tasks.inspection.source_survey import SourceSeen, frames_above
from structlearn.tasks.inspection.task_moves import OWN_TURN_DEG, TaskMoves
from structlearn.tasks.task_files import is_name, local_path

# Usual names of tactile topics; other arrays are commands and the like
TOUCH = re.compile(r"tactile|biotac|finger|skin|taxel|touch|press", re.IGNORECASE)

# Usual names of topics that a robot's tool or its digital outputs have; others are states and the like
OUTPUT = re.compile(r"grip|finger|opening|grasp|vacuum|suction|valve|digital|output|/io", re.IGNORECASE)

# Rotation in degrees at a resting position from which it may be a primitive: ten times the noise of sensors
TURN_DEG = 3.0

LEROBOT = "lerobot"  # format of files, and reader, of a LeRobotDataset

# Distance in m between a robot's tip and the hand from which they count as different frames
SAME_START_M = 0.005


class Proposal(NamedTuple):
    """Entry to paste below `movement:`, warnings by dotted key, and the topics that it reads."""

    name: str
    entry: Mapping[str, Any]
    warnings: Mapping[str, Sequence[str]]
    read: Sequence[str]


def propose(
    seen: SourceSeen,
    hand: HandCandidate,
    others: Sequence[HandCandidate],
    motion: MotionSurvey | None,
    moves: TaskMoves,
) -> Proposal:
    """Propose an entry for the chosen pose source and its moves; `others`: sources in order of likelihood."""
    source = hand.source
    topics, warnings = _topics(seen, hand, others)
    read = [source if isinstance(source, str) else source.topic]  # without static transforms
    read += [topics[kind] for kind in ("joint_states", "wrench") if kind in topics]
    read += topics.get("outputs", {}).values()  # digital ones may come when they change
    read = list(dict.fromkeys([*read, *topics.get("tactile", [])]))
    entry: dict[str, Any] = {"source": from_home(seen.source)}
    if seen.files[0].format == LEROBOT:
        entry["reader"] = LEROBOT
    entry["topics"] = topics
    faults = {topic: one.fault for file in seen.files for topic, one in file.topics.items() if one.fault}
    warnings["topics"] = [f"left out: {fault}" for topic, fault in faults.items() if topic not in read]
    stamps, warnings["stamps"] = _stamps(seen, read, hand)
    if warnings["stamps"]:
        entry["stamps"] = stamps
    if moves.repeats:
        entry["repeats"] = "auto"
        warnings["repeats"] = [f"the moves recur {moves.repeats} times: each repeat is a demonstration"]
    entry["segment"] = {"primitives": moves.primitives}
    warnings["segment.primitives"] = list(_move_warnings(motion, moves))
    for arm in (hand, *others):
        if seen.urdf is not None and isinstance(arm.source, JointPose):
            entry["robot"] = _robot(seen, seen.urdf, arm.source)
            warnings["robot"] = _robot_warnings(hand, arm)
    return Proposal(
        task_name(seen.source), entry, {key: said for key, said in warnings.items() if said}, read
    )


def judged(proposal: Proposal, judgement: Judgement, uncut: Mapping[str, str]) -> Proposal:
    """The proposal without the recordings that the import refuses, and with its remarks.

    `uncut`: recordings that cannot be cut as proposed, which are left out too, with the reasons.
    """
    entry, warnings = dict(proposal.entry), dict(proposal.warnings)
    left_out = [f"left out: {name}: {reason}" for name, reason in judgement.refused.items()]
    left_out += [f"left out: {reason}" for name, reason in uncut.items() if name not in judgement.refused]
    if left_out:
        entry["segment"] = {**entry["segment"], "skip_failures": True}
        warnings["segment.skip_failures"] = left_out
    for subject, key in (("joints", "topics.joint_states"), ("orientation", "topics.pose")):
        if said := judgement.remarks.get(subject):
            warnings[key] = [*warnings.get(key, ()), *(f"{subject}: {remark}" for remark in said)]
    if said := judgement.remarks.get("source"):
        warnings["source"] = said
    return proposal._replace(entry=entry, warnings=warnings)


def task_name(source: str) -> str:
    """Task name from a path: lower-case letters, digits and _ of its last part, after `task` if need be."""
    path = local_path(source).absolute()
    words = re.findall(r"[a-z0-9]+", (path.stem if path.is_file() else path.name).lower())
    name = "_".join(words)
    return name[:60] if is_name(name[:60]) else "_".join(["task", *words])[:60]


def from_home(path: str) -> str:
    """Path for a shared file: with `~` for the home folder, otherwise unchanged."""
    home = Path.home()
    return f"~/{Path(path).relative_to(home)}" if Path(path).is_relative_to(home) else path


def _topics(
    seen: SourceSeen, hand: HandCandidate, others: Sequence[HandCandidate]
) -> tuple[dict[str, Any], dict[str, list[str]]]:
    source = hand.source
    topics: dict[str, Any] = {}
    if not isinstance(source, JointMotion):
        topics["pose"] = source if isinstance(source, str) else source.model_dump(exclude_defaults=True)
    warnings: dict[str, list[str]] = {"topics.pose": list(_pose_warnings(seen, hand, others))}
    arms = [topic for topic, _ in seen.arms()]
    states = _of_role(seen, "joint_states")
    if arms and (arm := max(sorted(set(arms)), key=arms.count)) in states:
        topics["joint_states"] = arm
        said = warnings["topics.joint_states"] = []
        unusable = [unusable_efforts(joints) for topic, joints in seen.arms() if topic == arm]
        identified = f"efforts: below `motion:` an entry {{source, topic: {arm}, urdf}} identifies the arm"
        said.append(next((f"no identification of the arm: {why}" for why in unusable if why), identified))
        if isinstance(source, JointMotion):
            topics["joint_states"] = arm = source.topic
            said[:] = ["the joints themselves are learned; with --urdf FILE the pose of the robot's tip"]
        if elsewhere := [topic for topic in states if topic != arm]:
            said.append(f"also there: {', '.join(elsewhere)}")
    if wrenches := _of_role(seen, "wrench"):
        topics["wrench"] = wrenches[0]
        warnings["topics.wrench"] = [f"also there: {', '.join(wrenches[1:])}"] if wrenches[1:] else []
    arrays = _of_role(seen, "tactile")
    if touch := [topic for topic in arrays if TOUCH.search(topic)]:
        topics["tactile"] = touch
        warnings["topics.tactile"] = ["by their names; are these tactile sensors?"]
    if left := [topic for topic in arrays if topic not in touch]:
        key = "topics.tactile" if touch else f"topics.{next(iter(topics))}"
        warnings[key].append(f"arrays that may be tactile sensors: {', '.join(left)}")
    beside: dict[Role, set[str]] = {"digital": {"std_msgs/Bool"}, "outputs": set(READERS["outputs"])}
    for role, kinds in beside.items():
        named = {_words(topic): topic for topic in _of_role(seen, role, kinds) if OUTPUT.search(topic)}
        if named:
            topics[role] = named
            warnings[f"topics.{role}"] = ["by their names; does the robot command these?"]
    return topics, warnings


def _words(topic: str) -> str:
    """Name of an output from its topic."""
    return "_".join(re.findall(r"[a-z0-9]+", topic.lower()))


def _of_role(seen: SourceSeen, role: Role, kinds: Collection[str] | None = None) -> list[str]:
    """Topics of the role, or with messages that it can be read from, that every file has; sorted by name."""
    types = {str(role), *(READERS[role] if kinds is None else kinds)}
    fitting = [
        {name for name, topic in file.topics.items() if topic.clocks and types.issuperset(topic.types)}
        for file in seen.files
    ]
    return sorted(set.intersection(*fitting))


def _pose_warnings(seen: SourceSeen, hand: HandCandidate, others: Sequence[HandCandidate]) -> Iterator[str]:
    if not hand.moves:
        yield "it does not move"
    if missing := [file.name for file in seen.files if file.name not in hand.paths]:
        yield f"not in {_listed(missing)}, which cannot be read by this entry"
    if isinstance(hand.source, JointPose) and hand.source.units:
        yield "angles in rad would be beyond the URDF's limits: degrees? or no angles, but shares of a range?"
    if isinstance(hand.source, JointPose) and hand.source.joints and seen.files[0].format == LEROBOT:
        yield "joints are matched by their order: are these the same?"
    if isinstance(hand.source, str) and hand.source.endswith("[0:7]"):
        yield "columns without names, read as x, y, z, qw, qx, qy, qz; with qw last they are [0:3, 6, 3:6]"
    elif isinstance(hand.source, str) and hand.source.endswith("]"):
        yield "of these columns only; an orientation without qw, qx, qy, qz is not read"
    if isinstance(hand.source, TransformPose) and (above := _frames_above(seen, hand.source)):
        yield f"{hand.source.parent} itself is in {_listed(above)}, where the hand moves with the base too"
    if others:
        descriptions = [f"{pose_words(other.source)}, which goes {other.travelled:.4g} m" for other in others]
        yield f"also there: {_listed(descriptions, 3)}"


def _frames_above(seen: SourceSeen, source: TransformPose) -> list[str]:
    """Frames that carry the parent frame of a pose, the nearest first."""
    topics = (source.topic, f"{source.topic}_static")
    links = [link for _, _, topic in seen.on(topics) for link in topic.links]
    return frames_above(source.parent, {link.child: link.parent for link in links})[1:]


def _robot(seen: SourceSeen, urdf: str, pose: JointPose) -> dict[str, Any]:
    """The robot whose joints were recorded; joints of the URDF that were not recorded are locked."""
    in_urdf = dict(pose.joints)
    known = [in_urdf.get(name, name) for _, joints in seen.arms() for name in joints.names]
    locked = [joint for joint in moving_joints(local_path(urdf)) if joint not in known]
    return {"urdf": from_home(urdf), "tip": pose.tip, "locked_joints": locked}


def _robot_warnings(hand: HandCandidate, arm: HandCandidate) -> list[str]:
    """Warn if the robot's tip, computed from its joints, does not start where the hand does."""
    both = [(path, arm.paths[name]) for name, path in hand.paths.items() if name in arm.paths]
    apart = max((float(np.linalg.norm(a.position[0] - b.position[0])) for a, b in both), default=0.0)
    if apart < SAME_START_M:
        return []
    where = f"by its joints the tip starts up to {apart:.3g} m from {pose_words(hand.source)}"
    return [f"{where}: give `base`, where the robot stands, or `tool`, what it holds"]


def _stamps(seen: SourceSeen, read: Sequence[str], hand: HandCandidate) -> tuple[dict[str, str], list[str]]:
    """Proposed reading of stamps, and reasons if it is not the default."""
    off, _ = out_of_step(seen, read)
    by_log = off > IN_STEP_S[1]
    logs = [(name, topic, clocks.log) for name, topic, clocks in seen.clocks(read)]
    taken = logs if by_log else seen.series(read, hand.source)
    repeated, backward = (
        sum(stamps.repeated for *_, stamps in taken),
        sum(stamps.backward for *_, stamps in taken),
    )
    disorder = "sort" if backward else "drop" if repeated else "error"
    warnings = [f"clocks of headers are out of step by {off:.3g} s: the log's is taken"] if by_log else []
    if repeated or backward:
        where = sorted({f"{name} {topic}" for name, topic, stamps in taken if stamps.disorder})
        warnings.append(
            f"of {sum(stamps.count for *_, stamps in taken)} stamps {repeated} repeat and {backward} run back"
            f", in {_listed(where)}; `error` would refuse them"
        )
    return {"clock": "log" if by_log else "header", "disorder": disorder}, warnings


def _move_warnings(motion: MotionSurvey | None, moves: TaskMoves) -> Iterator[str]:
    if motion is None or motion.number == 0:
        none = "no motion was found" if motion is None else "runs of motion do not agree"
        yield f"{none}; how many moves are there?"
        return
    if isinstance(moves.primitives, int):
        yield "or their names, e.g. [" + ", ".join(f"move_{n + 1}" for n in range(moves.primitives)) + "]"
    if moves.more:
        yield f"{motion.number} runs of motion; with {moves.more} more moves, without pauses, all can be cut"
    if moves.flagged:
        yield f"{moves.flagged} of {moves.tried} demonstrations tried cannot be cut so without a warning"
    if isinstance(moves.primitives, list) and any(move["axis"] == "strokes" for move in moves.primitives):
        yield "`axis: strokes`: the hand goes to and fro, not as often in every demonstration"
        return
    if moves.repeats:
        return
    others = [f"{name} ({len(motion.counted(name))})" for name in motion.runs if name not in motion.agreeing]
    if 2 * len(others) > len(motion.runs):
        yield (
            f"the number of moves varies: only {len(motion.agreeing)} of {len(motion.runs)} demonstrations "
            f"have {motion.number}, and no more can be learned from"
        )
    if others:
        yield f"another number of runs: {_listed(others)}"
    if isinstance(moves.primitives, int):
        yield from (
            f"the hand turns by {turn:.0f} degrees between moves {place} and {place + 1}: a primitive of its "
            "own, with `axis: between`?"
            for place, turn in enumerate(motion.turns_deg, 1)
            if turn > TURN_DEG
        )
    else:
        yield f"`axis: rot`: the hand turns in place, by {OWN_TURN_DEG:.0f} degrees or more"
    for place, alike in enumerate(zip(*(motion.counted(name) for name in motion.agreeing), strict=True), 1):
        if alike[0].short:
            path_length = max(run.path_length for run in alike)
            yield f"move {place} is of {1e3 * path_length:.3g} mm at most: idle? then it is one less"


def _listed(words: Sequence[str], most: int = 4) -> str:
    """Words joined by commas, with the number of those left out."""
    more = f" and {len(words) - most} more" if len(words) > most else ""
    return ", ".join(words[:most]) + more
