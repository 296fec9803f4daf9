"""Survey of the files of a source, as far as it matters for learning from them.

Files are opened one by one; for files that cannot be read the reason is kept, and the others go on.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import product
from typing import Any, NamedTuple

from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.readers.bag_recording import open_bag, read_recording
from structlearn.readers.computed_pose import TransformSeries, transform_series
from structlearn.readers.definitions import short_name
from structlearn.readers.demonstration import Stream
from structlearn.readers.joint_streams import JointSeries, chosen, joint_series
from structlearn.readers.messages import READERS
from structlearn.readers.raw_messages import RawMessages
from structlearn.readers.source import JointPose, StampPolicy, TopicMap, TransformPose
from structlearn.readers.source_files import RecordingFile, recording_files
from structlearn.readers.urdf_file import urdf_path
from structlearn.rigid_body.urdf import HANDS, counterparts, moving_joints, tips
from structlearn.tasks.inspection.clocks import Stamps, TopicClocks, stamp_statistics, topic_clocks
from structlearn.tasks.inspection.hand_motion import HandPath, JointMotion, PoseSource, hand_path
from structlearn.tasks.task_files import local_path

# Disorder is counted elsewhere and accepted here
AS_THEY_COME = StampPolicy(clock="header", disorder="sort")

# Types whose messages are decoded; of others, such as camera images, only the topic is listed
KNOWN = {name for types in READERS.values() for name in types}

# Frames that stand where a robot does: base, base_link, panda_link0, left/ur_base_link
BASES = re.compile(r"(^|[/_])(base|base_link|link_?0)$", re.IGNORECASE)


class TopicSeen(NamedTuple):
    """A topic of a file."""

    types: tuple[str, ...]
    clocks: TopicClocks | None  # None: no readable messages
    joints: Sequence[JointSeries] = ()
    links: Sequence[TransformSeries] = ()
    series: Sequence[Stamps] = ()  # of the joints of the main publisher, or else of the topic
    fault: str = ""  # why joint states or transforms cannot be read


class FileSeen(NamedTuple):
    """A file that could be opened: topics by name, path of each pose source, or why it has none."""

    name: str
    format: str
    topics: Mapping[str, TopicSeen]
    hands: Mapping[PoseSource, HandPath]
    no_hands: Mapping[PoseSource, str]

    def faults(self) -> list[str]:
        """Why topics, or poses from them, cannot be read."""
        return [*self.no_hands.values(), *(seen.fault for seen in self.topics.values() if seen.fault)]


class SourceSeen(NamedTuple):
    """All files of a source in natural order, with the reasons for those that could not be opened."""

    source: str
    urdf: str | None
    files: tuple[FileSeen, ...]
    damaged: Mapping[str, str]

    def on(self, topics: Sequence[str]) -> list[tuple[str, str, TopicSeen]]:
        """File, name and contents of the given topics, where present."""
        every = product(self.files, topics)
        return [(file.name, name, file.topics[name]) for file, name in every if name in file.topics]

    def clocks(self, topics: Sequence[str]) -> list[tuple[str, str, TopicClocks]]:
        """File, topic and clocks of the given topics, where they have messages."""
        return [(file, name, seen.clocks) for file, name, seen in self.on(topics) if seen.clocks]

    def series(self, topics: Sequence[str], pose: PoseSource) -> list[tuple[str, str, Stamps]]:
        """File, topic and stamps of every series on the topics; for transforms, those of the pose."""
        of_pose = {file.name: [file.hands[pose].stamps] for file in self.files if pose in file.hands}
        framed = pose.topic if isinstance(pose, TransformPose) else ""
        return [
            (file, name, stamps)
            for file, name, seen in self.on(topics)
            for stamps in (of_pose.get(file, seen.series) if name == framed else seen.series)
        ]

    def arms(self) -> list[tuple[str, JointSeries]]:
        """`arm_of` each file that has an arm."""
        return [arm for file in self.files if (arm := arm_of(file.topics))]


def look_at(source: str, urdf: str | None = None) -> SourceSeen:
    """Survey every file of a source; `urdf`: of the robot, to compute poses from joints.

    Raises:
        InputError: the source is missing or empty, none of its files can be opened, or the URDF is no robot.
    """
    if urdf and not local_path(urdf).is_file():
        urdf = _shipped(urdf)
    if urdf:
        moving_joints(local_path(urdf))  # reports a wrong file before any bag is opened
    names = recording_files(source)
    seen = parallel_map(partial(_seen, urdf=urdf), names, "recordings")
    files = tuple(found for found in seen if isinstance(found, FileSeen))
    pairs = zip(names, seen, strict=True)
    damaged = {file.name: found for file, found in pairs if isinstance(found, str)}
    if not files:
        first, *others = damaged.values()
        raise InputError(f"{first}{f'; nor can the {len(others)} others be read' if others else ''}")
    return SourceSeen(source, urdf, files, damaged)


def _seen(file: RecordingFile, urdf: str | None) -> FileSeen | str:
    """What is in a file, or why it cannot be opened."""
    try:
        return look_into(file, urdf)
    except InputError as error:
        return str(error)


def _shipped(urdf: str) -> str:
    """Path of a file in `pybullet_data`, which entries may name; other names are unchanged."""
    with suppress(InputError):
        return str(urdf_path(urdf))
    return urdf


def look_into(file: RecordingFile, urdf: str | None = None) -> FileSeen:
    """Survey one file. Raises InputError if it cannot be opened."""
    types = {topic: tuple(map(short_name, names)) for topic, names in open_bag(file, ()).topics.items()}
    messages = open_bag(file, [topic for topic, names in types.items() if KNOWN.issuperset(names)]).messages
    topics = {
        topic: _topic_seen(f"{file.path}: topic '{topic}'", topic, types[topic], messages.get(topic))
        for topic in sorted(types)
    }
    hands, no_hands = {}, {}
    for source in pose_sources(topics, urdf):
        try:
            taken, path = first_path(source, lambda source: hand_path(_poses(file, source)))
            hands[taken] = path
        except InputError as error:
            no_hands[source] = str(error)
    return FileSeen(file.name, file.format, topics, hands, no_hands)


def first_path(source: PoseSource, read: Callable[[PoseSource], HandPath]) -> tuple[PoseSource, HandPath]:
    """Path of a pose source, if need be of its joints in degrees. Raises InputError: of joints in rad."""
    try:
        return source, read(source)
    except InputError:
        if isinstance(source, JointPose):
            in_degrees = source.model_copy(update={"units": "deg"})
            with suppress(InputError):
                return in_degrees, read(in_degrees)
        raise


def arm_of(topics: Mapping[str, TopicSeen]) -> tuple[str, JointSeries] | None:
    """Topic and series with the positions of the most joints on one clock; None if there are none."""
    arms = [(topic, joints) for topic, seen in topics.items() for joints in seen.joints]
    arms = [(topic, joints) for topic, joints in arms if "joint_positions" in joints.values]
    return max(arms, key=lambda arm: len(arm[1].names), default=None)


def with_joints(file: FileSeen) -> FileSeen:
    """The file with the path of its joints themselves, where no pose tells how the hand moves."""
    arm = arm_of(file.topics)
    if arm is None or not arm[1].names:
        return file
    topic, joints = arm
    (stream, *_) = (one for one in joints.streams() if one.kind == "joint_positions")
    source = JointMotion(topic)
    try:
        return file._replace(hands={source: hand_path(stream)})
    except InputError as error:
        return file._replace(no_hands={source: str(error)})


def _topic_seen(where: str, topic: str, names: tuple[str, ...], messages: RawMessages | None) -> TopicSeen:
    if messages is None:
        return TopicSeen(names, None)
    if len(names) > 1:
        return TopicSeen(names, None, fault=f"{where} has messages of several types: {', '.join(names)}")
    clocks = TopicClocks(stamp_statistics(messages.log_times))
    seen = TopicSeen(names, clocks, series=[clocks.own])
    try:
        clocks = topic_clocks(where, messages)
        seen = seen._replace(clocks=clocks, series=[clocks.own])
        if set(names) <= READERS["joint_states"].keys():
            joints, mended = joint_series(where, topic, messages, AS_THEY_COME)
            seen = seen._replace(joints=joints)
            if joints and mended is None:
                kept = chosen(where, joints, None)[0]
                seen = seen._replace(series=[stamp_statistics(part.stamps) for part in kept])
        elif set(names) <= READERS["transforms"].keys():
            transforms = transform_series(where, messages, AS_THEY_COME)
            seen = seen._replace(links=[transforms[edge] for edge in sorted(transforms)])
    except InputError as error:
        seen = seen._replace(fault=str(error))
    return seen


def pose_sources(topics: Mapping[str, TopicSeen], urdf: str | None) -> list[PoseSource]:
    """Possible sources of the hand's pose: topics of poses, then moving frames, then the robot's tip."""
    sources: list[PoseSource] = [
        topic for topic, seen in topics.items() if len(seen.types) == 1 and seen.types[0] in READERS["pose"]
    ]
    for topic, seen in topics.items():
        if seen.links and not topic.endswith("_static"):
            static = topics[f"{topic}_static"].links if f"{topic}_static" in topics else ()
            pairs = frame_pairs(seen.links, static)
            sources += [TransformPose(parent=parent, child=child, topic=topic) for parent, child in pairs]
    if urdf and (arm := arm_of(topics)):
        topic, joints = arm
        names = {}
        if not (ends := tips(local_path(urdf), joints.names)):
            names = counterparts(local_path(urdf), joints.names)
            ends = tips(local_path(urdf), names.values())
        renamed = tuple(names.items())
        sources += [JointPose(urdf=urdf, tip=tip, topic=topic, joints=renamed) for tip in ends[:1]]
    return sources


def frame_pairs(
    moving: Sequence[TransformSeries], static: Sequence[TransformSeries]
) -> list[tuple[str, str]]:
    """Pairs (base, end) of frames, for the ends of the tree whose pose in the base changes.

    The base is the first frame from the root that is named like the base of a robot (`BASES`), since in odom
    or map the hand moves with the robot; without such a name, the last one that only static links lead to,
    since a joint at rest in one recording may move in the next. Frames carried by one that is named like a
    hand are no ends.
    """
    parents = {link.child: link.parent for link in (*static, *moving)}
    children = {link.child for link in moving}
    moves = {link.child for link in moving if link.moves}
    pairs, above = set(), set()
    for end in parents.keys() - set(parents.values()):
        chain = frames_above(end, parents)
        hand = next((place for place, frame in enumerate(chain) if HANDS.search(frame)), 0)
        if moves.intersection(chain[hand:]):
            base = max(place for place, frame in enumerate(chain) if frame in children) + 1
            named = [place for place, frame in enumerate(chain) if BASES.search(frame) and place > hand]
            if named and moves.intersection(chain[hand : named[-1]]):
                base = named[-1]
            pairs.add((chain[base], chain[hand]))
            above |= set(chain[hand + 1 :])
    ends = [pair for pair in pairs if pair[1] not in above]
    return sorted(ends, key=lambda pair: (not HANDS.search(pair[1]), pair[1]))


def frames_above(frame: str, parents: Mapping[str, str]) -> list[str]:
    """A frame and those that carry it, up to the root or, in a cycle of frames, up to the last new one."""
    chain = [frame]
    while chain[-1] in parents and parents[chain[-1]] not in chain:
        chain.append(parents[chain[-1]])
    return chain


def _poses(file: RecordingFile, source: PoseSource) -> Stream:
    assert not isinstance(source, JointMotion)  # which is no pose
    none: dict[str, Any] = dict.fromkeys(("twist", "joints", "wrench", "tool_to_board"))
    topics = TopicMap(pose=source, joint_states=(), tactile=(), **none)
    return next(
        stream for stream in read_recording(file, topics, AS_THEY_COME).streams if stream.kind == "pose"
    )
