"""Whether demonstrations are fit for learning: questions, each with a verdict and its number.

Nothing is configured yet, so bounds are those of the readers and the method where they have one, and
otherwise rules of thumb with their reasons beside them. A doubtful answer is no obstacle, but says where to
look.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np

from structlearn.readers.clock import MAX_GAP_S
from structlearn.readers.source import JointPose
from structlearn.tasks.inspection.hand_motion import (
    HandCandidate,
    JointMotion,
    MotionSurvey,
    PoseSource,
    pose_words,
)
from structlearn.tasks.inspection.judgement import reasons
from structlearn.tasks.inspection.source_survey import SourceSeen

HAND = "Is there a pose of the hand?"

Verdict = Literal["yes", "doubtful", "no"]

# Bounds: yes from (or up to) the first, doubtful from (or up to) the second.
# Demonstrations: a single one cannot be compared; with fewer than five, the mean error of those left out has
# an interval as wide as itself.
ENOUGH = (5, 2)
EXTENT_M = (0.05, 0.01)  # extent of the hand's motion: below 1 cm, sway and movement are of similar size
RATES_HZ = (50.0, 20.0)  # of poses: human movement reaches 5 Hz, and derivatives need ten samples per period
# Difference between clocks in s: at 0.5 m/s, 10 and 50 mm between two topics at one moment
IN_STEP_S = (0.02, 0.1)
# Share of stamps not later than the one before: none, or so few that dropping them is harmless
DISORDERED = (0.0, 0.01)
FARTHEST_M = 10.0  # beyond the reach of any arm or demonstrating hand
MOST_TURNED = 4.0 * np.pi  # rad, of a joint; exceeded only by winding joints and by angles in degrees


class Answer(NamedTuple):
    """A question about the recordings, the number behind its verdict, and advice unless it is yes."""

    question: str
    verdict: Verdict
    number: str
    advice: str = ""


def at_least(value: float, bounds: tuple[float, float]) -> Verdict:
    """Verdict for a lower bound; NaN is no."""
    return "yes" if value >= bounds[0] else "doubtful" if value >= bounds[1] else "no"


def at_most(value: float, bounds: tuple[float, float]) -> Verdict:
    """Verdict for an upper bound; NaN is no."""
    return at_least(-value, (-bounds[0], -bounds[1]))


def fitness(
    seen: SourceSeen,
    hand: HandCandidate | None,
    motion: MotionSurvey | None,
    topics: Sequence[str],
    repeats: int = 0,
    refused: Mapping[str, str] | None = None,
) -> Iterator[Answer]:
    """Answers to all questions that apply to the files.

    `hand`: source of the hand's poses; `motion`: its runs, None if it does not move; `topics`: topics to
    read; `repeats`: of the task in all files, if each has several; `refused`: reasons of the import by file.
    """
    refused = seen.damaged if refused is None else refused
    total = len(seen.files) + len(seen.damaged)
    count = total - len(refused)
    readable: Verdict = "yes" if not refused else "doubtful" if count else "no"
    yield Answer("Can all files be read?", readable, f"{count} of {total}", reasons(refused.values()))
    enough = at_least(repeats or count, ENOUGH)
    number = f"{repeats} repeats in {count}" if repeats else str(count)
    yield Answer("Are there enough demonstrations?", enough, number, f"record {ENOUGH[0]} or more")
    if hand is None:
        yield _no_hand(seen)
    else:
        yield from _of_hand(seen, hand)
    if motion is not None and not repeats:
        others = {name: len(motion.counted(name)) for name in motion.runs if name not in motion.agreeing}
        agree, total = len(motion.agreeing), len(motion.runs)
        verdict: Verdict = "no" if 2 * agree <= total else "doubtful" if others else "yes"
        unit = "" if hand is not None and isinstance(hand.source, JointMotion) else " m/s"
        number = f"{motion.number} in {agree} of {total}, above {motion.threshold:.2g}{unit}"
        advice = "; ".join(f"{name} has {runs}" for name, runs in others.items())
        yield Answer("Do runs of motion agree in number?", verdict, number, advice)
    turned = [
        (float(np.abs(joints.values["joint_positions"]).max()), f"{topic} in {file}")
        for file, topic, present in seen.on(topics)
        for joints in present.joints
        if "joint_positions" in joints.values
    ]
    if turned and not (hand and isinstance(hand.source, JointPose) and hand.source.units):
        largest, where = max(turned, key=lambda item: item[0])
        verdict = "yes" if largest <= MOST_TURNED else "doubtful"
        question, advice = "Are joints' positions in rad?", f"degrees? look at {where}"
        yield Answer(question, verdict, f"to {largest:.3g}", advice)
    if hand is not None and seen.clocks(topics):
        yield from _of_clocks(seen, topics, hand.source)


def _no_hand(seen: SourceSeen) -> Answer:
    types = {name for file in seen.files for one in file.topics.values() for name in one.types}
    foreign = sorted(name for name in types if "[" in name)  # unsupported encodings, see `raw_messages`
    advice = f"convert to ROS 2 messages, or to a table of poses: {'; '.join(foreign)}" if foreign else ""
    for topic, joints in seen.arms()[:1]:
        advice = f"there are joints in {topic} ({', '.join(joints.names)}): name their robot: --urdf FILE"
    if unusable := [reason for file in seen.files for reason in file.faults()]:
        advice = reasons(unusable)
    return Answer(HAND, "no", "no poses or moving frames that can be read", advice)


def _of_hand(seen: SourceSeen, hand: HandCandidate) -> Iterator[Answer]:
    paths = hand.paths
    if missing := [file for file in seen.files if file.name not in paths]:
        reasons = [file.no_hands[hand.source] for file in missing if hand.source in file.no_hands]
        advice = "; ".join(reasons) or f"not in {', '.join(file.name for file in missing)}"
        number = f"{pose_words(hand.source)}: {len(paths)} of {len(seen.files)}"
        yield Answer("Does every file have the hand's pose?", "no", number, advice)
    name, least = min(((name, path.extent_m) for name, path in paths.items()), key=lambda item: item[1])
    verdict, advice = at_least(least, EXTENT_M), f"look at {name}"
    joints = isinstance(hand.source, JointMotion)
    if hand.extent > FARTHEST_M and not joints:
        verdict, advice = "doubtful", "positions are read as m; were they written in mm?"
    number = f"{1e3 * hand.extent:.4g} mm in the median, least {1e3 * least:.4g} mm"
    if joints:
        number = f"{hand.extent:.4g} in the median, least {least:.4g}; there is no pose of the hand"
    question = "Do the joints move in all?" if joints else "Does the hand move in all?"
    yield Answer(question, verdict, number, advice)


def _of_clocks(seen: SourceSeen, topics: Sequence[str], pose: PoseSource) -> Iterator[Answer]:
    clocks = seen.clocks(topics)
    stamped, names = {topic for _, topic, pair in clocks if pair.header}, {topic for _, topic, _ in clocks}
    without = ", ".join(sorted(names - stamped))
    number, words = (
        f"{len(stamped)} of {len(names)} topics have header stamps",
        f"the log time stands in for {without}",
    )
    verdict: Verdict = "doubtful" if without else "yes"
    yield Answer("Do messages say when they were taken?", verdict, number, words)
    if stamped:
        off, name = out_of_step(seen, topics)
        advice = f"look at {name}: delays of topics differ"
        yield Answer("Are the clocks in step?", at_most(off, IN_STEP_S), f"to {1e3 * off:.3g} ms", advice)
    series = seen.series(topics, pose)
    name, topic, stamps = max(series, key=lambda item: item[2].disorder)
    number = f"all but {stamps.disorder:.2g} of them" if stamps.disorder else "all do"
    advice = f"in {name}, {topic}, {stamps.repeated} repeat and {stamps.backward} run back"
    yield Answer("Do stamps increase?", at_most(stamps.disorder, DISORDERED), number, advice)
    name, topic, stamps = max(series, key=lambda item: np.nan_to_num(item[2].largest_gap_s, nan=np.inf))
    verdict = at_most(stamps.largest_gap_s, (MAX_GAP_S, MAX_GAP_S))
    advice = f"in {name}, {topic}, at {stamps.gap_at_s:.3g} s; `clock: {{max_gap_s: ...}}`"
    yield Answer("Are streams without gaps?", verdict, f"largest {stamps.largest_gap_s:.3g} s", advice)
    name, topic, stamps = min(series, key=lambda item: np.nan_to_num(item[2].rate_hz, nan=0.0))
    verdict, number = at_least(stamps.rate_hz, RATES_HZ), f"slowest {stamps.rate_hz:.4g} Hz"
    yield Answer("Are topics fast enough?", verdict, number, f"in {name}, {topic}")


def out_of_step(seen: SourceSeen, topics: Sequence[str]) -> tuple[float, str]:
    """Largest difference in s between the delays of a file's topics, and that file; common delays cancel."""
    lags = [(0.0, "")]
    for file in seen.files:
        delays = [pair.delay_s for name, _, pair in seen.clocks(topics) if name == file.name and pair.header]
        if delays:
            lags.append((float(np.ptp(delays)), file.name))
    return max(lags)
