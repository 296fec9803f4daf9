"""Whether demonstrations are fit to be learned from: questions, each with a verdict and its number.

Nothing has been configured yet, so bounds are those of the readers and of the method where they have one, and
else rules of thumb with their reason beside them. A doubtful answer is no obstacle; it says where to look.
"""

from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np

from structlearn.readers.clock import MAX_GAP_S
from structlearn.readers.recording import NORM_TOLERANCE
from structlearn.readers.survey import Stamps
from structlearn.tasks.inspection.hand_paths import Candidate, PoseSource
from structlearn.tasks.inspection.motion_survey import MotionSurvey
from structlearn.tasks.inspection.source_survey import FileSeen, SourceSeen, arm_of, clocks_of, series_of

Verdict = Literal["yes", "doubtful", "no"]
Bounds = tuple[float, float]
"""Yes up to (or from) the first, doubtful up to (or from) the second."""

ENOUGH = (5, 2)
"""Demonstrations: one has nothing to be compared with; of fewer than five, the mean error of those that are
left out has an interval as wide as itself."""

EXTENT_M = (0.05, 0.01)
"""How far the hand gets: below a centimetre sway and movement are of one size."""

FARTHEST_M = 10.0
"""m; no arm and no hand that shows it a movement gets so far."""

RATES_HZ = (50.0, 20.0)
"""Hz, of the poses: people's moves have nothing above 5 Hz, and derivatives want ten samples of that."""

IN_STEP_S = (0.02, 0.1)
"""s, by which clocks differ: at 0.5 m/s that is 10 and 50 mm between what two topics say of one moment."""

DISORDERED = (0.0, 0.01)
"""Share of stamps that do not come after the one before: none, or so few that to drop them harms nothing."""

ELSEWHERE, ELSEWHERE_RAD = 0.5, 1.0
"""Share of how far the hand gets, and rad, by which it starts off the others: rather it is another frame."""

MOST_TURNED = 4.0 * np.pi
"""rad, of a joint: only those that wind go further, and all that are in degrees."""


class Answer(NamedTuple):
    """One question about the recordings, to which yes is good, the number it rests on, and what to do."""

    question: str
    verdict: Verdict
    number: str
    advice: str = ""


def at_least(value: float, bounds: Bounds) -> Verdict:
    """NaN is no."""
    return "yes" if value >= bounds[0] else "doubtful" if value >= bounds[1] else "no"


def at_most(value: float, bounds: Bounds) -> Verdict:
    """NaN is no."""
    return at_least(-value, (-bounds[0], -bounds[1]))


def fitness(
    seen: SourceSeen, hand: Candidate | None, motion: MotionSurvey | None, topics: Sequence[str]
) -> list[Answer]:
    """All questions that can be asked of the files.

    `hand`: whose poses are taken for the hand's; `motion`: its runs, None where it does not move; `topics`:
    which are to be read.
    """
    count, total = len(seen.files), len(seen.files) + len(seen.damaged)
    readable: Verdict = "doubtful" if seen.damaged else "yes"
    more = "" if count >= ENOUGH[0] else f"record {ENOUGH[0]} or more"
    answers = [
        Answer("Can all files be read?", readable, f"{count} of {total}", "; ".join(seen.damaged.values())),
        Answer("Are there enough demonstrations?", at_least(count, ENOUGH), str(count), more),
    ]
    if hand is None:
        answers.append(_no_hand(seen))
    else:
        answers += _of_hand(seen, hand)
    if motion is not None:
        agree, others = len(motion.agreeing), [name for name in motion.runs if name not in motion.agreeing]
        verdict: Verdict = "no" if 2 * agree <= len(motion.runs) else "doubtful" if others else "yes"
        number = f"{motion.number} in {agree} of {len(motion.runs)}, above {motion.threshold:.2g} m/s"
        advice = "; ".join(f"{name} has {len(motion.counted(name))}" for name in others)
        answers.append(Answer("Do runs of motion agree in number?", verdict, number, advice))
    answers += _of_signals(seen.files, topics)
    if hand is not None and clocks_of(seen.files, topics):
        answers += _of_clocks(seen.files, topics, hand.source)
    return answers


def _no_hand(seen: SourceSeen) -> Answer:
    types = {name for file in seen.files for one in file.topics.values() for name in one.types}
    foreign = sorted(name for name in types if "[" in name)  # an encoding that is not read, see `bag`
    advice = f"convert to ROS 2 messages, or to a table of poses: {'; '.join(foreign)}" if foreign else ""
    if arms := [arm for file in seen.files if (arm := arm_of(file.topics))]:
        topic, joints = arms[0]
        advice = f"there are joints in {topic} ({', '.join(joints.names)}): name their robot, URDF=..."
    return Answer("Is there a pose of the hand?", "no", "no poses or moving frames that can be read", advice)


def _of_hand(seen: SourceSeen, hand: Candidate) -> Iterator[Answer]:
    paths = hand.paths
    if missing := [file.name for file in seen.files if file.name not in paths]:
        reasons = [file.no_hands[hand.source] for file in seen.files if hand.source in file.no_hands]
        number = f"{hand.words}: {len(paths)} of {len(seen.files)}"
        advice = "; ".join(reasons) or f"not in {', '.join(missing)}"
        yield Answer("Does every file have the hand's pose?", "no", number, advice)
    least = min(paths, key=lambda name: paths[name].extent_m)
    verdict = at_least(paths[least].extent_m, EXTENT_M)
    advice = "" if verdict == "yes" else f"look at {least}"
    if hand.extent > FARTHEST_M:
        verdict, advice = "doubtful", "positions are read as m; were they written in mm?"
    number = f"{1e3 * hand.extent:.4g} mm in the median, least {1e3 * paths[least].extent_m:.4g} mm"
    yield Answer("Does the hand move in all?", verdict, number, advice)
    worst = max(paths, key=lambda name: paths[name].norm_error)
    off = paths[worst].norm_error
    sound = off <= NORM_TOLERANCE
    advice = "" if sound else f"look at {worst}: the reader refuses more than {NORM_TOLERANCE:g}"
    number = f"off by {off:.1g} at most"
    yield Answer("Are quaternions of unit norm?", "yes" if sound else "no", number, advice)
    faults = [f"{name}: {path.fault}" for name, path in paths.items() if path.fault]
    number = f"{len(paths) - len(faults)} of {len(paths)}"
    yield Answer("Are poses free of jumps?", "no" if faults else "yes", number, "; ".join(faults))
    if hand.moves and len(paths) > 1:
        yield _alike(hand)


def _alike(hand: Candidate) -> Answer:
    """Whether it starts in one place; what is in another frame is as smooth as the others."""
    names, paths = zip(*hand.paths.items(), strict=True)
    starts = np.stack([path.position[0] for path in paths])
    away = np.median(np.linalg.norm(starts[:, None] - starts, axis=2), axis=1)
    turned = np.zeros(len(paths))
    if all(path.orientation is not None for path in paths):
        turns = np.stack([path.orientation[0] for path in paths])
        turned = np.median(2.0 * np.arccos(np.minimum(np.abs(turns @ turns.T), 1.0)), axis=1)
    odd = (away > ELSEWHERE * hand.extent) | (turned > ELSEWHERE_RAD)
    listed = ", ".join(name for name, one in zip(names, odd, strict=True) if one)
    number = f"off the others by {1e3 * away.max():.3g} mm and {turned.max():.2g} rad at most"
    advice = f"another frame, or order of quaternions? look at {listed}" if listed else ""
    return Answer("Does the hand start alike?", "doubtful" if listed else "yes", number, advice)


def _of_signals(files: Sequence[FileSeen], topics: Sequence[str]) -> Iterator[Answer]:
    read = {
        f"{topic} in {file.name}": file.topics[topic]
        for file in files
        for topic in topics
        if topic in file.topics
    }
    if read:
        frozen = [where for where, one in read.items() if one.frozen]
        advice = f"always the same: {', '.join(frozen)}" if frozen else ""
        number = f"{len(read) - len(frozen)} of {len(read)}"
        yield Answer("Do all signals change?", "doubtful" if frozen else "yes", number, advice)
    turned = {
        where: float(np.abs(joints.values["joint_positions"]).max())
        for where, one in read.items()
        for joints in one.joints
        if "joint_positions" in joints.values
    }
    if turned:
        largest = max(turned, key=turned.__getitem__)
        sound = turned[largest] <= MOST_TURNED
        advice = "" if sound else f"degrees? look at {largest}"
        number = f"to {turned[largest]:.3g}"
        yield Answer("Are joints' positions in rad?", "yes" if sound else "doubtful", number, advice)


def _of_clocks(files: Sequence[FileSeen], topics: Sequence[str], pose: PoseSource) -> Iterator[Answer]:
    clocks = clocks_of(files, topics)
    stamped = {topic for _, topic, one in clocks if one.header}
    names = sorted({topic for _, topic, _ in clocks})
    without = [topic for topic in names if topic not in stamped]
    number = f"{len(names) - len(without)} of {len(names)} topics have header stamps"
    advice = f"the log time stands in for {', '.join(without)}" if without else ""
    yield Answer("Do messages say when they were taken?", "doubtful" if without else "yes", number, advice)
    if stamped:
        off, where = max((out_of_step(file, topics), file.name) for file in files)
        verdict = at_most(off, IN_STEP_S)
        advice = "" if verdict == "yes" else f"look at {where}: delays of topics differ, or drift"
        yield Answer("Are the clocks in step?", verdict, f"to {1e3 * off:.3g} ms", advice)
    series = series_of(files, topics, pose)
    name, topic, one = max(series, key=lambda item: _disorder(item[2]))
    share = _disorder(one)
    number = f"all but {share:.2g} of them" if share else "all do"
    advice = f"in {name}, {topic}, {one.repeated} repeat and {one.backward} run back" if share else ""
    yield Answer("Do stamps increase?", at_most(share, DISORDERED), number, advice)
    name, topic, one = max(series, key=lambda item: np.nan_to_num(item[2].largest_gap_s, nan=np.inf))
    whole = one.largest_gap_s <= MAX_GAP_S
    advice = "" if whole else f"in {name}, {topic}, at {one.gap_at_s:.3g} s; `clock: {{max_gap_s: ...}}`"
    number = f"largest {one.largest_gap_s:.3g} s"
    yield Answer("Are streams without gaps?", "yes" if whole else "no", number, advice)
    name, topic, one = min(series, key=lambda item: np.nan_to_num(item[2].rate_hz, nan=0.0))
    verdict = at_least(one.rate_hz, RATES_HZ)
    advice = "" if verdict == "yes" else f"in {name}, {topic}"
    yield Answer("Are topics fast enough?", verdict, f"slowest {one.rate_hz:.4g} Hz", advice)


def _disorder(stamps: Stamps) -> float:
    """Share of stamps that do not come after the one before."""
    return (stamps.repeated + stamps.backward) / stamps.count


def out_of_step(file: FileSeen, topics: Sequence[str]) -> float:
    """By how much the clocks of topics of a file differ in s: their delays among each other, or one's drift.

    A delay that all share harms nobody: what comes from one clock is in step with itself.
    """
    delays = [one.delay for _, _, one in clocks_of([file], topics) if one.delay]
    if not delays:
        return 0.0
    medians = [delay.median_s for delay in delays]
    return max(max(medians) - min(medians), *(abs(delay.drift_s) for delay in delays))
