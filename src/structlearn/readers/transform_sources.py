"""Whether each transform between two frames has one source, on /tf and /tf_static together."""

from collections.abc import Mapping, Sequence

import numpy as np

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.readers.clock import at_row
from structlearn.readers.computed_pose import Edge, TransformSeries, chain, transform_series
from structlearn.readers.one_source import check_source
from structlearn.readers.raw_messages import RawMessages
from structlearn.readers.source import StampPolicy, TransformPose

SAME = 1e-6  # m and rad


def check_transforms(
    where: str, messages: Mapping[str, RawMessages], pose: TransformPose, policy: StampPolicy
) -> None:
    """Raise InputError if a transform between the frames of a pose has sources that contradict each other.

    Those are: channels or publishers with other values at the same time; a static transform that changes, or
    that is on the other topic with another value; and frames that carry each other.
    """
    places = [f"{where}: topic '{topic}'" for topic in pose.topics]
    moving, static = (
        transform_series(place, messages[topic], policy) if topic in messages else {}
        for place, topic in zip(places, pose.topics, strict=True)
    )
    path = chain(places[0], list(static | moving), pose.parent, pose.child)
    for edge in path:
        name = f"transform from '{edge[0]}' to '{edge[1]}'"
        if edge[::-1] in static or edge[::-1] in moving:
            raise InputError(f"{places[0]}: '{edge[0]}' and '{edge[1]}' are each the parent of the other")
        if edge in static:
            series = static[edge]
            if (changed := differs(series.values, series.values[0])).any():
                row = at_row(int(np.argmax(changed)), series.stamps)
                raise InputError(f"{places[1]}: the static {name} changes at {row}")
            if edge in moving and differs(moving[edge].values, series.values[0]).all():
                raise InputError(f"{where}: the {name} is another one in {' and '.join(pose.topics)}")
        if edge in moving:
            series = moving[edge]
            check_source(f"{places[0]}: {name}", "pose", series.stamps, series.values)
    if pose.topic in messages:
        _check_channels(places[0], messages[pose.topic], path, policy)


def differs(values: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Mask (T,) of poses (T, 7) that are not the same as another one (7,)."""
    far = np.linalg.norm(values[:, :3] - other[:3], axis=1) > SAME
    return far | (quaternion.angle_between(values[:, 3:], other[3:]) > SAME)


def _check_channels(where: str, messages: RawMessages, path: Sequence[Edge], policy: StampPolicy) -> None:
    """Compare the transforms of a path between the channels of their topic."""
    if messages.channels is None:
        return
    parts: dict[Edge, list[TransformSeries]] = {edge: [] for edge in path}
    for channel in np.unique(messages.channels):
        rows = np.flatnonzero(messages.channels == channel).tolist()
        schemas, data = [messages.schemas[row] for row in rows], [messages.data[row] for row in rows]
        own = RawMessages(messages.log_times[rows], schemas, data)
        for edge, series in transform_series(where, own, policy).items():
            if edge in parts:
                parts[edge].append(series)
    for edge, several in parts.items():
        if len(several) > 1:
            stamps = np.concatenate([series.stamps for series in several])
            values = np.vstack([series.values for series in several])
            channels = np.repeat(np.arange(len(several)), [len(series.stamps) for series in several])
            name = f"transform from '{edge[0]}' to '{edge[1]}'"
            order = np.argsort(stamps, kind="stable")
            check_source(f"{where}: {name}", "pose", stamps[order], values[order], channels[order])
