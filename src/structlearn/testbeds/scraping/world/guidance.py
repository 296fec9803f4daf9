"""A person guides the arm by hand (kinesthetic teaching): how nominal demonstrations are made (IV.9.1.3).

The arm is in gravity compensation; what the person's own arm does to it is again a pose reference with a
natural frequency, softer than the robot's. People who have practised compensate the inertia of what they hold
(Shadmehr & Mussa-Ivaldi 1994), so the intended velocity and acceleration are fed forward and only the noise
is filtered by the arm's inertia. Pressure on the board is regulated by feel, slowly.
"""

import numpy as np
from pydantic import Field

from structlearn.ground.params import Parameters
from structlearn.testbeds.scraping.world.demonstrator import Intention, orientation_of
from structlearn.testbeds.scraping.world.execution import Reference


class GuidanceParameters(Parameters):
    """The guiding person. Fields: `params.yaml`, `testbed.guidance`."""

    frequency_hz: float = Field(gt=0)
    force_n: float = Field(gt=0)
    force_spread: float = Field(ge=0)
    force_cv: float = Field(ge=0)
    force_fluctuation_s: float = Field(gt=0)
    force_i_m_n_s: float = Field(ge=0)


def guided_motion(movement: Intention) -> Reference:
    """The intended movement as a pose reference."""
    step = movement.time[1]
    velocity = np.gradient(movement.edge, step, axis=0)
    turning = np.gradient(movement.tilt, step, axis=0)  # small angles: the vector's rate
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
    """Force that the person means to press with, over the ticks of one trial: (ticks,) N."""
    from scipy.signal import lfilter

    level = parameters.force_n * np.exp(parameters.force_spread * rng.standard_normal())
    keep = np.exp(-dt / parameters.force_fluctuation_s)
    fluctuation = lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.standard_normal(ticks))
    return level * (1.0 + parameters.force_cv * fluctuation)
