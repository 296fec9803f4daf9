"""A simulated stand-in for the dissertation's real robot: an arm with what the models of III.4.2 do not know.

Its links are not those of the URDF, its joints rub, its drives ripple, its torque sensors are noisy, and
torques act a tick after they are commanded. Everything that belongs to a drive scales with its rated torque,
because larger gears rub and ripple more. No number is chosen to fit an outcome:

* Coulomb friction 0.5 % of the rated torque, viscous friction 0.3 % per rad/s: the recorded Franka Emika
  Panda has Coulomb friction of 0.2 to 0.6 % in the large joints and 1.4 to 2 % in the small ones, and viscous
  friction of 0.04 to 0.8 % (least squares of the recorded Panda; its drives are rated 87 and 12 N m).
* Ripple 0.1 %, noise 0.05 % (std), masses off by 15 % (std of the log), centres of mass by 1.5 cm (std per
  axis), one tick of latency: assumptions, with no source but judgement.
"""

from collections.abc import Sequence

import numpy as np
from pydantic import Field

from structlearn.core.params import Parameters
from structlearn.rigid_body.tree import KinematicTree, LinkInertias
from structlearn.simulation.arm import Mechanics
from structlearn.testbeds.dynamics.world.arm_motion import of_joints


class StandInParameters(Parameters):
    """The stand-in; reasons are in the module's header."""

    log_s: float = Field(gt=0)
    latency_ticks: int = Field(ge=0, le=20)
    rated_n_m: tuple[float, ...]
    viscous_share: float = Field(ge=0)
    coulomb_share: float = Field(ge=0)
    ripple_share: float = Field(ge=0)
    noise_share: float = Field(ge=0)
    ripple_per_turn: float = Field(gt=0)
    mass_spread: float = Field(ge=0)
    centre_spread_m: float = Field(ge=0)


def stand_in(
    tree: KinematicTree, default: LinkInertias, parameters: StandInParameters, seed: int
) -> Mechanics:
    """One of the stand-ins of an arm, by the seed of its links' true inertias.

    A link that weighs more than in the URDF, which the default model believes, is denser: its inertia grows
    with its mass, and stays that of a real body.

    Raises:
        InputError: there are fewer rated torques than joints.
    """
    rated = rated_torques(tree, parameters)
    rng = np.random.default_rng([seed, 0])
    count = len(tree.names)
    factor = np.exp(rng.normal(0.0, parameters.mass_spread, count))
    shift = rng.normal(0.0, parameters.centre_spread_m, (count, 3))
    mass = default.mass * factor
    centre = default.first_moment / default.mass[:, None] + shift
    inertias = LinkInertias(mass, mass[:, None] * centre, default.inertia * factor[:, None, None])
    return Mechanics(
        inertias,
        viscous=parameters.viscous_share * rated,
        coulomb=parameters.coulomb_share * rated,
        ripple=parameters.ripple_share * rated,
        ripple_waves=parameters.ripple_per_turn / (2.0 * np.pi),
        latency_steps=parameters.latency_ticks,
    )


def measured_torques(
    torques: np.ndarray, tree: KinematicTree, parameters: StandInParameters, seed: Sequence[int]
) -> np.ndarray:
    """Torques (T, n) in N m as a stand-in's sensors report them; the seed is that of the noise."""
    noise = parameters.noise_share * rated_torques(tree, parameters)
    return torques + noise * np.random.default_rng(seed).normal(size=torques.shape)


def rated_torques(tree: KinematicTree, parameters: StandInParameters) -> np.ndarray:
    """Rated torque (n,) in N m of each drive of an arm."""
    return of_joints("rated_n_m", parameters.rated_n_m, tree)
