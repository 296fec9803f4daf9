"""Initial start and end of every primitive, by zero-velocity crossing or at its extrapolated onset.

If each primitive has a different axis and a threshold, it is the largest movement along its axis after the
previous primitive, and the first demonstration is the reference. Otherwise runs of motion are assigned to the
primitives of all demonstrations jointly (`run_assignment`), which also chooses the reference.

An onset is extrapolated: the speed passes a threshold only some time after the movement has begun, the later
the slower the movement, and sway of a resting hand passes it at random. Near its ends, a movement from rest
to rest follows the minimum-jerk profile

    y(phase) = 10 phase^3 - 15 phase^4 + 6 phase^5

for the share y of the distance covered, whatever its pace in the middle. The inverse of y gives the phase of
each sample, and the line through (phase, time) of the first few per cent of the distance reaches phase 0 at
the onset. The end is the onset of the reversed movement. Not in the dissertation, which cuts by zero-velocity
crossing (IV.5).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from structlearn.core import quaternion, signals
from structlearn.core.errors import InputError
from structlearn.core.signals import minimum_jerk
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation import motion_runs, run_assignment
from structlearn.segmentation.motion_runs import (
    AxisMotion,
    Candidates,
    CandidateSearch,
    Strokes,
    moving_interval,
)
from structlearn.segmentation.parameters import (
    BETWEEN,
    STROKES,
    Axis,
    PrimitiveParameters,
    SegmentParameters,
)
from structlearn.segmentation.run_assignment import Chosen
from structlearn.segmentation.strokes import find_strokes, stroke_candidates

PHASE = np.linspace(0.0, 1.0, 2001)

PROGRESS = minimum_jerk(PHASE)

REST_WINDOW_S = 0.3
"""Longest time before the crossing that is used to estimate the rest position and its sway."""

FIRST_SHARE, LAST_SHARE = 0.01, 0.05
"""Range of the covered share from which samples are used; tuned on simulated people of the seeds 1 to 5."""

SWAY, LARGEST_SHARE, SHARES = 5.0, 0.15, 3.0
"""The first share is at least `SWAY` standard deviations of the sway at rest, but at most `LARGEST_SHARE`;
the last is at least `SHARES` times the first."""

STRAIGHT = 0.5
"""Least distance between the ends over the path length, for a movement that progresses steadily."""

FEWEST_SAMPLES = 4
"""Fewest samples for the line."""


@dataclass(frozen=True)
class Crossing:
    """Extent of one primitive in one demonstration, in samples."""

    start: int
    end: int
    earliest: int  # limits of its surroundings, beyond which other motion begins
    latest: int
    start_known: bool = False  # given by an event instead of a speed, so not refined
    end_known: bool = False
    mismatch: float = 0.0  # with the reference's primitive (`run_assignment`); 0 without a choice
    # path of unassigned motion before it, and after it if it is the last, relative to a mean primitive
    unassigned: tuple[float, float] = (0.0, 0.0)
    # largest rotation in degrees since its predecessor (or the start), and after it if it is the last
    turned_deg: tuple[float, float] = (0.0, 0.0)
    paused_s: float = 0.0  # s of dips within it that count as hesitations
    strokes: Strokes | None = None  # of which it consists, if their number varies


Crossings = Mapping[str, Crossing]  # by name of the primitives that have an axis


def find_crossings(
    demonstrations: Sequence[Demonstration], parameters: SegmentParameters
) -> tuple[int, list[Crossings | InputError]]:
    """Index of the reference, and per demonstration its crossings or the reason why it has none.

    `demonstrations`: without gaps, with one sampling interval. Raises InputError: there is no demonstration
    with the reference's name.
    """
    names = [demonstration.name for demonstration in demonstrations]
    if parameters.reference not in (None, *names):
        raise InputError(f"segment.reference: there is no demonstration named '{parameters.reference}'")
    named = None if parameters.reference is None else names.index(parameters.reference)
    crossings: list[Crossings | InputError] = []
    if parameters.assigns_runs:
        place, crossings = _assigned(demonstrations, parameters, named)
    else:
        place = named or 0
        for demonstration in demonstrations:
            try:
                crossings.append(_largest(demonstration, parameters))
            except InputError as error:
                crossings.append(error)
    if parameters.at_onsets:
        crossings = [_at_onsets(*pair, parameters) for pair in zip(demonstrations, crossings, strict=True)]
    return place, crossings


def _at_onsets(
    demonstration: Demonstration, crossings: Crossings | InputError, parameters: SegmentParameters
) -> Crossings | InputError:
    """Crossings with their ends moved to the extrapolated onsets of the movement."""
    if isinstance(crossings, InputError):
        return crossings
    axes = {primitive.name: primitive.shown_by for primitive in _with_axis(parameters)}
    dt, moved, before = demonstration.dt, list(crossings.values()), 0
    smooth = {
        axis: signals.low_pass(motion_runs.path(demonstration, axis), dt, parameters.cut_cutoff_hz)
        for axis in dict.fromkeys(axes.values())
    }
    for place, (name, crossing) in enumerate(crossings.items()):
        after = min([crossing.latest, *(later.start for later in moved[place + 1 : place + 2])])
        limits = (max(crossing.earliest, before), after)
        if crossing.strokes is not None:
            strokes = _strokes_at_onsets(smooth[axes[name]], dt, crossing.strokes, limits)
            moved[place] = replace(
                crossing, start=int(strokes.ends[0, 0]), end=int(strokes.ends[-1, 1]), strokes=strokes
            )
            before = moved[place].end
            continue
        start, end = movement_ends(smooth[axes[name]], dt, (crossing.start, crossing.end), limits)
        start = crossing.start if crossing.start_known else start
        end = crossing.end if crossing.end_known else end
        moved[place] = replace(crossing, start=start, end=end)
        before = end
    return dict(zip(crossings, moved, strict=True))


def _strokes_at_onsets(path: np.ndarray, dt: float, strokes: Strokes, limits: tuple[int, int]) -> Strokes:
    """Strokes, each from its onset to its end; `limits`: as in `movement_ends`, of the first and last."""
    reach = [limits[0], *strokes.ends.ravel()[1:-1].tolist(), limits[1]]
    ends = [
        movement_ends(path, dt, (first, last), (reach[2 * place], reach[2 * place + 1]))
        for place, (first, last) in enumerate(strokes.ends.tolist())
    ]
    return replace(strokes, ends=np.array(ends))


def _largest(demonstration: Demonstration, parameters: SegmentParameters) -> Crossings:
    """Largest movement along the axis of each primitive, searched for after the previous primitive."""
    crossings, first, last = {}, 0, len(demonstration.time) - 1
    for primitive in _with_axis(parameters):
        motion = motion_runs.motion(demonstration, primitive.shown_by, parameters)
        bridge = round(parameters.bridge_s / demonstration.dt)
        assert primitive.threshold_m_s is not None  # else runs are assigned
        try:
            start, end = moving_interval(
                motion.smooth_speed, motion.speed, primitive.threshold_m_s, bridge, first
            )
        except ValueError as error:
            raise InputError(f"{demonstration.name}: primitive '{primitive.name}': {error}") from error
        crossings[primitive.name] = Crossing(start, end, 0, last)
        first = end
    return crossings


def _with_axis(parameters: SegmentParameters) -> list[PrimitiveParameters]:
    return [primitive for primitive in parameters.primitives if primitive.axis != BETWEEN]


def _assigned(
    demonstrations: Sequence[Demonstration], parameters: SegmentParameters, named: int | None
) -> tuple[int, list[Crossings | InputError]]:
    """Runs at several thresholds, assigned to the primitives."""
    primitives = _with_axis(parameters)
    axes = dict.fromkeys(primitive.shown_by for primitive in primitives)
    seen = [{axis: motion_runs.motion(run, axis, parameters) for axis in axes} for run in demonstrations]
    paces = {axis: motion_runs.pace([motions[axis] for motions in seen]) for axis in axes}
    candidates = [
        _candidates(demonstration, motions, primitives, paces, parameters)
        for demonstration, motions in zip(demonstrations, seen, strict=True)
    ]
    places = [parameters.primitives.index(primitive) for primitive in primitives]
    between = [place > 0 and parameters.primitives[place - 1].axis == BETWEEN for place in places]
    references = range(len(demonstrations)) if named is None else [named]
    assignment = run_assignment.assign(candidates, references, between)
    if assignment is None:
        missing = [
            _missing(demonstration, primitives, choices, None, paces)
            for demonstration, choices in zip(demonstrations, candidates, strict=True)
        ]
        return references[0], list(missing)
    crossings: list[Crossings | InputError] = []
    for demonstration, choices, chosen in zip(demonstrations, candidates, assignment.chosen, strict=True):
        if chosen is None or chosen.costs.max() > run_assignment.MISSING:
            costs = None if chosen is None else chosen.costs
            crossings.append(_missing(demonstration, primitives, choices, costs, paces))
        else:
            placed = _placed(primitives, choices, chosen)
            crossings.append(_with_turns(demonstration, placed, dict(zip(placed, between, strict=True))))
    return assignment.reference, crossings


def _thresholds(primitive: PrimitiveParameters, paces: Mapping[Axis, float]) -> tuple[float, ...]:
    """Speed thresholds at which a primitive's runs are searched for, in rising order."""
    if primitive.threshold_m_s is not None:
        return (primitive.threshold_m_s,)
    return tuple(fraction * paces[primitive.shown_by] for fraction in motion_runs.FRACTIONS)


def _candidates(
    demonstration: Demonstration,
    motions: Mapping[Axis, AxisMotion],
    primitives: Sequence[PrimitiveParameters],
    paces: Mapping[Axis, float],
    parameters: SegmentParameters,
) -> list[Candidates]:
    """Candidates for each primitive. Events split runs, since the hand may move on without a pause."""
    most, bridge = len(primitives) + motion_runs.SPARE_RUNS, round(parameters.bridge_s / demonstration.dt)
    events = {
        primitive.name: motion_runs.events(demonstration, primitive.until)
        for primitive in primitives
        if primitive.until is not None
    }
    breaks = sorted({int(sample) for ends in events.values() for sample in ends})
    if any(primitive.axis == STROKES for primitive in primitives):  # each is a run
        lowest = min(
            _thresholds(primitive, paces)[0] for primitive in primitives if primitive.axis == STROKES
        )
        most += sum(len(strokes.ends) for strokes in find_strokes(motions[STROKES], lowest))
    before = {primitive.name: previous.name for previous, primitive in pairwise(parameters.primitives)}
    searched: dict[tuple[object, ...], Candidates] = {}  # shared: same axis, threshold and events
    rows = []
    for primitive in primitives:
        previous = before.get(primitive.name, "")
        key = (primitive.shown_by, primitive.threshold_m_s, primitive.until, previous in events and previous)
        if key not in searched:
            ends, begins = events.get(primitive.name), events.get(previous, ())
            thresholds = _thresholds(primitive, paces)
            search = CandidateSearch(thresholds, demonstration.dt, bridge, most, breaks, ends, begins)
            searched[key] = motion_runs.run_candidates(motions[primitive.shown_by], search)
            if primitive.axis == STROKES:
                searched[key] = stroke_candidates(motions[STROKES], search, searched[key])
        rows.append(searched[key])
    return rows


def _placed(
    primitives: Sequence[PrimitiveParameters], candidates: Sequence[Candidates], chosen: Chosen
) -> Crossings:
    """Crossings of the chosen candidates of a demonstration."""
    crossings: dict[str, Crossing] = {}
    event, before = None, 0
    *unassigned, after = chosen.unassigned.tolist()
    for place, (primitive, choices, at) in enumerate(zip(primitives, candidates, chosen.chain, strict=True)):
        start, end = max(before, int(choices.first[at])), int(choices.last[at])
        lengths = np.diff(choices.travelled[choices.runs])[:, 0]
        runs = choices.runs[lengths > motion_runs.MOVED * choices.path_length[at]]
        earlier, later = runs[runs[:, 1] < start, 1], runs[runs[:, 0] > end, 0]
        crossings[primitive.name] = Crossing(
            start,
            end,
            max(before, int(earlier[-1]) if len(earlier) else 0),
            int(later[0]) if len(later) else len(choices.path) - 1,
            start_known=start == event,
            end_known=primitive.until is not None,
            mismatch=float(chosen.costs[place]),
            unassigned=(unassigned[place], after if place == len(primitives) - 1 else 0.0),
            paused_s=float(choices.paused_s[at]),
            strokes=choices.strokes[at] if choices.strokes else None,
        )
        event, before = end if primitive.until is not None else None, end
    return crossings


def _with_turns(demonstration: Demonstration, crossings: Crossings, between: Mapping[str, bool]) -> Crossings:
    """Crossings with the rotation outside them; `between`: whether a primitive without an axis precedes."""
    if demonstration.orientation is None:
        return crossings
    turned: dict[str, Crossing] = {}
    before, final = 0, list(crossings)[-1]
    for name, crossing in crossings.items():
        earlier = 0.0 if between[name] else _turn_deg(demonstration.orientation[before : crossing.start + 1])
        before = crossing.end
        later = _turn_deg(demonstration.orientation[before:]) if name == final else 0.0
        turned[name] = replace(crossing, turned_deg=(earlier, later))
    return turned


def _turn_deg(orientation: np.ndarray) -> float:
    """Largest angle in degrees of orientations (T, 4) from the first one; 0 if there is none."""
    if len(orientation) == 0:
        return 0.0
    return float(np.degrees(quaternion.angle_between(orientation, orientation[:1]).max()))


def _missing(
    demonstration: Demonstration,
    primitives: Sequence[PrimitiveParameters],
    candidates: Sequence[Candidates],
    mismatch: np.ndarray | None,
    paces: Mapping[Axis, float],
) -> InputError:
    """Error that says why a demonstration cannot be cut: its runs, and the thresholds tried."""
    for primitive, choices in zip(primitives, candidates, strict=True):
        if primitive.until is not None and len(choices.runs) and len(choices.first) == 0:
            what = f"{primitive.until.signal} never comes to {primitive.until} after its motion"
            return InputError(f"{demonstration.name}: primitive '{primitive.name}': {what}")
        if primitive.axis == STROKES and len(choices.first) == 0:
            what = "its motion has fewer than two strokes to and fro, or none that repeats"
            return InputError(f"{demonstration.name}: primitive '{primitive.name}': {what}")
    place = 0 if mismatch is None else int(np.argmax(mismatch))
    primitive, choices = primitives[place], candidates[place]
    lowest, *others = [f"{threshold:.3g}" for threshold in _thresholds(primitive, paces)]
    unit = "of the joints per s" if demonstration.of_joints else "m/s"
    unit, dt = "rad/s" if primitive.axis == "rot" else unit, demonstration.dt
    runs = ", ".join(f"{dt * first:.2f}-{dt * last:.2f}" for first, last in choices.runs)
    what = f"none is like '{primitive.name}' in the other demonstrations"
    if mismatch is None:
        what = f"they cannot be {', '.join(primitive.name for primitive in primitives)} in this order"
    for until in (primitive.until for primitive in primitives if primitive.until is not None):
        times = ", ".join(f"{dt * at:.2f}" for at in motion_runs.events(demonstration, until))
        what += f"; {until.signal} comes to {until} at {f'{times} s' if times else 'no time'}"
    tried = f"; tried {', '.join(others)} {unit} too" if others else ""
    return InputError(
        f"{demonstration.name}: has {len(choices.runs)} runs of motion above {lowest} {unit}"
        f"{f' ({runs} s)' if runs else ''}, and {what}{tried}"
    )


def movement_ends(
    path: np.ndarray, dt: float, crossing: tuple[int, int], limits: tuple[int, int]
) -> tuple[int, int]:
    """First and last sample of a movement from rest to rest, starting from its zero-velocity crossing.

    `path`: (T, D) m or rad, lightly smoothed. `crossing`: first and last sample. `limits`: samples beyond
    which other motion begins. An end that cannot be extrapolated stays at the crossing: the movement turns
    back, or too few samples remain.
    """
    last = len(path) - 1
    start = _onset(path, dt, crossing, limits)
    mirrored = [(last - late, last - early) for early, late in (crossing, limits)]
    end = last - _onset(path[::-1], dt, *mirrored)
    return (start, end) if start < end else crossing


def _onset(path: np.ndarray, dt: float, crossing: tuple[int, int], limits: tuple[int, int]) -> int:
    """Sample at which the movement leaves rest; arguments as in `movement_ends`."""
    start, end = crossing
    earliest, rest = limits[0], round(REST_WINDOW_S / dt)
    before, after = path[max(earliest, start - rest) : start + 1], path[end : min(limits[1], end + rest) + 1]
    origin = np.median(before, axis=0)  # median, since some of these samples may be moving
    displacement = np.median(after, axis=0) - origin
    distance = float(np.linalg.norm(displacement))
    length = float(np.linalg.norm(np.diff(path[start : end + 1], axis=0), axis=1).sum())
    if distance <= STRAIGHT * length:
        return start
    share = (path - origin) @ displacement / distance**2
    sway = float(share[start - len(before) + 1 : start + 1].std())
    first = min(max(FIRST_SHARE, SWAY * sway), LARGEST_SHARE)
    last = max(LAST_SHARE, SHARES * first)
    passed = start + int(np.argmax(share[start : end + 1] > last))
    below = np.flatnonzero(share[earliest:passed] < first)
    samples = np.arange(earliest + (int(below[-1]) + 1 if len(below) else 0), passed)
    phase = np.interp(share[samples], PROGRESS, PHASE)
    if len(samples) < FEWEST_SAMPLES or np.ptp(phase) == 0.0:
        return start
    slope, onset = np.polyfit(phase, samples, 1)
    return int(np.clip(round(onset), earliest, passed)) if slope > 0 else start
