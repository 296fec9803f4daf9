"""Report on unconfigured recordings as text: `structlearn inspect ~/bags`.

Says what the files hold and whether they are fit for learning, and proposes a task entry.
"""

from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from structlearn.core.artefacts import publish
from structlearn.core.errors import printable
from structlearn.readers.messages import FIELDS
from structlearn.tasks.inspection.clocks import TopicClocks, stamp_statistics
from structlearn.tasks.inspection.fitness import HAND, Answer, fitness
from structlearn.tasks.inspection.hand_motion import (
    BRIDGE_S,
    HandCandidate,
    JointMotion,
    MotionRun,
    MotionSurvey,
    hand_candidates,
    pose_words,
    survey_motion,
)
from structlearn.tasks.inspection.judgement import judge, reasons
from structlearn.tasks.inspection.lerobot_survey import look_at_dataset
from structlearn.tasks.inspection.proposal import LEROBOT, Proposal, judged, propose
from structlearn.tasks.inspection.source_survey import FileSeen, SourceSeen, look_at, with_joints
from structlearn.tasks.inspection.task_moves import task_moves, uncut

FORMATS = {"mcap": "MCAP", "db3": "ROS 2 bag (sqlite3)", "bag": "ROS 1 bag", "table": "table of poses"}
FORMATS[LEROBOT] = "LeRobotDataset"

HEADINGS = ("topic", "type", "messages", "rate", "largest gap", "clock", "log - header")
RIGHT = (2, 3, 4, 6)  # columns of numbers
SECONDS_OF_A_YEAR = 3.2e7


class SourceReport(NamedTuple):
    """Contents of a source, and conclusions."""

    seen: SourceSeen
    sources: Sequence[HandCandidate]  # of poses; the first is taken as the hand's
    motion: MotionSurvey | None  # None: the hand does not move
    proposal: Proposal | None  # None: nothing could be the hand's pose, or the import refuses everything
    answers: Sequence[Answer]
    refused: Mapping[str, str]  # reasons of the import by recording; without a proposal, of damaged files

    @property
    def obstacle(self) -> str:
        """Why there is no proposal."""
        if self.sources:
            return f"the import refuses every recording: {reasons(self.refused.values())}"
        damaged = [f"{file}: {reason}" for file, reason in self.refused.items()]
        advice = [answer.advice for answer in self.answers if answer.question == HAND and answer.advice]
        why = reasons([*damaged, *advice])
        return "no stream could be the pose of a hand" + (f": {why}" if why else "")


def inspect_source(source: str, urdf: str | None, output: Path | None) -> None:
    """Print a report on a source; publish the proposed entry if `output` is given."""
    report = find_out(source, urdf)
    print("\n".join(printable(line).rstrip() for line in report_lines(report)))
    if output is not None and report.proposal is not None:
        with publish(output) as path:
            path.write_text("\n".join(as_yaml(report.proposal)) + "\n", encoding="utf-8")


def find_out(source: str, urdf: str | None = None) -> SourceReport:
    """Survey a source (see `look_at`), its motion and fitness, and propose an entry."""
    seen = look_at_dataset(source, urdf) or look_at(source, urdf)
    candidates = hand_candidates({file.name: file.hands for file in seen.files})
    if not candidates and urdf is None and not any(file.no_hands for file in seen.files):
        seen = seen._replace(files=tuple(map(with_joints, seen.files)))
        candidates = hand_candidates({file.name: file.hands for file in seen.files})
    if not candidates:
        return SourceReport(seen, (), None, None, list(fitness(seen, None, None, ())), seen.damaged)
    hand, *others = candidates
    motion = survey_motion(hand.paths) if hand.moves else None
    moves = task_moves(hand.paths, motion)
    proposal = propose(seen, hand, others, motion, moves)
    judgement = judge(proposal.entry, {*(file.name for file in seen.files), *seen.damaged})
    refused = {**seen.damaged, **judgement.refused}
    answers = list(fitness(seen, hand, motion, proposal.read, moves.repeats, refused))
    all_refused = len(refused) >= len(seen.files) + len(seen.damaged)
    accepted = None if all_refused else judged(proposal, judgement, uncut(hand.paths, moves))
    return SourceReport(seen, candidates, motion, accepted, answers, refused)


def report_lines(report: SourceReport) -> Iterator[str]:
    """Lines of the whole report."""
    seen = report.seen
    yield from (f"{seen.source}: {len(seen.files)} recording{'s' if seen.files[1:] else ''}", "")
    for number, file in enumerate(seen.files):
        first, *others = _file(file)
        again = number > 0 and file.format == LEROBOT  # with the same features
        yield from (first,) if again else (first, *others, "")
    yield from (f"{name}: left out: {reason}" for name, reason in report.refused.items())
    if report.sources:
        yield "Candidates for the pose of the hand (medians over the files); the first is used"
        rows = [("source", "files", "extent", "way")]
        for source in report.sources:
            unit = "" if isinstance(source.source, JointMotion) else " m"
            sizes = f"{source.extent:.3g}{unit}", f"{source.travelled:.3g}{unit}"
            rows.append((pose_words(source.source), str(len(source.paths)), *sizes))
        yield from (*_aligned(rows, range(1, 4)), "")
    if report.motion is not None:
        unit = "of the joints per s" if isinstance(report.sources[0].source, JointMotion) else "m/s"
        above = f"above {report.motion.threshold:.2g} {unit}, s since the first sample"
        yield f"Runs of motion {above}; dips up to {BRIDGE_S:g} s are joined, short runs are in brackets"
        moves = [(name, f"{len(runs)}", _times(runs)) for name, runs in report.motion.runs.items()]
        yield from (*_aligned(moves, (1,)), "")
    yield "Suitable for learning?"
    answers = [
        (answer.verdict, answer.question, answer.number, "" if answer.verdict == "yes" else answer.advice)
        for answer in report.answers
    ]
    yield from (*_aligned(answers, ()), "")
    if report.proposal is None:
        yield f"No entry can be proposed: {report.obstacle}."
    else:
        yield from ("To paste below `movement:` in structlearn.yaml:", "", *as_yaml(report.proposal))


def as_yaml(proposal: Proposal) -> list[str]:
    """Lines of an entry, indented for `movement:`, with the warnings above each value."""
    lines = [f"  {proposal.name}:", *_entry(proposal.entry, proposal.warnings, "", " " * 4)]
    return [printable(line) for line in lines]  # a line break in a warning would become YAML


def _entry(
    values: Mapping[str, Any], warnings: Mapping[str, Sequence[str]], above: str, indent: str
) -> Iterator[str]:
    for key, value in values.items():
        path = f"{above}{key}"
        yield from (f"{indent}# {warning}" for warning in warnings.get(path, ()))
        if isinstance(value, Mapping) and any(warning.startswith(f"{path}.") for warning in warnings):
            yield f"{indent}{key}:"
            yield from _entry(value, warnings, f"{path}.", f"{indent}  ")
        else:
            flow = yaml.safe_dump(
                [value], default_flow_style=True, width=float("inf"), sort_keys=False, allow_unicode=True
            )
            yield f"{indent}{key}: {flow.strip()[1:-1]}"


def _file(file: FileSeen) -> Iterator[str]:
    logs = [seen.clocks.log for seen in file.topics.values() if seen.clocks]
    start = min((log.first_s for log in logs), default=0.0)
    end = max((log.last_s for log in logs), default=0.0)
    known = start > SECONDS_OF_A_YEAR  # otherwise the clock has an arbitrary start
    when = datetime.fromtimestamp(start, UTC).strftime("%Y-%m-%d %H:%M:%S UTC") if known else f"{start:.2f} s"
    count = sum(log.count for log in logs)
    yield f"{file.name}: {FORMATS[file.format]}, {end - start:.2f} s from {when}, {count} readable messages"
    rows: list[tuple[str, ...]] = [HEADINGS]
    for topic, seen in file.topics.items():
        clock = _clock(seen.clocks) if seen.clocks else [""] * 5
        rows.append((topic, " and ".join(seen.types), *clock))
    yield from _aligned(rows, RIGHT)
    for topic, seen in file.topics.items():
        for joints in seen.joints:
            filled = ", ".join(FIELDS[kind] for kind in joints.values) or "nothing that is filled"
            names = ", ".join(joints.names) or "no names"
            rate = stamp_statistics(joints.stamps).rate_hz
            yield f"  joints in {topic}: {names} ({filled}; {len(joints.stamps)} samples, {rate:.4g} Hz)"
        if seen.fault:
            yield f"  cannot be read: {seen.fault}"
        if seen.links:
            rest = " (static)" if topic.endswith("_static") else " (at rest)"
            links = [f"{link.parent} -> {link.child}{'' if link.moves else rest}" for link in seen.links]
            yield f"  frames in {topic}: {', '.join(links)}"
    yield from (f"  no path of {pose_words(source)}: {reason}" for source, reason in file.no_hands.items())


def _clock(clocks: TopicClocks) -> tuple[str, ...]:
    own, late = clocks.own, clocks.delay_s
    numbers = (f"{own.count}", f"{own.rate_hz:.4g} Hz", f"{own.largest_gap_s:.3g} s")
    if clocks.header is None:
        return (*numbers, "log", "")
    return (*numbers, "header", f"{1e3 * late:.3g} ms" if abs(late) < 1 else f"{late:.3g} s")


def _times(runs: Sequence[MotionRun]) -> str:
    words = [f"{run.start_s:.2f}-{run.end_s:.2f}" for run in runs]
    return ", ".join(f"({word})" if run.short else word for run, word in zip(runs, words, strict=True))


def _aligned(rows: Sequence[Sequence[str]], right: Sequence[int]) -> list[str]:
    """Rows as indented lines with aligned columns; `right`: indices of right-aligned ones."""
    columns = [[printable(cell) for cell in column] for column in zip(*rows, strict=True)]
    for place, column in enumerate(columns):
        width = max(map(len, column))
        columns[place] = [cell.rjust(width) if place in right else cell.ljust(width) for cell in column]
    return ["  " + "  ".join(cells) for cells in zip(*columns, strict=True)]
