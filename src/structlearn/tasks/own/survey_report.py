"""What `make inspect` prints: files, runs of motion, fitness, and an entry to paste."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import groupby
from typing import Any

import yaml

from structlearn.core.errors import printable
from structlearn.readers.joint_series import FIELDS
from structlearn.readers.survey import TopicClocks, stamps_of
from structlearn.tasks.own.protocol.fitness import Answer, fitness
from structlearn.tasks.own.protocol.hand_paths import Candidate, candidates, pose_words
from structlearn.tasks.own.protocol.inspection import FileSeen, SourceSeen, look_at
from structlearn.tasks.own.protocol.motion_survey import (
    BRIDGE_S,
    MotionRun,
    MotionSurvey,
    survey_motion,
)
from structlearn.tasks.own.protocol.proposal import Proposal, propose

FORMATS = {
    "mcap": "MCAP",
    "db3": "ROS 2 bag (sqlite3)",
    "bag": "ROS 1 bag",
    "table": "table of poses",
}

HEADINGS = (
    *("topic", "type", "messages", "rate", "jitter", "largest gap"),
    *("clock", "log - header", "drift", "frame"),
)
RIGHT = (2, 3, 4, 5, 7, 8)
"""Columns of numbers."""

SECONDS_OF_A_YEAR = 3.2e7


@dataclass(frozen=True)
class Findings:
    """What a source holds, and what follows from it.

    Attributes:
        seen: its files.
        sources: of poses, the one that is taken for the hand's first.
        motion: runs of motion of the hand; None where it does not move.
        proposal: an entry of the parameter file; None where nothing could be the hand's pose.
        answers: whether the files are fit to be learned from.
    """

    seen: SourceSeen
    sources: Sequence[Candidate]
    motion: MotionSurvey | None
    proposal: Proposal | None
    answers: Sequence[Answer]


def find_out(source: str, urdf: str | None = None) -> Findings:
    """Look at a source, see `look_at`."""
    seen = look_at(source, urdf)
    found = candidates({file.name: file.hands for file in seen.files})
    if not found:
        return Findings(seen, (), None, None, fitness(seen, None, None, ()))
    hand = found[0]
    motion = survey_motion(hand.paths) if hand.moves else None
    proposal = propose(seen, hand, found[1:], motion)
    return Findings(seen, found, motion, proposal, fitness(seen, hand, motion, proposal.read))


def report(found: Findings) -> str:
    """All of it as text."""
    seen = found.seen
    lines = [f"{seen.source}: {len(seen.files)} recording{'s' if seen.files[1:] else ''}", ""]
    for file in seen.files:
        lines += [*_file(file), ""]
    if seen.damaged:
        lines += [*(f"{name}: left out: {reason}" for name, reason in seen.damaged.items()), ""]
    if found.sources:
        lines += [*_sources(found.sources), ""]
    if found.motion is not None:
        lines += [*_motion(found.sources[0], found.motion), ""]
    answers = [(one.verdict, one.question, one.number, one.advice) for one in found.answers]
    lines += ["Fit to be learned from?", *_indented(_aligned(answers, ())), ""]
    if found.proposal is None:
        lines += ["No entry can be proposed: nothing here could be the pose of a hand."]
    else:
        lines += ["To paste below `movement:` in stages/tasks/own.yaml:", ""]
        lines += as_yaml(found.proposal).splitlines()
    return "\n".join(printable(line).rstrip() for line in lines).rstrip() + "\n"


def as_yaml(proposal: Proposal) -> str:
    """An entry below `movement:`, indented as there, each value with its warnings above it."""
    lines = [f"  {proposal.name}:", *_entry(proposal.entry, proposal.doubts, "", " " * 4)]
    return "\n".join(map(printable, lines)) + "\n"  # a doubt that broke its line would become an entry


def _entry(
    values: Mapping[str, Any], doubts: Mapping[str, Sequence[str]], above: str, indent: str
) -> Iterator[str]:
    for key, value in values.items():
        path = f"{above}{key}"
        yield from (f"{indent}# {doubt}" for doubt in doubts.get(path, ()))
        if isinstance(value, Mapping) and any(doubt.startswith(f"{path}.") for doubt in doubts):
            yield f"{indent}{key}:"
            yield from _entry(value, doubts, f"{path}.", f"{indent}  ")
        else:
            yield f"{indent}{key}: {_flow(value)}"


def _flow(value: Any) -> str:
    """A value in one line."""
    inside = yaml.safe_dump([value], default_flow_style=True, width=float("inf"), sort_keys=False)
    return inside.strip()[1:-1]


def _file(file: FileSeen) -> Iterator[str]:
    start, end = file.span_s
    count = sum(seen.clocks.log.count for seen in file.topics.values() if seen.clocks)
    known = start > SECONDS_OF_A_YEAR  # else the clock counts from some start of its own
    when = datetime.fromtimestamp(start, UTC).strftime("%Y-%m-%d %H:%M:%S UTC") if known else f"{start:.2f} s"
    yield f"{file.name}: {FORMATS[file.file.format]}, {end - start:.2f} s from {when}, {count} messages"
    rows: list[tuple[str, ...]] = [HEADINGS]
    for topic, seen in file.topics.items():
        rows.append((topic, seen.type, *(_clock(seen.clocks) if seen.clocks else ("0", *[""] * 7))))
    yield from _indented(_aligned(rows, RIGHT))
    for topic, seen in file.topics.items():
        for joints in seen.joints:
            filled = ", ".join(FIELDS[kind] for kind in joints.values) or "nothing that is filled"
            names = ", ".join(joints.names) or "no names"
            rate = stamps_of(joints.stamps).rate_hz
            yield f"  joints in {topic}: {names} ({filled}; {len(joints.stamps)} samples, {rate:.4g} Hz)"
        if seen.fault:
            yield f"  cannot be read: {seen.fault}"
        if seen.links:
            still = "static" if topic.endswith("_static") else "at rest"
            links = [
                f"{link.parent} -> {link.child}{'' if link.moves else f' ({still})'}" for link in seen.links
            ]
            yield f"  frames in {topic}: {', '.join(links)}"
    for source, reason in file.no_hands.items():
        yield f"  no path of {pose_words(source)}: {reason}"


def _clock(clocks: TopicClocks) -> tuple[str, ...]:
    own, delay = clocks.own, clocks.delay
    numbers = (f"{own.count}", f"{own.rate_hz:.4g} Hz", _ms(own.jitter_s), f"{own.largest_gap_s:.3g} s")
    if delay is None:
        return (*numbers, "log", "", "", ", ".join(clocks.frames))
    spread = f"{_ms(delay.median_s)} +- {_ms(delay.spread_s)}"
    return (*numbers, "header", spread, _ms(delay.drift_s), ", ".join(clocks.frames))


def _ms(seconds: float) -> str:
    return f"{round(1e3 * seconds, 3) + 0.0:.3g} ms" if abs(seconds) < 1 else f"{seconds:.3g} s"


def _sources(sources: Sequence[Candidate]) -> Iterator[str]:
    yield "What may be the pose of the hand (medians over the files); the first is taken"
    rows = [("source", "files", "extent", "way", "largest speed")]
    for one in sources:
        peak = max(path.peak_m_s for path in one.paths.values())
        sizes = (
            f"{one.extent:.3g} m",
            f"{one.travelled:.3g} m",
            f"{peak:.3g} m/s",
        )
        rows.append((one.words, str(len(one.paths)), *sizes))
    yield from _indented(_aligned(rows, range(1, 5)))


def _motion(hand: Candidate, motion: MotionSurvey) -> Iterator[str]:
    yield (
        f"Runs of motion of {hand.words}, s since its first sample; dips up to {BRIDGE_S:g} s are joined, "
        "short runs stand in brackets"
    )
    rows = [("", "above, m/s", "runs", "")]
    for name, tried in motion.runs.items():
        alike = groupby(range(len(tried)), key=lambda place: [run.short for run in tried[place]])
        for number, (_, group) in enumerate(alike):
            places = list(group)
            chosen = motion.chosen in places
            low, high = (f"{motion.thresholds[place]:.2g}" for place in (places[0], places[-1]))
            rows.append(
                (
                    "" if number else name,
                    low if low == high else f"{low} - {high}",
                    f"{len(tried[places[0]])} {'*' if chosen else ' '}",
                    ", ".join(_run(run) for run in tried[motion.chosen if chosen else places[0]]),
                )
            )
    yield from _indented(_aligned(rows, (2,)))
    threshold = f"{motion.thresholds[motion.chosen]:.2g} m/s"
    yield f"  * with times at {threshold}, where most demonstrations agree"


def _run(run: MotionRun) -> str:
    times = f"{run.start_s:.2f}-{run.end_s:.2f}"
    return f"({times})" if run.short else times


def _aligned(rows: Sequence[Sequence[str]], right: Sequence[int]) -> list[str]:
    """Rows as lines whose columns stand below each other."""
    rows = [[printable(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.rjust(width) if place in right else cell.ljust(width)
            for place, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def _indented(lines: Sequence[str]) -> Iterator[str]:
    return (f"  {line}" for line in lines)
