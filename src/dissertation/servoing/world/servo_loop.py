"""Closed-loop simulation of tactile servoing, for many fingers at once (II.4.6).

A finger rests on the handle with some load at some place of its skin. The controller reads the electrodes and
commands velocities until they read as they do at the target place and load. The robot follows with a small
delay at its own rate; electrodes are read more slowly, through a causal low-pass; actions are slower still.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from pydantic import Field, PositiveInt

from dissertation.simulation.touch import (
    Contact,
    Finger,
    Handle,
    Memory,
    moved,
    read_out,
    rested,
    touch,
    touching,
)
from dissertation.simulation.touch_demonstrator import (
    PRESS_S,
    SAMPLED_EVERY,
    ToucherParameters,
    held_on_handle,
)
from structlearn.core.params import Parameters
from structlearn.core.signals import minimum_jerk

if TYPE_CHECKING:  # torch takes a second to load, and the report does not need it
    from structlearn.tactile.servo_controller import TactileServo

CENTRE = (0.5, 0.1, 0.9)  # m, of the handle in the base frame; its axis is y
FILTER_ORDER = 2  # of the low-pass, as for the training data


class LoopParameters(Parameters):
    """Timing of the loop."""

    cutoff_hz: float = Field(gt=0)
    samples_per_action: PositiveInt


@dataclass(frozen=True)
class Scene:
    """Finger, handle and robot, shared by all trials."""

    finger: Finger
    handle: Handle
    robot_hz: float  # control rate; electrodes are read every `SAMPLED_EVERY` ticks
    follow_s: float  # time constant with which the robot tracks a commanded velocity
    rest_s: float  # rest before a target is read, and before a trial starts

    @property
    def sample_hz(self) -> float:
        """Sampling rate of the electrodes in Hz."""
        return self.robot_hz / SAMPLED_EVERY

    @property
    def offset(self) -> np.ndarray:
        """Counts (E,) in the air."""
        return self.finger.response.offset[0]


class Held(NamedTuple):
    """B fingers resting on the handle after being pressed onto it."""

    position: np.ndarray  # (B, 3) m
    orientation: np.ndarray  # (B, 4) finger to base
    contact: Contact  # true contacts
    memory: Memory  # of the skins
    signals: np.ndarray  # (T, B, E) counts minus offset, since first contact


@dataclass(frozen=True)
class Servoed:
    """Trajectories of B fingers over N electrode samples."""

    position: np.ndarray  # (N, B, 3) m
    orientation: np.ndarray  # (N, B, 4) finger to base
    point: np.ndarray  # (N, B, 3) m, true contact on the skin, finger frame
    load: np.ndarray  # (N, B) N; zero in the air
    signals: np.ndarray  # (N, B, E) counts minus offset, as read
    latent: np.ndarray  # (N, B, 3) state for which the last action was chosen
    target_latent: np.ndarray  # (B, 3)


class LowPass:
    """Causal Butterworth low-pass of signals (T, B, E) that arrive in pieces, starting from zero."""

    def __init__(self, cutoff_hz: float, rate_hz: float, shape: tuple[int, int]) -> None:
        from scipy.signal import butter

        self._sections = butter(FILTER_ORDER, 2 * cutoff_hz / rate_hz, output="sos")
        self._state = np.zeros((len(self._sections), 2, *shape))

    def __call__(self, piece: np.ndarray) -> np.ndarray:
        """Filter the next T samples, (T, B, E) -> (T, B, E)."""
        from scipy.signal import sosfilt

        passed, self._state = sosfilt(self._sections, piece, axis=0, zi=self._state)
        return passed


def handle_of(person: ToucherParameters) -> Handle:
    """Handle of the closed-loop trials."""
    half_length, radius = 1e-3 * person.handle_half_mm, 1e-3 * person.handle_radius_mm
    return Handle(np.array(CENTRE), np.array([0.0, 1.0, 0.0]), half_length, radius)


def press_skin(places: np.ndarray, tilt: np.ndarray, scene: Scene, rng: np.random.Generator) -> Held:
    """Press B fingers onto the handle and let them rest.

    `places` (B, 3): along and across the finger in m, load in N; `tilt` (B, 2): pitch and yaw in rad.
    """
    finger, rate = scene.finger, scene.sample_hz
    along, across, load = places.T
    pitch, yaw = tilt.T
    position, orientation = held_on_handle(along, across, load, scene.handle, finger, (pitch, yaw))
    contact = touching(position, orientation, scene.handle, finger)
    pressing = np.arange(1, round(PRESS_S * rate) + 1) / round(PRESS_S * rate)
    rising = np.concatenate([minimum_jerk(pressing), np.ones(round(scene.rest_s * rate))])
    points = np.broadcast_to(contact.point, (len(rising), *contact.point.shape))
    signal, memory = touch(rising[:, None] * contact.load, points, finger, rested(len(places), finger))
    return Held(position, orientation, contact, memory, read_out(signal, finger, rng) - scene.offset)


def servo(
    controller: "TactileServo",
    models: int,
    start: Held,
    target: Held,
    scene: Scene,
    loop: LoopParameters,
    duration_s: float,
    rng: np.random.Generator,
) -> Servoed:
    """Servo B fingers from their start contacts to the target contacts.

    The controller has S models; the first B / S trials use the first model, and so on.
    """
    step = loop.samples_per_action
    by_model = (models, -1)

    def felt(held: Held) -> tuple[LowPass, np.ndarray]:
        low_pass = LowPass(loop.cutoff_hz, scene.sample_hz, held.signals.shape[1:])
        return low_pass, encoded(low_pass(held.signals)[-1])

    def encoded(signals: np.ndarray) -> np.ndarray:
        return controller.encode(signals.reshape(*by_model, signals.shape[-1]))

    _, goal = felt(target)
    low_pass, latent = felt(start)
    memory = controller.start(latent)
    position, orientation, touched = start.position, start.orientation, start.memory
    velocity = np.zeros((len(position), 6))
    keep = np.exp(-1 / (scene.robot_hz * scene.follow_s))
    pieces = []
    for _ in range(int(duration_s * scene.sample_hz / step)):
        action, memory = controller.act(latent, goal, memory)
        commanded = action.reshape(velocity.shape)
        poses, contacts = [], []
        for _ in range(step):
            for _ in range(SAMPLED_EVERY):
                velocity = commanded + keep * (velocity - commanded)
                position, orientation = moved(position, orientation, velocity, 1 / scene.robot_hz)
            poses.append((position, orientation))
            contacts.append(touching(position, orientation, scene.handle, scene.finger))
        load = np.stack([contact.load for contact in contacts])
        point = np.stack([contact.point for contact in contacts])
        signal, touched = touch(load, point, scene.finger, touched)
        signals = read_out(signal, scene.finger, rng) - scene.offset
        seen = np.broadcast_to(latent.reshape(-1, latent.shape[-1]), (step, len(position), latent.shape[-1]))
        pieces.append((*(np.stack(parts) for parts in zip(*poses, strict=True)), point, load, signals, seen))
        latent = encoded(low_pass(signals)[-1])
    held, turned, points, loads, read, chosen_for = (
        np.concatenate(parts) for parts in zip(*pieces, strict=True)
    )
    return Servoed(held, turned, points, loads, read, chosen_for, goal.reshape(-1, goal.shape[-1]))
