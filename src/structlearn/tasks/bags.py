"""The reader `bags`: what a robot recorded, in files of any format that `readers.bag_files` knows."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from structlearn.readers import Recording, read_recordings, synchronise
from structlearn.readers.joint_log import JointLog, read_joint_logs
from structlearn.readers.touch_log import TouchLog, read_touch_table, touch_of, touch_tables


def read_movement(folder: Path, entry: Any, left_out: dict[str, str]) -> list[Recording]:
    """Recordings with the signals of the entry's topics."""
    return read_recordings(folder, entry.topics, entry.stamps)


def read_motion(folder: Path, entry: Any, left_out: dict[str, str]) -> Sequence[JointLog]:
    """Logs of the joints that the entry's URDF has."""
    from structlearn.tasks.motion.joint_motion import arm_of

    robot, _ = arm_of(entry)
    return read_joint_logs(folder, entry.topic, robot.tree.names, entry.stamps)


def read_obstacles(folder: Path, entry: Any, left_out: dict[str, str]) -> list[Recording]:
    """Reaches of a folder, or of its sub-folders, one per person; else each is a person of its own."""
    inside = sorted(folder.iterdir()) if folder.is_dir() else []
    people = [path for path in inside if path.is_dir() and not path.name.startswith(".")]
    people = [path for path in people if not (path / "metadata.yaml").exists()]  # those are bags
    found = []
    for one in people or [folder]:
        for reach in read_recordings(one, entry.topics, entry.stamps):
            name, person = (f"{one.name} {reach.name}", one.name) if people else (reach.name, reach.name)
            found.append(replace(reach, name=name, provenance={**reach.provenance, "person": person}))
    return found


def read_touch(folder: Path, entry: Any, left_out: dict[str, str]) -> Sequence[TouchLog | Recording]:
    """Tables of touches, or else bags with a tactile signal and the pose of what touches."""
    logs = [log for path in touch_tables(folder) for log in read_touch_table(path, entry.channels)]
    if logs:
        return logs
    recordings = read_recordings(folder, entry.topics, entry.stamps)
    if entry.over_time:
        return recordings
    return [touch_of(synchronise(one, **entry.clock.model_dump())) for one in recordings]
