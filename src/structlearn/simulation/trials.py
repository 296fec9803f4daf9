"""Runs of the scraping testbed as recordings: guided demonstrations, executions, corrections, closed loop.

Every run draws what differs between runs of a real set-up from a seed of its own, so any run can be repeated
alone, bit for bit, and the number of processes does not matter.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from pydantic import Field

from structlearn import quaternion
from structlearn.feedback.runtime import Controller, Limits
from structlearn.feedback.skill import ReactiveSkill
from structlearn.parallel import parallel_map
from structlearn.params import Parameters
from structlearn.primitives.sequence import default_start
from structlearn.recordings.recording import Recording
from structlearn.simulation.corrector import Corrector, CorrectorParameters
from structlearn.simulation.demonstrator import (
    DemonstratorParameters,
    Intention,
    first_stamp,
    intended_movements,
    orientation_of,
)
from structlearn.simulation.execution import FINGER_TICKS, Conditions, ControlParameters, execute
from structlearn.simulation.fingers import FingerPair, TouchParameters
from structlearn.simulation.guidance import GuidanceParameters, GuidedMotion, pressure
from structlearn.simulation.layout import CONTACT_M
from structlearn.simulation.recorder import RecorderParameters, provenance, recorded
from structlearn.simulation.scraping_world import ScrapingWorld, WorldParameters

HOLD_S = 0.3
"""s that the robot waits at the end of an execution, so that all streams cover its last sample."""


class VariationParameters(Parameters):
    """What differs between runs.

    Attributes:
        board_roll_deg: std of the tilt stage about its setting; its protractor shows 0.1 degrees.
        friction: std of the log of the friction coefficient: wipes, ink, dust.
        board_stiffness: std of the log of the board's stiffness under the edge, which meets it elsewhere.
    """

    board_roll_deg: float = Field(default=0.1, ge=0)
    friction: float = Field(default=0.15, ge=0)
    board_stiffness: float = Field(default=0.1, ge=0)


class TestbedParameters(Parameters):
    """The simulated testbed: the same robot, fingers and board for all stages.

    Attributes:
        seed: of all runs; the guided demonstrations have the demonstrator's own.
        sensor_seed: of what tells one electrode from another.
        world: physical constants.
        control: of the robot.
        touch: of the fingers.
        variation: between runs.
        recorder: of the devices that record them.
        guidance: of the person who guides the arm.
        corrector: of the person who corrects roll.
    """

    __test__ = False  # not a test, whatever pytest thinks of its name

    seed: int = Field(default=0, ge=0)
    sensor_seed: int = Field(default=0, ge=0)
    world: WorldParameters = WorldParameters()
    control: ControlParameters = ControlParameters()
    touch: TouchParameters = TouchParameters()
    variation: VariationParameters = VariationParameters()
    recorder: RecorderParameters = RecorderParameters()
    guidance: GuidanceParameters = GuidanceParameters()
    corrector: CorrectorParameters = CorrectorParameters()


@dataclass(frozen=True)
class Run:
    """One execution to be made.

    Attributes:
        name: of the recording.
        setting_deg: roll of the board.
        seed: entropy of the run beside the testbed's seed; runs with equal seeds meet equal conditions.
        corrected: whether a person corrects roll while the robot gives way.
        feedback: whether the skill's networks act.
    """

    name: str
    setting_deg: float
    seed: tuple[int, ...]
    corrected: bool = False
    feedback: bool = False


NOMINAL, CORRECTED, EVALUATED = 1, 2, 3
"""First number of a run's seed: what the run is for."""


def nominal_runs(count: int) -> list[Run]:
    """Executions in the default setting, from which the expected traces are learned."""
    return [Run(_name(number), 0.0, (NOMINAL, 0, number)) for number in range(count)]


def corrected_runs(settings_deg: Sequence[float], count: int) -> list[Run]:
    """Executions that a person corrects, `count` per setting, setting by setting."""
    return [
        Run(_name(number), setting, (CORRECTED, _tenths(setting), number), corrected=True)
        for setting in settings_deg
        for number in range(count)
    ]


def evaluation_runs(settings_deg: Sequence[float], count: int, feedback: bool) -> list[Run]:
    """Executions without or with feedback, setting by setting; the n-th of both meet equal conditions."""
    return [
        Run(_name(number), setting, (EVALUATED, _tenths(setting), number), feedback=feedback)
        for setting in settings_deg
        for number in range(count)
    ]


def guided_demonstrations(
    demonstrator: DemonstratorParameters, testbed: TestbedParameters
) -> list[Recording]:
    """Nominal demonstrations by a person who guides the arm on the flat board.

    Args:
        demonstrator: how many, how noisy, how irregular; its `rate_hz` is the controller's.
        testbed: see there.

    Returns:
        Recordings "01", "02", ... with `true_segments` (3, 2) of the intended movement.
    """
    rate_hz = testbed.world.control_rate_hz
    movements = intended_movements(demonstrator.model_copy(update={"rate_hz": rate_hz}))
    guide = partial(_guide, testbed=testbed, seed=demonstrator.seed)
    return parallel_map(guide, movements, "guided demonstrations")


def executions(
    skill: ReactiveSkill, runs: Sequence[Run], testbed: TestbedParameters, limits: Limits | None = None
) -> list[Recording]:
    """Executions by the robot from the skill's mean start.

    Args:
        skill: primitives, and where runs ask for it expected traces and networks.
        runs: what to do.
        testbed: see there.
        limits: of the feedback.

    Returns:
        One recording per run, in order, with `true_segments` (P, 2) of the commanded primitives.
    """
    work = list(zip(runs, range(len(runs)), strict=True))
    return parallel_map(partial(_execute, skill=skill, testbed=testbed, limits=limits), work, "executions")


def _name(number: int) -> str:
    return f"{number + 1:02d}"


def _tenths(setting_deg: float) -> int:
    """A setting as a whole number for a seed; negative tilts are told from positive ones."""
    return 10_000 + round(10 * setting_deg)


def _guide(movement: Intention, testbed: TestbedParameters, seed: int) -> Recording:
    conditions_rng, fingers_rng, wrist_rng, clocks_rng = (
        np.random.default_rng(child) for child in movement.run.spawn(4)
    )
    ticks = len(movement.time)
    own = testbed.guidance
    with ScrapingWorld(testbed.world) as world:
        conditions = _conditions(
            testbed,
            0.0,
            conditions_rng,
            stiffness=(2.0 * np.pi * own.frequency_hz) ** 2,
            force=pressure(own, ticks, world.dt, conditions_rng),
            gains=(0.0, own.force_i_m_n_s),
        )
        motion = GuidedMotion(movement)
        first = orientation_of(movement.tilt[:1] + movement.tilt_noise[:1])[0]
        start = (movement.edge[0] + movement.edge_noise[0], quaternion.matrix(first))
        fingers = FingerPair(testbed.touch, testbed.sensor_seed, fingers_rng, _finger_rate(testbed))
        log = execute(world, motion, start, ticks, conditions, testbed.control, fingers, wrist_rng)
    return recorded(
        movement.name,
        first_stamp(int(movement.name) - 1),
        log,
        movement.segments,
        provenance("a person guides the arm", 0.0, str(seed)),
        world.dt,
        testbed.recorder,
        clocks_rng,
    )


def execute_run(
    run: Run, index: int, skill: ReactiveSkill, testbed: TestbedParameters, limits: Limits | None = None
) -> Recording:
    """One execution by the robot, as in `executions`; `index` sets the recorder's clock."""
    sequence = np.random.SeedSequence([testbed.seed, *run.seed])
    conditions_rng, fingers_rng, wrist_rng, clocks_rng, person_rng = (
        np.random.default_rng(child) for child in sequence.spawn(5)
    )
    rate_hz = testbed.world.control_rate_hz
    controller = Controller(skill, rate_hz, limits, feedback=run.feedback)
    start = default_start(skill.primitives)
    controller.start(start.position, start.orientation)
    own = testbed.control
    duration = sum(primitive.duration for primitive in skill.primitives)
    ticks = round((duration + HOLD_S) * rate_hz)
    with ScrapingWorld(testbed.world) as world:
        conditions = _conditions(
            testbed,
            np.radians(run.setting_deg),
            conditions_rng,
            stiffness=own.stiffness,
            force=np.full(ticks, own.force_n),
            gains=(own.force_p_m_n, own.force_i_m_n_s),
        )
        fingers = FingerPair(testbed.touch, testbed.sensor_seed, fingers_rng, _finger_rate(testbed))
        corrector = Corrector(testbed.corrector, ticks, world.dt, person_rng) if run.corrected else None
        pose = (start.position, quaternion.matrix(start.orientation))
        log = execute(world, controller, pose, ticks, conditions, own, fingers, wrist_rng, corrector)
    what = "corrected by a person" if run.corrected else "with feedback" if run.feedback else "nominal"
    seed = " ".join(map(str, [testbed.seed, *run.seed]))
    return recorded(
        run.name,
        first_stamp(index),
        log,
        _segments(log.primitive, rate_hz, duration),
        provenance(f"execution, {what}", run.setting_deg, seed),
        world.dt,
        testbed.recorder,
        clocks_rng,
    )


def _execute(
    work: tuple[Run, int], skill: ReactiveSkill, testbed: TestbedParameters, limits: Limits | None
) -> Recording:
    return execute_run(*work, skill, testbed, limits)


def _conditions(
    testbed: TestbedParameters,
    board_roll: float,
    rng: np.random.Generator,
    stiffness: float,
    force: np.ndarray,
    gains: tuple[float, float],
) -> Conditions:
    own = testbed.variation
    roll, friction, board = rng.standard_normal(3)
    return Conditions(
        board_roll=board_roll + np.radians(own.board_roll_deg) * roll,
        board_point=CONTACT_M,
        friction_factor=float(np.exp(own.friction * friction)),
        board_stiffness_factor=float(np.exp(own.board_stiffness * board)),
        stiffness=stiffness,
        force=force,
        force_gains=gains,
    )


def _segments(primitive: np.ndarray, rate_hz: float, duration: float) -> np.ndarray:
    """(P, 2) s: start and end of the commanded primitives; the hold at the end belongs to none."""
    switches = np.flatnonzero(np.diff(primitive)) + 1
    edges = np.concatenate([[0.0], switches / rate_hz, [duration]])
    return np.column_stack([edges[:-1], edges[1:]])


def _finger_rate(testbed: TestbedParameters) -> float:
    return testbed.world.control_rate_hz / FINGER_TICKS
