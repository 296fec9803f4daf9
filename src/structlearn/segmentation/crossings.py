"""Where every primitive of every demonstration starts and ends by zero-velocity crossing: what is refined.

There are two ways. Where each primitive has an axis of its own and a threshold, it is the largest movement
along its axis after the one before, demonstration by demonstration, and the first demonstration is the
reference. Otherwise runs of motion are assigned to the primitives by one choice over all demonstrations
(`run_assignment`), which chooses the reference too.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from structlearn.ground.errors import InputError
from structlearn.recordings.demonstration import Demonstration
from structlearn.segmentation import motion_runs, run_assignment
from structlearn.segmentation.crossing import REST_FRACTION, cut_points, moving_interval
from structlearn.segmentation.motion_runs import Candidates, Motion
from structlearn.segmentation.parameters import BETWEEN, Axis, PrimitiveParameters, SegmentParameters
from structlearn.segmentation.run_assignment import Assignment


@dataclass(frozen=True)
class Crossing:
    """One primitive in one demonstration, in samples.

    Attributes:
        start, end: first and last sample.
        earliest, latest: what surrounds it reaches no further: there other motion begins.
        start_known, end_known: whether an event and not a speed says so, and nothing is to be refined.
        unlike: how unlike the reference's primitive it is (`run_assignment`); 0 where nothing was chosen.
        left_out: way of the motion before it, and after it where it is the last, that belongs to no
            primitive, in ways of a mean one.
        rested: s of dips within it that were taken for hesitations.
    """

    start: int
    end: int
    earliest: int
    latest: int
    start_known: bool = False
    end_known: bool = False
    unlike: float = 0.0
    left_out: tuple[float, float] = (0.0, 0.0)
    rested: float = 0.0


Crossings = Mapping[str, Crossing]
"""Of the primitives that have an axis, by name."""


def find_crossings(
    demonstrations: Sequence[Demonstration], parameters: SegmentParameters
) -> tuple[int, list[Crossings | InputError]]:
    """Start and end of every primitive that has an axis.

    Args:
        demonstrations: complete demonstrations with one common sampling interval.
        parameters: of the segmentation.

    Returns:
        Index of the reference, and of each demonstration the crossings, or why it has none.

    Raises:
        InputError: there is no demonstration of the reference's name, or none can be cut.
    """
    names = [demonstration.name for demonstration in demonstrations]
    if parameters.reference not in (None, *names):
        raise InputError(f"segment.reference: there is no demonstration named '{parameters.reference}'")
    named = None if parameters.reference is None else names.index(parameters.reference)
    if parameters.assigns_runs:
        return _assigned(demonstrations, parameters, named)
    found: list[Crossings | InputError] = []
    for demonstration in demonstrations:
        try:
            found.append(_largest(demonstration, parameters))
        except InputError as error:
            found.append(error)
    return named or 0, found


def _largest(demonstration: Demonstration, parameters: SegmentParameters) -> Crossings:
    """The largest movement along the axis of each primitive, each looked for after the one before."""
    found, first, last = {}, 0, len(demonstration.time) - 1
    for primitive in _with_axis(parameters):
        motion = motion_runs.motion(demonstration, primitive.axis, parameters)
        bridge = round(parameters.bridge_s / demonstration.dt)
        try:
            start, end = moving_interval(
                motion.smooth_speed, motion.speed, primitive.threshold_m_s, bridge, first
            )
        except InputError as error:
            raise InputError(f"{demonstration.name}: primitive '{primitive.name}': {error}") from error
        found[primitive.name] = Crossing(start, end, 0, last)
        first = end
    return found


def _with_axis(parameters: SegmentParameters) -> list[PrimitiveParameters]:
    return [primitive for primitive in parameters.primitives if primitive.axis != BETWEEN]


@dataclass(frozen=True)
class _Choice:
    """Thresholds of the primitives, which candidates they leave in each demonstration, what is chosen."""

    thresholds: tuple[float, ...]
    candidates: list[list[Candidates]]
    assignment: Assignment | None

    @property
    def total(self) -> float:
        return np.inf if self.assignment is None else self.assignment.total


def _assigned(
    demonstrations: Sequence[Demonstration], parameters: SegmentParameters, named: int | None
) -> tuple[int, list[Crossings | InputError]]:
    """By assignment of runs, at the thresholds at which the demonstrations are most alike."""
    primitives = _with_axis(parameters)
    axes = dict.fromkeys(primitive.axis for primitive in primitives)
    seen = [{axis: motion_runs.motion(one, axis, parameters) for axis in axes} for one in demonstrations]
    events = [_events(demonstration, primitives) for demonstration in demonstrations]
    paces = {axis: motion_runs.pace([motions[axis] for motions in seen]) for axis in axes}
    tried = dict.fromkeys(
        tuple(primitive.threshold_m_s or fraction * paces[primitive.axis] for primitive in primitives)
        for fraction in motion_runs.FRACTIONS
    )
    places = [parameters.primitives.index(primitive) for primitive in primitives]
    between = [place > 0 and parameters.primitives[place - 1].axis == BETWEEN for place in places]
    references = range(len(demonstrations)) if named is None else [named]
    lowest = next(iter(tried))
    choices = []
    for thresholds in tried:
        candidates = [
            _candidates(one.dt, motions, ends, primitives, thresholds, lowest, parameters)
            for one, motions, ends in zip(demonstrations, seen, events, strict=True)
        ]
        assignment = run_assignment.assign(candidates, references, between)
        choices.append(_Choice(thresholds, candidates, assignment))
    choice = min(choices, key=lambda one: one.total)
    rests = [REST_FRACTION * threshold for threshold in lowest]
    if choice.assignment is None:
        return references[0], [
            _missing(one, primitives, choice, index, tried) for index, one in enumerate(demonstrations)
        ]
    found: list[Crossings | InputError] = []
    for index, (demonstration, motions) in enumerate(zip(demonstrations, seen, strict=True)):
        chain = choice.assignment.chosen[index]
        if chain is None or choice.assignment.costs[index].max() > run_assignment.MISSING:
            found.append(_missing(demonstration, primitives, choice, index, tried))
        else:
            found.append(_placed(primitives, motions, choice, index, rests))
    return choice.assignment.reference, found


def _events(
    demonstration: Demonstration, primitives: Sequence[PrimitiveParameters]
) -> list[np.ndarray | None]:
    """Samples at one of which each primitive ends; None for those that end with their motion."""
    return [
        None if primitive.until is None else motion_runs.events(demonstration, primitive.until)
        for primitive in primitives
    ]


def _candidates(
    dt: float,
    motions: Mapping[Axis, Motion],
    events: Sequence[np.ndarray | None],
    primitives: Sequence[PrimitiveParameters],
    thresholds: Sequence[float],
    lowest: Sequence[float],
    parameters: SegmentParameters,
) -> list[Candidates]:
    """Of one demonstration for each primitive. An event ends a run: the hand may go on without a rest."""
    most, bridge = len(primitives) + motion_runs.SPARE_RUNS, round(parameters.bridge_s / dt)
    breaks = sorted({int(sample) for ends in events if ends is not None for sample in ends})
    found: dict[tuple, Candidates] = {}  # primitives that are shown alike have the same ones
    rows = []
    for primitive, threshold, resting, ends in zip(primitives, thresholds, lowest, events, strict=True):
        key = (primitive.axis, threshold, primitive.until)
        if key not in found:
            moved = motions[primitive.axis]
            runs = motion_runs.runs_of_motion(moved.smooth_speed, threshold, most, breaks)
            found[key] = motion_runs.candidates(moved, runs, dt, bridge, resting, ends)
        rows.append(found[key])
    return rows


def _placed(
    primitives: Sequence[PrimitiveParameters],
    motions: Mapping[Axis, Motion],
    choice: _Choice,
    index: int,
    rests: Sequence[float],
) -> Crossings:
    """Crossings of the candidates that were chosen in a demonstration."""
    found: dict[str, Crossing] = {}
    event, before = None, 0
    left_out = choice.assignment.left_out[index].tolist()
    for place, primitive in enumerate(primitives):
        one, chosen = choice.candidates[index][place], choice.assignment.chosen[index][place]
        first, last = max(before, int(one.first[chosen])), int(one.last[chosen])
        speed = motions[primitive.axis].speed
        after = one.runs[one.runs[:, 0] > last, 0]
        limits = before, int(after[0]) if len(after) else len(speed) - 1
        earlier = one.runs[one.runs[:, 1] < first, 1]
        start, end = cut_points(speed, (first, last), choice.thresholds[place], rests[place], limits)
        start_known, end_known = first == event, primitive.until is not None
        start, end = first if start_known else start, last if end_known else end
        found[primitive.name] = Crossing(
            start,
            end,
            max(before, int(earlier[-1]) if len(earlier) else 0),
            limits[1],
            start_known,
            end_known,
            float(choice.assignment.costs[index][place]),
            (left_out[place], left_out[-1] if place == len(primitives) - 1 else 0.0),
            float(one.rested[chosen]),
        )
        event, before = last if end_known else None, end
    return found


def _missing(
    demonstration: Demonstration,
    primitives: Sequence[PrimitiveParameters],
    choice: _Choice,
    index: int,
    tried: Iterable[tuple[float, ...]],
) -> InputError:
    """Why a demonstration cannot be cut: which runs it has, and which thresholds were tried."""
    chosen = None if choice.assignment is None else choice.assignment.chosen[index]
    place = 0 if chosen is None else int(np.argmax(choice.assignment.costs[index]))
    primitive, one = primitives[place], choice.candidates[index][place]
    for bounded, its in zip(primitives, choice.candidates[index], strict=True):
        if chosen is None and bounded.until is not None and len(its.runs) and len(its.first) == 0:
            what = f"{bounded.until.signal} never comes to {bounded.until}"
            return InputError(f"{demonstration.name}: primitive '{bounded.name}': {what} after its motion")
    unit = "rad/s" if primitive.axis == "rot" else "m/s"
    dt = demonstration.dt
    runs = ", ".join(f"{dt * first:.2f}-{dt * last:.2f}" for first, last in one.runs)
    thresholds = ", ".join(f"{values[place]:.3g}" for values in tried)
    names = ", ".join(primitive.name for primitive in primitives)
    what = (
        f"they cannot be {names} in this order"
        if chosen is None
        else f"none is like '{primitive.name}' in the other demonstrations"
    )
    return InputError(
        f"{demonstration.name}: has {len(one.runs)} runs of motion above {choice.thresholds[place]:.3g} "
        f"{unit}{f' ({runs} s)' if runs else ''}, and {what}; tried {thresholds} {unit}"
    )
