"""Survey of a LeRobotDataset: each episode is a file, each feature of numbers a topic.

A topic's type is the role that its names, or else its own name, suggest: pose, wrench, joint_states, tactile.
Actions are listed only, since they are what was commanded.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from structlearn.core.artefacts import holding
from structlearn.core.errors import InputError
from structlearn.core.params import home_path
from structlearn.readers.clock import NORM_TOLERANCE
from structlearn.readers.computed_pose import joints_to
from structlearn.readers.lerobot import Episode, read_episodes
from structlearn.readers.lerobot_columns import (
    TURN,
    Columns,
    feature_of,
    named_poses,
    selection,
    wrench_columns,
)
from structlearn.readers.lerobot_frames import is_dataset, read_info
from structlearn.readers.source import JointPose
from structlearn.readers.urdf_file import urdf_path
from structlearn.rigid_body.urdf import moving_joints, tips
from structlearn.tasks.inspection.clocks import Stamps, TopicClocks, stamp_statistics
from structlearn.tasks.inspection.hand_motion import PoseSource, hand_path
from structlearn.tasks.inspection.proposal import LEROBOT
from structlearn.tasks.inspection.source_survey import (
    FileSeen,
    SourceSeen,
    TopicSeen,
    arm_of,
    first_path,
    pose_sources,
)
from structlearn.tasks.task_files import local_path

# Columns that count frames, and features that are no signals of the robot
COUNTERS = re.compile(r"timestamp|(.*_)?index|next\..*|.*\bis_(first|last|terminal)|quality\b.*")
ACTION, STATE = re.compile(r"actions?\b"), re.compile(r"state|joint|qpos|position")
HAND = re.compile(r"\b(ee|eef|tcp|hand|tool|cartesian)|end_?effector|pose")
FORCE, TOUCH = re.compile(r"wrench|force|torque|\bft\b"), re.compile(r"tactile|touch|taxel|skin|pressure")


def look_at_dataset(source: str, urdf: str | None = None) -> SourceSeen | None:
    """Survey every episode of a LeRobotDataset; None: the source is none. `urdf`: as in `look_at`.

    Raises InputError: it cannot be read or contradicts itself, or the URDF is no robot.
    """
    folder = home_path(source)
    if not is_dataset(folder):
        return None
    if urdf:
        urdf = str(urdf_path(str(local_path(urdf))))
        moving_joints(urdf)
    left_out, failed = dict[str, str](), dict[str, InputError]()
    with holding(folder, "LeRobotDataset that can be read"):
        info = read_info(folder)
        features = [name for name in info["features"] if _has_numbers(info["features"], name)]
        episodes = read_episodes(folder, info, features, left_out, failed)
        files = tuple(_episode_seen(episode, features, urdf) for episode in episodes)
        if not files:
            raise next(iter(failed.values()))
    return SourceSeen(source, urdf, files, {name: str(error) for name, error in failed.items()})


def _has_numbers(features: Mapping[str, Any], name: str) -> bool:
    try:
        return feature_of(features, name) == name and not COUNTERS.fullmatch(name)
    except InputError:
        return False


def _episode_seen(episode: Episode, features: list[str], urdf: str | None) -> FileSeen:
    topics = {
        name: TopicSeen((str(about.get("dtype")),), None)
        for name, about in episode.features.items()
        if name not in features and not COUNTERS.fullmatch(name)
    }
    clock = stamp_statistics(episode.stamps)
    for feature in features:
        topics |= _topics(episode, feature, clock)
    poses: list[PoseSource] = [topic for topic, seen in topics.items() if seen.types == ("pose",)]
    computed = pose_sources(topics, urdf)
    if urdf and not computed:
        computed = list(_by_order(topics, urdf))
    hands, no_hands = {}, {}
    for source in (*poses, *computed):
        try:
            taken, path = first_path(source, lambda source: hand_path(episode.pose(source)[0]))  # type: ignore[arg-type]
            hands[taken] = path
        except InputError as error:
            no_hands[source] = str(error)
    return FileSeen(episode.name, LEROBOT, dict(sorted(topics.items())), hands, no_hands)


def _topics(episode: Episode, feature: str, clock: Stamps) -> Iterator[tuple[str, TopicSeen]]:
    """A feature as a topic, or the poses among its columns."""
    clocks, series = TopicClocks(clock, clock, 0.0), [clock]
    role = str(episode.features[feature].get("dtype", "numbers"))
    try:
        columns = episode.columns(feature)
    except InputError as error:
        yield feature, TopicSeen((role,), clocks, series=series, fault=str(error))
        return
    if ACTION.match(feature):
        yield feature, TopicSeen(("action",), clocks, series=series)
        return
    poses = list(_poses(episode, feature, columns))
    yield from ((topic, TopicSeen(("pose",), clocks, series=series)) for topic in poses)
    if feature in poses:
        return
    joints = []
    if _is_wrench(feature, columns):
        role = "wrench"
    elif TOUCH.search(feature):
        role = "tactile"
    elif not poses and len(columns.places) > 1 and (columns.names or STATE.search(feature)):
        role, joints = "joint_states", [episode.joints(feature)]
    yield feature, TopicSeen((role,), clocks, joints, series=series)


def _poses(episode: Episode, feature: str, columns: Columns) -> Iterator[str]:
    """Topics of the poses, or else positions, among a feature's columns."""
    ways = named_poses(columns.names)
    for places in ways:
        whole = len(ways) == 1 and (len(places) == 3 + len(TURN) or len(columns.places) == len(places))
        yield feature if whole else selection(columns, places)
    if columns.names or not HAND.search(feature):
        return
    norms = np.linalg.norm(episode.values(columns)[:, 3:], axis=1)
    if len(columns.places) == 3:
        yield feature
    elif len(columns.places) == 7 and (np.abs(norms - 1.0) <= NORM_TOLERANCE).all():
        yield f"{feature}[0:7]"
    elif len(columns.places) > 3:
        yield f"{feature}[0:3]"


def _is_wrench(feature: str, columns: Columns) -> bool:
    try:
        named = wrench_columns(feature, columns) is not columns
    except InputError:
        return False
    return named or bool(FORCE.search(feature))


def _by_order(topics: Mapping[str, TopicSeen], urdf: str) -> Iterator[JointPose]:
    """The robot's tip by recorded joints whose names the URDF lacks, in the order of its joints."""
    if (arm := arm_of(topics)) is None:
        return
    topic, joints = arm
    for tip in tips(urdf, moving_joints(urdf)):
        chain_of_tip = joints_to(local_path(urdf), tip)
        if len(chain_of_tip) <= len(joints.names):
            renamed = tuple(zip(joints.names, chain_of_tip, strict=False))
            yield JointPose(urdf=urdf, tip=tip, topic=topic, joints=renamed)
            return
