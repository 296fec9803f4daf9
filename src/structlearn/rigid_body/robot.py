"""A robot with a fixed base, read from its URDF by Pinocchio, which merges links at fixed joints."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np
import pinocchio

from structlearn.core.errors import InputError
from structlearn.readers.urdf_file import pinocchio_model
from structlearn.rigid_body.tree import KinematicTree, LinkInertias
from structlearn.rigid_body.urdf import check_urdf


@dataclass(frozen=True)
class Robot:
    """A robot as described by its URDF."""

    name: str
    tree: KinematicTree
    inertias: LinkInertias[np.ndarray]  # of the moving links, including whatever is fixed to them
    model: pinocchio.Model  # with the same joints in the same order

    @cached_property
    def inverse_dynamics(self) -> Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]:
        """Torques (n,) in N m (N where a joint slides) at q, qd, qdd (n,), without friction, by Pinocchio.

        For calls from Python, one state at a time and from one thread; `compiled_dynamics.inverse_dynamics`
        is for compiled loops.
        """
        return self._of_a_state(pinocchio.rnea)

    @cached_property
    def forward_dynamics(self) -> Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]:
        """Accelerations (n,) at q, qd and torques (n,), otherwise as `inverse_dynamics`."""
        return self._of_a_state(pinocchio.aba)

    def _of_a_state(self, function: Callable[..., np.ndarray]) -> Callable[..., np.ndarray]:
        """Pinocchio's function with model and workspace, for joint positions instead of configurations."""
        model, data = self.model, self.model.createData()
        if model.nq == model.nv:
            return partial(function, model, data)
        return lambda q, *others: function(model, data, configuration(model, q), *others)

    def __reduce__(self) -> tuple[type["Robot"], tuple[object, ...]]:
        """Without the cached functions, which cannot be pickled."""
        return type(self), (self.name, self.tree, self.inertias, self.model)


def read_urdf(path: str | Path, locked: Sequence[str] = ()) -> Robot:
    """Read a robot with a fixed base from its URDF.

    Args:
        path: the URDF file; meshes are not read.
        locked: names of joints held at zero position, e.g. a gripper's fingers; they leave the tree and their
            links become part of the links that carry them.

    Raises:
        InputError: the file is missing or unreadable, a locked joint is unknown, a joint is of a kind other
            than revolute, continuous or prismatic, limits are absent or crossed, a value is not a
            number, or a moving link has no positive mass or no positive definite inertia; the message names
            file and joint.
    """
    model = read_model(path, locked)
    robot = robot_of(model)
    _check_inertias(robot, path)
    return robot


def read_model(path: str | Path, locked: Sequence[str] = ()) -> pinocchio.Model:
    """Pinocchio's model of a robot with a fixed base; its links need neither mass nor inertia.

    Raises InputError as `read_urdf` does, except for masses and inertias.
    """
    check_urdf(path, locked)
    model = pinocchio_model(Path(path))
    if locked:
        joints = [model.getJointId(name) for name in locked]
        model = pinocchio.buildReducedModel(model, joints, pinocchio.neutral(model))
    if model.nv == 0:
        raise InputError(f"{path}: the robot has no joint that moves")
    return model


def robot_of(model: pinocchio.Model) -> Robot:
    """Tree and inertias of a fixed-base robot, from Pinocchio's model."""
    return Robot(model.name, _tree(model), _inertias(model), model)


def configuration(model: pinocchio.Model, joints: np.ndarray) -> np.ndarray:
    """Pinocchio's configuration vector for joints (n,), in which continuous joints are cosine and sine."""
    return pinocchio.integrate(model, pinocchio.neutral(model), joints)


LARGEST_POSITION, STD_VELOCITY, STD_ACCELERATION = 2.0, 2.0, 5.0
"""Random states: bound of uniform positions in rad; rad/s and rad/s^2, of normal distributions."""

STATES = 200  # number of random states


def torque_differences(robot: Robot, torques: Callable[..., np.ndarray]) -> np.ndarray:
    """Largest torque difference (n,) in N m from Pinocchio's recursive Newton-Euler at random states.

    `torques` gives (STATES, n) N m for positions, velocities and accelerations, (STATES, n) each.
    """
    generator, shape = np.random.default_rng(0), (STATES, len(robot.tree.names))
    q = generator.uniform(-LARGEST_POSITION, LARGEST_POSITION, shape)
    qd, qdd = (generator.normal(0.0, spread, shape) for spread in (STD_VELOCITY, STD_ACCELERATION))
    model, data = robot.model, robot.model.createData()
    rows = zip(q, qd, qdd, strict=True)
    expected = [pinocchio.rnea(model, data, configuration(model, row), *rest) for row, *rest in rows]
    return np.abs(torques(q, qd, qdd) - np.array(expected)).max(axis=0)


def _tree(model: pinocchio.Model) -> KinematicTree:
    joints = range(1, model.njoints)
    placements = [model.jointPlacements[joint] for joint in joints]
    screws = _screws(model)
    bounded = np.array([model.joints[joint].nq == 1 for joint in joints])  # continuous: cosine and sine
    positions = [model.joints[joint].idx_q for joint in joints]
    prismatic = np.any(screws[:, :3] != 0.0, axis=1)
    return KinematicTree(
        names=tuple(model.names)[1:],
        parents=np.array([model.parents[joint] - 1 for joint in joints]),
        rotation=np.array([placement.rotation for placement in placements]),
        translation=np.array([placement.translation for placement in placements]),
        axis=np.where(prismatic[:, None], screws[:, :3], screws[:, 3:]),
        prismatic=prismatic,
        lower=np.where(bounded, model.lowerPositionLimit[positions], -np.inf),
        upper=np.where(bounded, model.upperPositionLimit[positions], np.inf),
        velocity=model.velocityLimit.copy(),
        gravity=model.gravity.linear.copy(),
    )


def _screws(model: pinocchio.Model) -> np.ndarray:
    """Twist (n, 6) of each link in its own frame for unit speed of its joint: linear, angular."""
    data = model.createData()
    pinocchio.computeJointJacobians(model, data, pinocchio.neutral(model))
    local, joints = pinocchio.ReferenceFrame.LOCAL, range(1, model.njoints)
    jacobians = [pinocchio.getJointJacobian(model, data, joint, local) for joint in joints]
    # Pinocchio returns a vector for a single joint
    return np.array([jacobian.reshape(6, -1)[:, joint] for joint, jacobian in enumerate(jacobians)])


def _inertias(model: pinocchio.Model) -> LinkInertias[np.ndarray]:
    links = list(model.inertias)[1:]
    mass = np.array([link.mass for link in links])
    return LinkInertias(
        mass=mass,
        first_moment=mass[:, None] * np.array([link.lever for link in links]),
        inertia=np.array([link.inertia for link in links]),
    )


def _check_inertias(robot: Robot, path: str | Path) -> None:
    """Check that every link, after merging at fixed joints, has mass and positive definite inertia.

    Inconsistent principal moments are so common in manufacturers' files that they only cause a warning.
    """
    moments = np.linalg.eigvalsh(robot.inertias.inertia)
    for name, mass, moment in zip(robot.tree.names, robot.inertias.mass, moments[:, 0], strict=True):
        if mass <= 0.0:
            raise InputError(
                f"{path}: the link that joint '{name}' moves has no mass: <inertial> is absent or zero"
            )
        if moment <= 0.0:
            raise InputError(
                f"{path}: the link that joint '{name}' moves has no positive definite inertia "
                f"(least principal moment {moment:g} kg m^2)"
            )
    excess = moments[:, 2] / (moments[:, 0] + moments[:, 1]) - 1.0
    if (excess > 1e-6).any():
        links = ", ".join(f"'{robot.tree.names[place]}'" for place in np.flatnonzero(excess > 1e-6))
        warnings.warn(
            f"{path}: no body has the inertia of what moves with {links}: the largest principal moment "
            f"exceeds the sum of both others, by up to {100 * excess.max():.2g} %",
            stacklevel=3,
        )
