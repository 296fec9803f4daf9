"""Motions, conditions and skills of the scraping testbed, short enough for tests."""

import numpy as np
from committed import committed
from primitives_movements import ramp

from dissertation.scraping.world.demonstrator import (
    CONTACT_M,
    DemonstratorParameters,
    as_meant,
    intended_movements,
    orientation_of,
)
from dissertation.scraping.world.execution import Conditions, ControlParameters, Reference
from structlearn.core import quaternion
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork
from structlearn.feedback.skill import ReactiveSkill, on_axis
from structlearn.primitives.orientation import fit_quaternion
from structlearn.primitives.position import fit_position
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.trajectory import OrientationTrajectory, Trajectory
from structlearn.primitives.vector import fit_expected_traces

NAMES = ("down", "turn", "scrape")
DURATIONS_S = (0.6, 1.0, 0.8)
FLAT = np.diag([-1.0, 1.0, -1.0])  # fingers down
CHANNELS = 38


def simulated(**changes):
    """Demonstrations as they are meant, with the hand's noise, without arm, board and touch."""
    parameters = committed(DemonstratorParameters, "simulate", **changes)
    return [as_meant(movement, parameters.seed) for movement in intended_movements(parameters)]


def beside_contact(height_m=0.0, forward_m=0.0):
    """A place above the contact, and along the board."""
    return CONTACT_M + np.array([0.0, forward_m, height_m])


def press_motion(ticks, **changes):
    """A motion that stays where the edge just touches the board; nobody leads."""
    motion = Reference(
        position=np.tile(CONTACT_M, (ticks, 1)),
        velocity=np.zeros((ticks, 3)),
        acceleration=np.zeros((ticks, 3)),
        orientation=np.tile(orientation_of(np.zeros(3)), (ticks, 1)),
        angular_velocity=np.zeros((ticks, 3)),
        angular_acceleration=np.zeros((ticks, 3)),
        primitive=np.ones(ticks, dtype=np.int64),
    )
    return motion._replace(**changes)


def conditions(roll_deg=0.0, ticks=600, control=None, **changes):
    """What a run meets, without differences between runs."""
    own = control or committed(ControlParameters, "testbed.control")
    return Conditions(
        **{
            "board_roll": np.radians(roll_deg),
            "friction_factor": 1.0,
            "board_stiffness_factor": 1.0,
            "stiffness": own.stiffness,
            "force": np.full(ticks, own.force_n),
            "force_gains": (own.force_p_m_n, own.force_i_m_n_s),
        }
        | changes
    )


def minimum_jerk(start, goal, duration, dt=0.005):
    """Straight path with exact derivatives, at rest at both ends."""
    time = dt * np.arange(round(duration / dt) + 1)
    progress, rate, change = (values[:, None] for values in ramp(time / time[-1]))
    way = np.asarray(goal, dtype=float) - start
    return Trajectory(time, start + way * progress, way * rate / time[-1], way * change / time[-1] ** 2)


def turn(start, goal, duration, dt=0.005):
    """Turn between two rotation vectors from flat, small enough that they add up."""
    path = minimum_jerk(start, goal, duration, dt)
    return OrientationTrajectory(path.time, orientation_of(path.position), path.velocity, path.acceleration)


def scraping_skill(networks=None, expected=True):
    """Down 3 cm, a turn of 3 degrees about roll, 3 cm along the board; expected traces of small waves."""
    points = CONTACT_M + np.array([[0, 0, 0.03], [0, 0, 0], [0, 0, 0], [0, 0.03, 0]])
    tilts = np.radians([[0, -3, 0], [0, -3, 0], [0, 0, 0], [0, 0, 0]])
    primitives, traces = [], {}
    rng = np.random.default_rng(0)
    for i, (name, duration) in enumerate(zip(NAMES, DURATIONS_S, strict=True)):
        position = fit_position([minimum_jerk(points[i], points[i + 1], duration)], (False, False, False))
        orientation = fit_quaternion([turn(tilts[i], tilts[i + 1], duration)])
        primitives.append(PosePrimitive(name, position, orientation))
        wave = np.sin(np.linspace(0, 3, 120)[:, None] * rng.uniform(0.5, 2, CHANNELS))
        traces[name] = fit_expected_traces([20.0 * wave], duration / 119, 12.0 / duration)
    return ReactiveSkill(primitives, traces if expected else {}, on_axis(networks or {}, "ry"))


def constant_network(size=20.0, kernels=25, channels=CHANNELS):
    """A network that asks for the same coupling at every deviation, fading with the phase."""
    return PhaseModulatedNetwork(
        input_mean=np.zeros(channels),
        input_scale=np.ones(channels),
        hidden=((np.zeros((4, channels)), np.zeros(4)),),
        phase_weights=np.zeros((kernels, 4)),
        phase_biases=np.ones(kernels),
        output_weights=np.full(kernels, -size),
    )


def roll_deg(q):
    """Roll about y of orientations (..., 4) in degrees."""
    return np.degrees(quaternion.rotation_vector(q)[..., 1])
