"""What rivals learn from: the executions that feedback is learned from, as observations and poses.

All methods get the same runs of one person: `level` executions without correction, which cost nobody any
time, and corrected executions at every training tilt. Start and goal differ between them by up to `range_m`,
so that what is new within that range is interpolated. Rivals see, at the sensors' rate of 100 Hz,

    pose     position relative to the goal in m, rotation vector from the goal's orientation in rad
    task     start minus goal in m, and the share of the duration that has passed
    touch    readings without their offset, or their deviations from the expected traces

and predict later poses. The expected traces, the goal and the duration are the primitives': a help that
rivals would have to do without elsewhere.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
from pydantic import Field

from dissertation.scraping.protocol import execution_scores
from dissertation.scraping.protocol.executions import Bench, Run, execute_run, executions, nominal_runs
from dissertation.scraping.world.demonstrator import DemonstratorParameters
from dissertation.scraping.world.execution import FINGER_TICKS
from dissertation.scraping.world.testbed import TestbedParameters, guided_demonstrations
from dissertation.simulation.individuals import drawn
from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.core.params import Parameters
from structlearn.feedback.coupling_targets import (
    SupervisionParameters,
    learn_expected,
    sensor_readings,
)
from structlearn.feedback.skill import ReactiveSkill
from structlearn.primitives.fitting import FitParameters, learn_sequence
from structlearn.primitives.sequence import default_start
from structlearn.primitives.vector import expected_traces, sample_count, without_offset
from structlearn.readers.clock import synchronise
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.source import ClockParameters
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import commanded_cuts, cut

CORRECTED, LEVEL = (
    11,
    12,
)  # first number of a run's seed, its purpose; those of `protocol.executions` are lower

Sensors = Literal["deviation", "raw"]


class DemonstrationParameters(Parameters):
    """Demonstrations of the comparison. Fields: `params.yaml`, `rivals.demonstrations`."""

    settings_deg: tuple[float, ...] = Field(min_length=1)
    runs: int = Field(ge=1, le=100)
    level_runs: int = Field(ge=1, le=100)
    expected_runs: int = Field(ge=1, le=100)
    smoothing_hz: float = Field(gt=0)
    range_m: tuple[float, float, float]


@dataclass(frozen=True)
class Situation:
    """Where a run starts and ends, relative to the primitives' own."""

    start: np.ndarray  # (3,) m, base frame
    goal: np.ndarray  # (3,) m, of all goals


UNMOVED = Situation(np.zeros(3), np.zeros(3))


@dataclass(frozen=True)
class Episode:
    """One execution at the sensors' rate, T samples."""

    setting_deg: float
    pose: np.ndarray  # (T, 6)
    task: np.ndarray  # (T, 4)
    touch: Mapping[Sensors, np.ndarray]  # (T, E) each


@dataclass(frozen=True)
class Recorded:
    """Executions with their situations, by tilt in degrees; the level board is 0."""

    runs: Mapping[float, Sequence[Demonstration]]
    situations: Mapping[float, Sequence[Situation]]

    def first(self, count: int) -> "Recorded":
        """The first corrected executions at every tilt, and all on the level board."""
        kept = {tilt: slice(count if tilt else None) for tilt in self.runs}
        return Recorded(
            {tilt: its[kept[tilt]] for tilt, its in self.runs.items()},
            {tilt: its[kept[tilt]] for tilt, its in self.situations.items()},
        )


def learned_bench(
    people: DemonstratorParameters,
    testbed: TestbedParameters,
    clock: ClockParameters,
    segment: SegmentParameters,
    fit: FitParameters,
    supervision: SupervisionParameters,
    parameters: DemonstrationParameters,
) -> Bench:
    """The task of one person, learned as by the first five stages of the testbed; without feedback.

    `testbed`: of `drawn_testbed`. Raises InputError: the demonstrations cannot be cut.
    """
    person, guidance = drawn(people, people.seed), drawn(testbed.guidance, people.seed)
    read = partial(synchronise, rate_hz=clock.rate_hz, max_gap_s=clock.max_gap_s)
    demonstrations = [read(one) for one in guided_demonstrations(person, guidance, testbed)]
    primitives = learn_sequence(demonstrations, cut(demonstrations, segment).results, fit)
    return bench_of(ReactiveSkill(primitives), testbed, clock, supervision, parameters)


def bench_of(
    skill: ReactiveSkill,
    testbed: TestbedParameters,
    clock: ClockParameters,
    supervision: SupervisionParameters,
    parameters: DemonstrationParameters,
) -> Bench:
    """Bench with expected traces and orientations, from executions of the primitives on the level board."""
    unrolls = [
        synchronise(one, clock.rate_hz, clock.max_gap_s)
        for one in executions(skill, nominal_runs(parameters.expected_runs), testbed)
    ]
    cuts = commanded_cuts(unrolls, [one.name for one in skill.primitives])
    expected = learn_expected(unrolls, cuts, parameters.smoothing_hz, supervision.sensors)
    nominal = execution_scores.nominal_orientation(unrolls)
    return Bench(replace(skill, expected=expected), nominal, supervision, testbed, clock)


def moved(skill: ReactiveSkill, situation: Situation) -> ReactiveSkill:
    """The skill with another start and goals; only reaches between them generalise, not what was fitted."""
    primitives = []
    for place, one in enumerate(skill.primitives):
        start = situation.goal if place else situation.start
        ends = {"start": one.position.start + start, "goal": one.position.goal + situation.goal}
        primitives.append(replace(one, position=replace(one.position, **ends)))
    return replace(skill, primitives=primitives)


def record(bench: Bench, parameters: DemonstrationParameters) -> Recorded:
    """Corrected executions at every tilt and level ones, each with a start and goal of its own."""
    counts = {0.0: parameters.level_runs} | dict.fromkeys(parameters.settings_deg, parameters.runs)
    if parameters.settings_deg.count(0.0):
        raise InputError("rivals.demonstrations.settings_deg: nothing is corrected on the level board, 0")
    planned, situations = [], {}
    for tilt, count in counts.items():
        purpose = CORRECTED if tilt else LEVEL
        seeds = [(purpose, 10_000 + round(10 * tilt), number) for number in range(count)]
        rngs = [np.random.default_rng([bench.testbed.seed, *seed, 1]) for seed in seeds]
        span = np.array(parameters.range_m)
        situations[tilt] = [Situation(*(span * rng.uniform(-1.0, 1.0, (2, 3)))) for rng in rngs]
        planned += [
            (Run(f"{number + 1:02d}", tilt, seed, corrected=tilt != 0.0), its)
            for number, (seed, its) in enumerate(zip(seeds, situations[tilt], strict=True))
        ]
    made = iter(parallel_map(partial(_executed, bench=bench), planned, "demonstrations for all methods"))
    return Recorded({tilt: [next(made) for _ in range(count)] for tilt, count in counts.items()}, situations)


def _executed(work: tuple[Run, Situation], bench: Bench) -> Demonstration:
    run, situation = work
    recording = execute_run(run, 0, moved(bench.skill, situation), bench.testbed)
    return synchronise(recording, bench.clock.rate_hz, bench.clock.max_gap_s)


@dataclass(frozen=True)
class Frame:
    """What poses of a run are relative to."""

    start: np.ndarray  # (3,) m
    start_orientation: np.ndarray  # (4,)
    goal: np.ndarray  # (3,) m
    orientation: np.ndarray  # (4,) of the goal

    def relative(self, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
        """Poses (..., 6) from positions (..., 3) and unit quaternions (..., 4)."""
        turned = quaternion.difference(orientation, self.orientation)
        return np.concatenate([position - self.goal, turned], axis=-1)

    def absolute(self, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The inverse of `relative`."""
        turned = quaternion.from_rotation_vector(pose[..., 3:])
        return pose[..., :3] + self.goal, quaternion.product(turned, self.orientation)

    def task(self, share: np.ndarray) -> np.ndarray:
        """Task observations (..., 4) at shares of the duration (...)."""
        way = np.broadcast_to(self.start - self.goal, (*np.shape(share), 3))
        return np.concatenate([way, np.asarray(share)[..., None]], axis=-1)


def frame_of(skill: ReactiveSkill) -> Frame:
    """Frame of a skill's runs. Raises InputError: it has no orientations."""
    start, last = default_start(skill.primitives), skill.primitives[-1]
    if start.orientation is None or last.orientation is None:
        raise InputError("rivals imitate poses, and the skill moves positions only")
    return Frame(start.position, start.orientation, last.position.goal, last.orientation.goal)


def expected_over_run(skill: ReactiveSkill, ticks: int, dt: float) -> np.ndarray:
    """Expected readings (ticks, E) of a whole run without its offset; at its end they stay."""
    parts = []
    for one in skill.primitives:
        count = sample_count(one.duration, dt)
        parts.append(expected_traces(skill.expected[one.name], count, dt)[: count - 1])
    path = np.concatenate(parts)
    return np.concatenate([path, np.repeat(path[-1:], max(ticks - len(path), 0), axis=0)])[:ticks]


def episodes(bench: Bench, recorded: Recorded) -> list[Episode]:
    """What rivals see of recorded executions, in their order."""
    return [
        _episode(bench, run, tilt, situation)
        for tilt, runs in recorded.runs.items()
        for run, situation in zip(runs, recorded.situations[tilt], strict=True)
    ]


def _episode(bench: Bench, run: Demonstration, tilt: float, situation: Situation) -> Episode:
    frame, kept = frame_of(moved(bench.skill, situation)), slice(None, None, FINGER_TICKS)
    # the offset of as many readings as a controller takes, so that rivals see the same when they act
    touch = without_offset(sensor_readings(run, bench.supervision.sensors)[kept])
    deviations = touch - expected_over_run(bench.skill, len(run.time), run.dt)[kept]
    share = np.minimum(run.time / sum(one.duration for one in bench.skill.primitives), 1.0)
    return Episode(
        setting_deg=tilt,
        pose=frame.relative(run.position, run.signal("orientation"))[kept],
        task=frame.task(share)[kept],
        touch={"deviation": deviations, "raw": touch},
    )
