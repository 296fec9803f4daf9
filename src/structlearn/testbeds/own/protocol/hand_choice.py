"""Which of the sources of poses is the hand's."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from structlearn.recordings.topics import JointPose, TransformPose
from structlearn.rigid_body.urdf import HANDS
from structlearn.testbeds.own.protocol.hand_paths import HandPath
from structlearn.testbeds.own.protocol.inspection import FileSeen, PoseSource

LEAST_EXTENT = {"m": 0.01, "rad": 0.05}
"""How far a hand, or an arm's joints, get at least: less is sway."""

ALIKE = 0.9
"""Share of the largest way from which on frames of one tree move alike: then the likeliest name is taken."""


@dataclass(frozen=True)
class Candidate:
    """A source of poses over all files.

    Attributes:
        source: it.
        paths: by name of the file.
        extent: median over the files of how far it gets, m or rad.
        travelled: likewise of its way.
    """

    source: PoseSource
    paths: dict[str, HandPath]
    extent: float
    travelled: float

    @property
    def unit(self) -> str:
        """m, or rad where joints stand in for the hand."""
        return next(iter(self.paths.values())).unit

    @property
    def moves(self) -> bool:
        """Whether it is more than sway."""
        return self.extent >= LEAST_EXTENT[self.unit]

    @property
    def words(self) -> str:
        """What it is; while the robot is not known, its joints."""
        if isinstance(self.source, JointPose) and self.unit == "rad":
            return f"joints in {self.source.topic}"
        return pose_words(self.source)


def pose_words(source: PoseSource) -> str:
    """A source of poses in words."""
    if isinstance(source, str):
        return source
    if isinstance(source, TransformPose):
        return f"{source.parent} -> {source.child} in {source.topic}"
    return f"{source.tip} by the joints in {source.topic}"


def candidates(files: Sequence[FileSeen]) -> list[Candidate]:
    """All sources of poses that have a path in some file, the likeliest for the hand's first.

    One that moves, in most of the files, comes before all others; then topics of poses before transforms and
    those before joints; then what is in more files; then frames that are called like a hand; then what goes
    the longer way.
    """
    found: dict[PoseSource, dict[str, HandPath]] = {}
    for file in files:
        for source, path in file.hands.items():
            found.setdefault(source, {})[file.name] = path
    every = [
        Candidate(
            source,
            paths,
            float(np.median([path.extent_m for path in paths.values()])),
            float(np.median([path.travelled_m for path in paths.values()])),
        )
        for source, paths in found.items()
    ]
    return sorted(every, key=lambda one: _rank(one, every, len(files)))


def _rank(one: Candidate, every: Sequence[Candidate], files: int) -> tuple:
    """Small is likely; the order in which sources of one kind were found, by their names, breaks ties."""
    kind = _kind(one.source)
    farthest = max(other.travelled for other in every if _kind(other.source) == kind)
    way = farthest if kind and one.travelled >= ALIKE * farthest else one.travelled
    named = isinstance(one.source, TransformPose) and HANDS.search(one.source.child)
    return not (one.moves and 2 * len(one.paths) > files), kind, -len(one.paths), not named, -way


def _kind(source: PoseSource) -> int:
    return 0 if isinstance(source, str) else 1 if isinstance(source, TransformPose) else 2
