"""Whether demonstrations are fit to be learned from: questions, each with a verdict and its number.

Nothing has been configured yet, so bounds are those of the readers and of the method where they have one, and
else rules of thumb with their reason beside them. A doubtful answer is no obstacle; it says where to look.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from structlearn.ground.errors import InputError
from structlearn.recordings.checks import NORM_TOLERANCE
from structlearn.recordings.clock import MAX_GAP_S
from structlearn.recordings.joint_series import JointSeries
from structlearn.recordings.recording import JOINT_KINDS
from structlearn.recordings.survey import Stamps
from structlearn.rigid_body.motion import Motion, joined, joint_ranges, measured_motion
from structlearn.rigid_body.urdf import moving_joints
from structlearn.testbeds.own.protocol.hand_choice import Candidate
from structlearn.testbeds.own.protocol.inspection import (
    FileSeen,
    PoseSource,
    SourceSeen,
    arm_of,
    clocks_of,
    series_of,
)
from structlearn.testbeds.own.protocol.motion_survey import MotionSurvey
from structlearn.testbeds.own.task import local_path

Verdict = Literal["yes", "doubtful", "no"]

ENOUGH = (5, 2)
"""Demonstrations: one has nothing to be compared with; of fewer than five, the mean error of those that are
left out has an interval as wide as itself."""

EXTENT = {"m": (0.05, 0.01), "rad": (0.2, 0.05)}
"""How far the hand gets, or the arm's joints: below a centimetre sway and movement are of one size."""

FARTHEST_M = 10.0
"""m; no arm and no hand that shows it a movement gets so far."""

OVER_NOISE = (50.0, 10.0)
"""How far the hand gets, over the sensor's noise: at 50 the speed of a move of a second stands ten times
above what is left of the noise behind the low-pass."""

RATES_HZ = (50.0, 20.0)
"""Hz, of the poses: people's moves have nothing above 5 Hz, and derivatives want ten samples of that."""

IN_STEP_S = (0.02, 0.1)
"""s, by which clocks differ: at 0.5 m/s that is 10 and 50 mm between what two topics say of one moment."""

JITTER = (0.5, 1.0)
"""Of a step: half the range of the inner nine tenths of the steps."""

DISORDERED = (0.0, 0.01)
"""Share of stamps that do not come after the one before: none, or so few that to drop them harms nothing."""

ELSEWHERE = {"m": 0.5, "rad": 1.0}
"""Share of how far the hand gets, and rad, by which it starts off the others: rather it is another frame."""

MOST_TURNED = 4.0 * np.pi
"""rad, of a joint: only those that wind go further, and all that are in degrees."""

CONDITIONS = (100.0, 1000.0)
"""Of the base regressor: below 100 counts as well excited (Gautier and Khalil 1992)."""

VELOCITIES, ACCELERATIONS = (0.5, 0.1), (1.0, 0.2)
"""rad/s and rad/s^2, the largest of a joint: where they are smaller friction hides what inertia does."""

EXCITATION_HZ = 5.0
"""Hz, low-pass of joints' signals before velocities are differentiated."""


@dataclass(frozen=True)
class Answer:
    """One question about the recordings.

    Attributes:
        question: what is asked; yes is good.
        verdict: the answer.
        number: what it rests on, with units.
        advice: what to do about it; empty where there is nothing to do.
    """

    question: str
    verdict: Verdict
    number: str
    advice: str = ""


def at_least(value: float, bounds: tuple[float, float]) -> Verdict:
    """Yes from the first bound up, doubtful from the second up; NaN is no."""
    return "yes" if value >= bounds[0] else "doubtful" if value >= bounds[1] else "no"


def at_most(value: float, bounds: tuple[float, float]) -> Verdict:
    """Yes up to the first bound, doubtful up to the second; NaN is no."""
    return "yes" if value <= bounds[0] else "doubtful" if value <= bounds[1] else "no"


def fitness(
    seen: SourceSeen, hand: Candidate | None, motion: MotionSurvey | None, topics: Sequence[str]
) -> list[Answer]:
    """All questions that can be asked of the files.

    Args:
        seen: the files.
        hand: whose poses are taken for the hand's; None where there are none.
        motion: its runs; None where it does not move.
        topics: which are to be read.
    """
    answers = [_readable(seen), _enough(seen)]
    if hand is None:
        foreign = sorted({one.type for file in seen.files for one in file.topics.values() if one.foreign})
        number = "no poses, moving frames or joint states that can be read"
        advice = f"convert to ROS 2 messages, or to a table of poses: {'; '.join(foreign)}" if foreign else ""
        answers.append(Answer("Is there a pose of the hand?", "no", number, advice))
    else:
        answers += list(_of_hand(seen, hand))
    if motion is not None:
        answers.append(_agreement(motion))
    answers += list(_of_signals(seen.files, topics))
    if hand is not None:
        answers += list(_of_clocks(seen.files, topics, hand.source))
    answers += list(_excitation(seen))
    return answers


def _readable(seen: SourceSeen) -> Answer:
    total = len(seen.files) + len(seen.damaged)
    verdict: Verdict = "yes" if not seen.damaged else "doubtful"
    advice = "; ".join(seen.damaged.values())
    return Answer("Can all files be read?", verdict, f"{len(seen.files)} of {total}", advice)


def _enough(seen: SourceSeen) -> Answer:
    count = len(seen.files)
    verdict = at_least(count, ENOUGH)
    advice = "" if verdict == "yes" else f"record {ENOUGH[0]} or more"
    return Answer("Are there enough demonstrations?", verdict, str(count), advice)


def _of_hand(seen: SourceSeen, hand: Candidate) -> Iterator[Answer]:
    paths = hand.paths
    scale, unit = (1e3, "mm") if hand.unit == "m" else (1.0, "rad")
    missing = [file.name for file in seen.files if file.name not in paths]
    if missing:
        reasons = [file.no_hands[hand.source] for file in seen.files if hand.source in file.no_hands]
        yield Answer(
            "Does every file have the hand's pose?",
            "no",
            f"{hand.words}: {len(paths)} of {len(seen.files)}",
            "; ".join(reasons) or f"not in {', '.join(missing)}",
        )
    least = min(paths, key=lambda name: paths[name].extent_m)
    noise = float(np.median([path.noise_m for path in paths.values()]))
    verdict = at_least(paths[least].extent_m, EXTENT[hand.unit])
    advice = "" if verdict == "yes" else f"look at {least}"
    if hand.unit == "m" and hand.extent > FARTHEST_M:
        verdict, advice = "doubtful", "positions are read as m; were they written in mm?"
    yield Answer(
        "Does the hand move in all?",
        verdict,
        f"{scale * hand.extent:.4g} {unit} in the median, least {scale * paths[least].extent_m:.4g} {unit}",
        advice,
    )
    if hand.moves:
        ratio = hand.extent / noise if noise > 0.0 else float("inf")
        times = f"{ratio:.4g} times ({scale * noise:.2g} {unit})" if noise > 0.0 else "there is none"
        yield Answer("Is the motion well above the noise?", at_least(ratio, OVER_NOISE), times)
    if hand.unit == "m":
        worst = max(paths, key=lambda name: paths[name].norm_error)
        off = paths[worst].norm_error
        verdict = "yes" if off <= NORM_TOLERANCE else "no"
        advice = (
            "" if verdict == "yes" else f"look at {worst}: the reader refuses more than {NORM_TOLERANCE:g}"
        )
        yield Answer("Are quaternions of unit norm?", verdict, f"off by {off:.1g} at most", advice)
        faults = [f"{name}: {path.fault}" for name, path in paths.items() if path.fault]
        yield Answer(
            "Are poses free of jumps?",
            "no" if faults else "yes",
            f"{len(paths) - len(faults)} of {len(paths)}",
            "; ".join(faults),
        )
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
    odd = (away > ELSEWHERE["m"] * hand.extent) | (turned > ELSEWHERE["rad"])
    return Answer(
        "Does the hand start alike?",
        "doubtful" if odd.any() else "yes",
        f"off the others by {1e3 * away.max():.3g} mm and {turned.max():.2g} rad at most",
        f"another frame, or order of quaternions? look at {listed}"
        if (listed := ", ".join(name for name, one in zip(names, odd, strict=True) if one))
        else "",
    )


def _of_signals(files: Sequence[FileSeen], topics: Sequence[str]) -> Iterator[Answer]:
    read = [(file, topic, file.topics[topic]) for file in files for topic in topics if topic in file.topics]
    if not read:
        return
    frozen = [f"{topic} in {file.name}" for file, topic, one in read if one.frozen]
    yield Answer(
        "Do all signals change?",
        "doubtful" if frozen else "yes",
        f"{len(read) - len(frozen)} of {len(read)}",
        f"always the same: {', '.join(frozen)}" if frozen else "",
    )
    turned = {
        f"{topic} in {file.name}": float(np.abs(joints.values["joint_positions"]).max())
        for file, topic, one in read
        for joints in one.joints
        if "joint_positions" in joints.values
    }
    if turned:
        largest = max(turned, key=turned.__getitem__)
        verdict: Verdict = "yes" if turned[largest] <= MOST_TURNED else "doubtful"
        advice = "" if verdict == "yes" else f"degrees? look at {largest}"
        yield Answer("Are joints' positions in rad?", verdict, f"to {turned[largest]:.3g}", advice)


def _agreement(motion: MotionSurvey) -> Answer:
    total, agree = len(motion.runs), len(motion.agreeing)
    others = [
        f"{name} has {len(motion.counted(name))}" for name in motion.runs if name not in motion.agreeing
    ]
    threshold = f"{motion.thresholds[motion.chosen]:.2g} {motion.unit}/s"
    return Answer(
        "Do runs of motion agree in number?",
        "yes" if agree == total else "doubtful" if 2 * agree > total else "no",
        f"{motion.number} in {agree} of {total}, above {threshold}",
        "; ".join(others),
    )


def _of_clocks(files: Sequence[FileSeen], topics: Sequence[str], pose: PoseSource) -> Iterator[Answer]:
    clocks = clocks_of(files, topics)
    if not clocks:
        return
    stamped = [(name, topic, one) for name, topic, one in clocks if one.header]
    names = sorted({topic for _, topic, _ in clocks})
    unstamped = [topic for topic in names if not any(topic == other for _, other, _ in stamped)]
    yield Answer(
        "Do messages say when they were taken?",
        "yes" if not unstamped else "doubtful",
        f"{len(names) - len(unstamped)} of {len(names)} topics have header stamps",
        f"the log time stands in for {', '.join(unstamped)}" if unstamped else "",
    )
    off, where = max((out_of_step(file, topics), file.name) for file in files)
    if stamped:
        verdict = at_most(off, IN_STEP_S)
        advice = "" if verdict == "yes" else f"look at {where}: delays of topics differ, or drift"
        yield Answer("Are the clocks in step?", verdict, f"to {1e3 * off:.3g} ms", advice)
    series = series_of(files, topics, pose)
    name, topic, one = max(series, key=lambda item: _disorder(item[2]))
    yield Answer(
        "Do stamps increase?",
        at_most(_disorder(one), DISORDERED),
        f"all but {_disorder(one):.2g} of them" if _disorder(one) else "all do",
        f"in {name}, {topic}, {one.repeated} repeat and {one.backward} run back" if _disorder(one) else "",
    )
    name, topic, one = max(series, key=lambda item: np.nan_to_num(item[2].largest_gap_s, nan=np.inf))
    yield Answer(
        "Are streams without gaps?",
        "yes" if one.largest_gap_s <= MAX_GAP_S else "no",
        f"largest {one.largest_gap_s:.3g} s",
        "" if one.largest_gap_s <= MAX_GAP_S else f"in {name}, {topic}, at {one.gap_at_s:.3g} s",
    )
    name, topic, one = max(series, key=lambda item: _unevenness(item[2]))
    yield Answer(
        "Are steps even?",
        at_most(_unevenness(one), JITTER),
        f"to {100 * _unevenness(one):.2g} % of a step",
        f"in {name}, {topic}" if _unevenness(one) > JITTER[0] else "",
    )
    name, topic, one = min(series, key=lambda item: np.nan_to_num(item[2].rate_hz))
    yield Answer(
        "Are topics fast enough?",
        at_least(one.rate_hz, RATES_HZ),
        f"slowest {one.rate_hz:.4g} Hz",
        f"in {name}, {topic}" if not one.rate_hz >= RATES_HZ[0] else "",
    )


def _disorder(stamps: Stamps) -> float:
    """Share of stamps that do not come after the one before."""
    return (stamps.repeated + stamps.backward) / stamps.count


def _unevenness(stamps: Stamps) -> float:
    """Jitter in steps; of one message, none."""
    return float(np.nan_to_num(stamps.jitter_s * stamps.rate_hz))


def out_of_step(file: FileSeen, topics: Sequence[str]) -> float:
    """By how much the clocks of topics of a file differ in s: their delays among each other, or one's drift.

    A delay that all share harms nobody: what comes from one clock is in step with itself.
    """
    clocks = [file.topics[topic].clocks for topic in topics if topic in file.topics]
    delays = [one.delay for one in clocks if one and one.delay]
    if not delays:
        return 0.0
    medians = [delay.median_s for delay in delays]
    return max(max(medians) - min(medians), *(abs(delay.drift_s) for delay in delays))


def _excitation(seen: SourceSeen) -> Iterator[Answer]:
    """Of joints with efforts: what each went through, and with a URDF how well the whole is determined."""
    arms = [(file.name, arm[1]) for file in seen.files if (arm := arm_of(file.topics))]
    arms = [(name, joints) for name, joints in arms if set(JOINT_KINDS) <= joints.values.keys()]
    if not arms:
        return
    names = arms[0][1].names
    try:
        motion = joined([_motion(name, joints, names) for name, joints in arms])
    except InputError as error:
        yield Answer("Can the arm's dynamics be learned?", "no", "joint states are not as needed", str(error))
        return
    for name, one in zip(names, joint_ranges(motion), strict=True):
        found = (at_least(one.velocity, VELOCITIES), at_least(one.acceleration, ACCELERATIONS))
        yield Answer(
            f"Is {name} moved enough to learn its dynamics?",
            max(found, key=("yes", "doubtful", "no").index),
            f"{one.position:.3g} rad, to {one.velocity:.3g} rad/s and {one.acceleration:.3g} rad/s^2",
        )
    if seen.urdf is not None:
        try:
            number = _condition(local_path(seen.urdf), names, motion)
        except InputError as error:
            yield Answer("Is the arm excited as a whole?", "no", "the URDF does not serve", str(error))
            return
        verdict = at_most(number, CONDITIONS)
        advice = "" if verdict == "yes" else "move all joints far and fast, at different times"
        yield Answer("Is the arm excited as a whole?", verdict, f"condition number {number:.3g}", advice)


def _condition(urdf: Path, names: Sequence[str], motion: Motion) -> float:
    """Condition number of the base regressor of a robot whose other joints are locked."""
    from structlearn.rigid_body.base_parameters import condition_number  # with torch and Pinocchio
    from structlearn.rigid_body.tree import joint_order, read_urdf

    tree = read_urdf(urdf, [joint for joint in moving_joints(urdf) if joint not in names]).tree
    order = joint_order(tree, names, "the log of joint states")
    columns = (values[:, order] for values in (motion.q, motion.qd, motion.qdd, motion.torque))
    return condition_number(tree, Motion(*columns))


def _motion(name: str, joints: JointSeries, names: Sequence[str]) -> Motion:
    """Joint states as dynamics are learned from, columns in an order of names."""
    if sorted(joints.names) != sorted(names):
        raise InputError(f"{name} has the joints {', '.join(joints.names)}, others have {', '.join(names)}")
    order = [joints.names.index(one) for one in names]
    stamps, places = np.unique(joints.stamps, return_index=True)
    positions, velocities, torques = (joints.values[kind][places][:, order] for kind in JOINT_KINDS)
    time = 1e-9 * (stamps - stamps[0])
    return measured_motion(name, time, positions, velocities, torques, cutoff_hz=EXCITATION_HZ)
