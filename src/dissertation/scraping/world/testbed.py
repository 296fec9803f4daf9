"""Parameters of the simulated testbed, conditions of its runs, and guided demonstrations.

Robot and board are the same for all stages. The person who corrects and the pair of fingers are drawn once
(`drawn_testbed`); what varies between runs of a real set-up is drawn from each run's seed, so any run can be
repeated alone, bit for bit.

A person guiding the arm (kinesthetic teaching, IV.9.1.3, i) makes the nominal demonstrations. The arm is in
gravity compensation; the person's own arm acts on it like a pose reference with a natural frequency, softer
than the robot's. Practised people compensate the inertia of what they hold (Shadmehr & Mussa-Ivaldi 1994), so
the intended velocity and acceleration are fed forward and only the noise is filtered by the arm's inertia.
Pressure on the board is regulated by feel, slowly.
"""

from functools import partial

import numpy as np
from pydantic import Field

import structlearn
from dissertation.scraping.world.corrector import CorrectorParameters
from dissertation.scraping.world.demonstrator import (
    DemonstratorParameters,
    Intention,
    first_stamp,
    intended_movements,
    orientation_of,
)
from dissertation.scraping.world.execution import (
    FINGER_TICKS,
    Conditions,
    ControlParameters,
    Reference,
    RunLog,
    execute,
)
from dissertation.scraping.world.scraping_world import WorldParameters
from dissertation.simulation.fingers import FingerPair, PinchParameters
from dissertation.simulation.individuals import Individual, drawn
from structlearn.core import quaternion
from structlearn.core.parallel import parallel_map
from structlearn.core.params import Parameters
from structlearn.readers.demonstration import Recording, Stream

RECORDED_EVERY = 3  # control ticks per message of the joints and of motion capture: 100 Hz at 300 Hz
FINGERS = ("left", "right")


class RecorderParameters(Parameters):
    """Recording devices."""

    motion_capture_deg: float = Field(ge=0)
    stamp_jitter_s: float = Field(ge=0)


class GuidanceParameters(Individual):
    """The guiding person."""

    frequency_hz: float = Field(gt=0)
    force_n: float = Field(gt=0)
    force_spread: float = Field(ge=0)
    force_cv: float = Field(ge=0)
    force_fluctuation_s: float = Field(gt=0)
    force_i_m_n_s: float = Field(ge=0)


class VariationParameters(Parameters):
    """Variation between runs."""

    board_roll_deg: float = Field(ge=0)
    friction: float = Field(ge=0)
    board_stiffness: float = Field(ge=0)


class TestbedParameters(Parameters):
    """The simulated testbed: robot, fingers, board and people."""

    __test__ = False  # tells pytest that this is no test class

    seed: int = Field(ge=0)
    sensor_seed: int = Field(ge=0)
    world: WorldParameters
    control: ControlParameters
    touch: PinchParameters
    variation: VariationParameters
    recorder: RecorderParameters
    guidance: GuidanceParameters
    corrector: CorrectorParameters

    @property
    def finger_rate_hz(self) -> float:
        """Sampling rate of the fingers in Hz."""
        return self.world.control_rate_hz / FINGER_TICKS


def drawn_testbed(population: TestbedParameters) -> TestbedParameters:
    """The testbed with one person who corrects, drawn by `seed`, and one pair of fingers, by `sensor_seed`.

    The guidance stays that of the population: the guiding person is the demonstrating one.
    """
    corrector = drawn(population.corrector, population.seed)
    touch = drawn(population.touch, population.sensor_seed)
    return population.model_copy(update={"corrector": corrector, "touch": touch})


def run_conditions(
    testbed: TestbedParameters,
    board_roll: float,
    rng: np.random.Generator,
    stiffness: float,
    force: np.ndarray,
    gains: tuple[float, float],
) -> Conditions:
    """Conditions of one run: board roll (about `board_roll` rad), friction and stiffness are drawn."""
    own = testbed.variation
    roll, friction, board = rng.standard_normal(3)
    return Conditions(
        board_roll=board_roll + np.radians(own.board_roll_deg) * roll,
        friction_factor=float(np.exp(own.friction * friction)),
        board_stiffness_factor=float(np.exp(own.board_stiffness * board)),
        stiffness=stiffness,
        force=force,
        force_gains=gains,
    )


def recorded_run(
    testbed: TestbedParameters,
    name: str,
    index: int,
    log: RunLog,
    segments: np.ndarray,
    rng: np.random.Generator,
    provenance: dict[str, str],
) -> Recording:
    """Recording of a run: pose and wrench at the controller's rate, all other streams slower.

    `index` sets the recorder's clock. `segments`: (P, 2) s, start and end of the primitives. `provenance`:
    kind of run, setting and seed.
    """
    dt, devices = testbed.world.dt, testbed.recorder
    ticks = np.arange(len(log.position))
    slow = ticks[::RECORDED_EVERY]
    robot = first_stamp(index) + np.round(ticks * dt * 1e9).astype(np.int64)

    def device(sampled: np.ndarray) -> np.ndarray:
        """Time stamps at these ticks, of a device with its own clock."""
        jitter = np.clip(devices.stamp_jitter_s * rng.standard_normal(len(sampled)), -dt, dt)
        jitter[[0, -1]] = 0.0
        return robot[sampled] + np.round(jitter * 1e9).astype(np.int64)

    noise = np.radians(devices.motion_capture_deg) * rng.standard_normal((len(slow), 3))
    seen = quaternion.product(quaternion.from_rotation_vector(noise), log.tool_to_board[slow])
    streams = [
        Stream("/hand/pose", "pose", robot, np.hstack([log.position, log.orientation])),
        Stream("/joints/positions", "joint_positions", robot[slow], log.joint_positions[slow]),
        Stream("/joints/velocities", "joint_velocities", robot[slow], log.joint_velocities[slow]),
        Stream("/joints/torques", "joint_torques", robot[slow], log.joint_torques[slow]),
        Stream("/wrist/wrench", "wrench", robot, log.wrench),
    ]
    for finger, counts in zip(FINGERS, np.hsplit(log.counts, len(FINGERS)), strict=True):
        streams.append(Stream(f"/fingers/{finger}", "tactile", device(log.count_ticks), counts))
    streams.append(Stream("/motion_capture/tool_to_board", "tool_to_board", device(slow), seen))
    origin = {
        "origin": "simulated",
        "generator": "dissertation.scraping.protocol.executions",
        "version": structlearn.__version__,
    }
    return Recording(name, tuple(streams), segments, origin | provenance)


def guided_motion(movement: Intention) -> Reference:
    """Convert an intended movement to a pose reference."""
    step = movement.time[1]
    velocity = np.gradient(movement.edge, step, axis=0)
    turning = np.gradient(movement.tilt, step, axis=0)  # rad/s, for small angles
    return Reference(
        position=movement.edge + movement.edge_noise,
        velocity=velocity,
        acceleration=np.gradient(velocity, step, axis=0),
        orientation=orientation_of(movement.tilt + movement.tilt_noise),
        angular_velocity=turning,
        angular_acceleration=np.gradient(turning, step, axis=0),
        primitive=np.searchsorted(movement.segments[1:, 0], movement.time, side="right"),
    )


def pressure(parameters: GuidanceParameters, ticks: int, dt: float, rng: np.random.Generator) -> np.ndarray:
    """Force (ticks,) in N with which the person intends to press in one trial."""
    from scipy.signal import lfilter

    level = parameters.force_n * np.exp(parameters.force_spread * rng.standard_normal())
    keep = np.exp(-dt / parameters.force_fluctuation_s)
    fluctuation = lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.standard_normal(ticks))
    return level * (1.0 + parameters.force_cv * fluctuation)


def guided_demonstrations(
    person: DemonstratorParameters, guidance: GuidanceParameters, testbed: TestbedParameters
) -> list[Recording]:
    """Nominal demonstrations "01", "02", ... by a person guiding the arm, with the intended segments.

    `guidance`: of the same person; that of the testbed is not used.
    """
    movements = intended_movements(person, testbed.world.control_rate_hz)
    guide = partial(_guide, own=guidance, testbed=testbed, seed=person.seed)
    first, *others = movements
    # the first runs in this process, so that the loop is compiled once and not by each worker
    return [guide(first), *parallel_map(guide, others, "guided demonstrations")]


def _guide(movement: Intention, own: GuidanceParameters, testbed: TestbedParameters, seed: int) -> Recording:
    conditions_rng, fingers_rng, wrist_rng, clocks_rng = map(np.random.default_rng, movement.run.spawn(4))
    ticks, number = len(movement.time), int(movement.name)
    conditions = run_conditions(
        testbed,
        0.0,
        conditions_rng,
        stiffness=(2.0 * np.pi * own.frequency_hz) ** 2,
        force=pressure(own, ticks, testbed.world.dt, conditions_rng),
        gains=(0.0, own.force_i_m_n_s),
    )
    motion = guided_motion(movement)
    start = motion.position[0], quaternion.matrix(motion.orientation[0])
    fingers = FingerPair(testbed.touch, testbed.sensor_seed, fingers_rng, testbed.finger_rate_hz)
    log = execute(testbed.world, motion, start, ticks, conditions, testbed.control, fingers, wrist_rng)
    what = {"seed": str(seed), "setting": "board roll 0 degrees", "what": "a person guides the arm"}
    return recorded_run(testbed, movement.name, number - 1, log, movement.segments, clocks_rng, what)
