"""What rivals learn from: the executions that feedback is learned from, as observations and poses.

All methods get the same runs of one person: executions without correction, which cost nobody any time, and
corrected executions at every training tilt. Start and goal differ between them by up to `range_m`, so that
what is new within that range is interpolated. Rivals see, at the sensors' rate of 100 Hz,

    pose     position relative to the goal in m, rotation vector from the goal's orientation in rad
    task     start minus goal in m, and the share of the duration that has passed
    touch    deviations of the readings from the expected traces

and predict later poses. The expected traces, the goal and the duration are the primitives': a help that
rivals would have to do without elsewhere.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from pydantic import Field

from dissertation.rivals.situations import Situation, execute_skill, moved
from dissertation.scraping.protocol.execution_scores import nominal_orientation
from dissertation.scraping.protocol.executions import (
    Bench,
    Run,
    executions,
    nominal_runs,
    runs_to_correct,
)
from dissertation.scraping.world.demonstrator import DemonstratorParameters
from dissertation.scraping.world.execution import FINGER_TICKS
from dissertation.scraping.world.testbed import TestbedParameters, drawn_testbed, guided_demonstrations
from dissertation.simulation.individuals import drawn
from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.core.params import Parameters
from structlearn.core.stage import stage_parameters
from structlearn.feedback.coupling_targets import SupervisionParameters, learn_expected, sensor_readings
from structlearn.feedback.skill import ReactiveSkill
from structlearn.primitives.fitting import FitParameters, learn_sequence
from structlearn.primitives.sequence import default_start
from structlearn.primitives.vector import expected_traces, sample_count, without_offset
from structlearn.readers.clock import synchronise
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.source import ClockParameters
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import commanded_cuts, cut

Recorded = Mapping[float, Sequence[tuple[Situation, Demonstration]]]
"""Executions with their situations, by tilt in degrees; the level board, 0, first."""


class DemonstrationParameters(Parameters):
    """Demonstrations of the comparison. Fields: `params.yaml`, `rivals.demonstrations`."""

    settings_deg: tuple[float, ...] = Field(min_length=1)
    runs: int = Field(ge=1, le=100)
    level_runs: int = Field(ge=1, le=100)
    expected_runs: int = Field(ge=1, le=100)
    smoothing_hz: float = Field(gt=0)
    range_m: tuple[float, float, float]


class Episode(NamedTuple):
    """One demonstration at 100 Hz, T samples."""

    setting: float  # tilt in degrees, or number of a place
    pose: np.ndarray  # (T, 6), or (T, 3) if the hand does not turn
    task: np.ndarray  # (T, 4)
    touch: np.ndarray  # (T, E) counts, or what is seen


def recorded_person(parameters: DemonstrationParameters) -> tuple[int, Bench, Recorded]:
    """Seed of the person whom `params.yaml` names, the task as learned from them, and executions of it.

    Learned as by the first five stages of the scraping testbed. Raises InputError: the demonstrations cannot
    be cut, or the level board is to be corrected.
    """
    people = stage_parameters("simulate", DemonstratorParameters)
    testbed = drawn_testbed(stage_parameters("testbed", TestbedParameters))
    clock = stage_parameters("clock", ClockParameters)
    person, guidance = drawn(people, people.seed), drawn(testbed.guidance, people.seed)
    guided = [
        synchronise(one, **clock.model_dump()) for one in guided_demonstrations(person, guidance, testbed)
    ]
    cuts = cut(guided, stage_parameters("segment", SegmentParameters)).results
    skill = ReactiveSkill(learn_sequence(guided, cuts, stage_parameters("fit_primitives", FitParameters)))
    supervision = stage_parameters("coupling_dataset", SupervisionParameters)
    bench = bench_of(skill, testbed, clock, supervision, parameters)
    return people.seed, bench, record(bench, parameters)


def bench_of(
    skill: ReactiveSkill,
    testbed: TestbedParameters,
    clock: ClockParameters,
    supervision: SupervisionParameters,
    parameters: DemonstrationParameters,
) -> Bench:
    """Bench with expected traces and orientations, from executions of the primitives on the level board."""
    executed = executions(skill, nominal_runs(parameters.expected_runs), testbed)
    unrolls = [synchronise(one, **clock.model_dump()) for one in executed]
    cuts = commanded_cuts(unrolls, [one.name for one in skill.primitives])
    expected = learn_expected(unrolls, cuts, parameters.smoothing_hz, supervision.sensors)
    return Bench(replace(skill, expected=expected), nominal_orientation(unrolls), supervision, testbed, clock)


def record(bench: Bench, parameters: DemonstrationParameters) -> Recorded:
    """Level executions and corrected ones at every tilt, each with a start and goal of its own.

    Raises InputError: the level board is to be corrected.
    """
    own = parameters
    if own.settings_deg.count(0.0):
        raise InputError("rivals.demonstrations.settings_deg: nothing is corrected on the level board, 0")
    level = nominal_runs(own.expected_runs + own.level_runs)[own.expected_runs :]
    runs, planned = [*level, *runs_to_correct(own.settings_deg, own.runs)], []
    for one in runs:
        rng = np.random.default_rng([bench.testbed.seed, *one.seed, 1])
        start, goal = np.array(own.range_m) * rng.uniform(-1.0, 1.0, (2, 3))
        planned.append((one, Situation("within", tuple(start), tuple(goal))))
    made = parallel_map(partial(_executed, bench=bench), planned, "demonstrations for all methods")
    recorded: dict[float, list[tuple[Situation, Demonstration]]] = {}
    for (run, situation), demonstration in zip(planned, made, strict=True):
        recorded.setdefault(run.setting_deg, []).append((situation, demonstration))
    return recorded


def _executed(work: tuple[Run, Situation], bench: Bench) -> Demonstration:
    return execute_skill(work[0], bench.skill, bench, work[1])


def first(recorded: Recorded, count: int) -> Recorded:
    """The first corrected executions at every tilt, and all on the level board."""
    return {tilt: its[:count] if tilt else its for tilt, its in recorded.items()}


class Frame(NamedTuple):
    """What poses of a run are relative to, its goal."""

    start: np.ndarray  # (6,) its first pose
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
        """Task observations (T, 4) at shares of the duration (T,)."""
        return np.column_stack([np.tile(self.start[:3], (len(share), 1)), share])


def frame_of(skill: ReactiveSkill) -> Frame:
    """Frame of a skill's runs. Raises InputError: it has no orientations."""
    start, last = default_start(skill.primitives), skill.primitives[-1]
    if start.orientation is None or last.orientation is None:
        raise InputError("rivals imitate poses, and the skill moves positions only")
    goal = Frame(np.zeros(6), last.position.goal, last.orientation.goal)
    return goal._replace(start=goal.relative(start.position, start.orientation))


def expected_over_run(skill: ReactiveSkill, ticks: int, dt: float) -> np.ndarray:
    """Expected readings (ticks, E) of a whole run without its offset; at its end they stay."""
    parts = []
    for one in skill.primitives:
        count = sample_count(one.duration, dt)
        parts.append(expected_traces(skill.expected[one.name], count, dt)[: count - 1])
    path = np.concatenate(parts)
    return path[np.minimum(np.arange(ticks), len(path) - 1)]


def episodes(bench: Bench, recorded: Recorded) -> list[Episode]:
    """What rivals see of recorded executions, in their order."""
    duration, seen = sum(one.duration for one in bench.skill.primitives), slice(None, None, FINGER_TICKS)
    found = []
    for tilt, (situation, run) in ((tilt, one) for tilt, its in recorded.items() for one in its):
        frame = frame_of(moved(bench.skill, situation))
        # the offset of as many readings as a controller takes, so that rivals see the same when they act
        touch = without_offset(sensor_readings(run, bench.supervision.sensors)[seen])
        touch = touch - expected_over_run(bench.skill, len(run.time), run.dt)[seen]
        pose = frame.relative(run.position, run.signal("orientation"))[seen]
        found.append(Episode(tilt, pose, frame.task(np.minimum(run.time / duration, 1.0))[seen], touch))
    return found
