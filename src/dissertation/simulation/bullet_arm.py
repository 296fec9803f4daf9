"""Simulation of any arm in PyBullet: torques in, motion out.

PyBullet loads a URDF written from the kinematic tree and link inertias, so it simulates the same arm as
Pinocchio and our own dynamics: locked joints are merged, a "true" arm may differ from its original URDF, and
there are no collisions. Coulomb friction is Bullet's own, a motor that holds zero velocity with bounded
torque, solved implicitly (see `compiled_arm`).
"""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Self

import numpy as np
import pandas as pd
import pybullet

from dissertation.simulation.arm import Payload
from structlearn.rigid_body.tree import KinematicTree, LinkInertias

_PAYLOAD = "payload"
SOLVER_ITERATIONS = 1000  # for friction; Bullet's 50 stop early


class BulletArm:
    """An arm with a fixed base; a context manager that disconnects from PyBullet at the end."""

    def __init__(
        self,
        tree: KinematicTree,
        inertias: LinkInertias,
        coulomb: np.ndarray,
        dt: float,
        payload: Payload | None = None,
    ) -> None:
        """Load the arm; `coulomb`: (n,) N m friction; `dt`: s; `payload`: for `take_payload`."""
        self._payload = payload
        self._client = pybullet.connect(pybullet.DIRECT)
        self._id = {"physicsClientId": self._client}
        pybullet.setGravity(*tree.gravity, **self._id)
        pybullet.setTimeStep(dt, **self._id)
        if coulomb.any():
            pybullet.setPhysicsEngineParameter(
                numSolverIterations=SOLVER_ITERATIONS, solverResidualThreshold=0.0, **self._id
            )
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "arm.urdf"
            file.write_text(arm_urdf(tree, inertias, payload))
            # without the flag, Bullet computes inertias from collision shapes
            flags = pybullet.URDF_USE_INERTIA_FROM_FILE
            self._body = pybullet.loadURDF(str(file), useFixedBase=True, flags=flags, **self._id)
        infos = [
            pybullet.getJointInfo(self._body, joint, **self._id)
            for joint in range(pybullet.getNumJoints(self._body, **self._id))
        ]
        places = {info[1].decode(): joint for joint, info in enumerate(infos)}
        self._joints = [places[_joint_name(number)] for number in range(len(tree.names))]
        # by default, Bullet damps bodies and limits joint velocities
        free = {"linearDamping": 0, "angularDamping": 0, "jointDamping": 0, "maxJointVelocity": 1e9}
        for link in range(-1, len(infos)):
            pybullet.changeDynamics(self._body, link, **free, **self._id)
        for joint, mass, inertia in zip(self._joints, inertias.mass, inertias.inertia, strict=True):
            self._set_inertia(joint, float(mass), _principal(inertia)[0].tolist())
        if payload is not None:
            self._payload_link = places[_PAYLOAD]
            self._set_inertia(self._payload_link, 0.0, [0.0] * 3)
        # needed even without friction: by default, joint motors brake
        motors = {"targetVelocities": [0.0] * len(self._joints), "forces": coulomb.tolist()} | self._id
        pybullet.setJointMotorControlArray(self._body, self._joints, pybullet.VELOCITY_CONTROL, **motors)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pybullet.disconnect(self._client)

    def place(self, q: np.ndarray, qd: np.ndarray) -> None:
        """Set joint positions and velocities, (n,) each."""
        for joint, position, velocity in zip(self._joints, q.tolist(), qd.tolist(), strict=True):
            pybullet.resetJointState(self._body, joint, position, velocity, **self._id)

    def take_payload(self) -> None:
        """Attach the payload to the last link."""
        assert self._payload is not None, "the arm was made without one"
        self._set_inertia(self._payload_link, self._payload.mass_kg, [self._payload.inertia] * 3)

    def step(self, torques: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (n,) after a step with torques (n,) N m."""
        pybullet.setJointMotorControlArray(
            self._body, self._joints, pybullet.TORQUE_CONTROL, forces=torques.tolist(), **self._id
        )
        pybullet.stepSimulation(**self._id)
        states = pybullet.getJointStates(self._body, self._joints, **self._id)
        return np.array([state[0] for state in states]), np.array([state[1] for state in states])

    def _set_inertia(self, link: int, mass: float, moments: list[float]) -> None:
        pybullet.changeDynamics(self._body, link, mass=mass, localInertiaDiagonal=moments, **self._id)


def arm_urdf(tree: KinematicTree, inertias: LinkInertias, payload: Payload | None = None) -> str:
    """URDF of an arm without shapes and limits; masses and moments are 1 and set after loading.

    Inertial frames are principal axes, since Bullet diagonalises to six digits only; its reader replaces
    physically inconsistent moments by zero. Joint limits would add a constraint each to every step.
    """
    parts = [_link("base", np.zeros(3), np.eye(3))]
    for number in range(len(tree.names)):
        centre = inertias.first_moment[number] / inertias.mass[number]
        parent = tree.parents[number]
        kind = "prismatic" if tree.prismatic[number] else "revolute"
        parts += [
            _link(f"link_{number}", centre, _principal(inertias.inertia[number])[1]),
            f'<joint name="{_joint_name(number)}" type="{kind}">'
            f'<parent link="{"base" if parent < 0 else f"link_{parent}"}"/><child link="link_{number}"/>'
            f"{_origin(tree.translation[number], tree.rotation[number])}"
            f'<axis xyz="{_numbers(tree.axis[number])}"/>'
            # upper below lower means no limit
            '<limit lower="1" upper="-1" effort="1e9" velocity="1e9"/></joint>',
        ]
    if payload is not None:
        parts += [
            _link(_PAYLOAD, np.zeros(3), np.eye(3)),
            f'<joint name="{_PAYLOAD}" type="fixed"><parent link="link_{len(tree.names) - 1}"/>'
            f'<child link="{_PAYLOAD}"/>{_origin(np.array(payload.point_m), np.eye(3))}</joint>',
        ]
    return '<robot name="arm">' + "\n".join(parts) + "</robot>"


def _joint_name(number: int) -> str:
    return f"joint_{number}"


def _link(name: str, centre: np.ndarray, axes: np.ndarray) -> str:
    return (
        f'<link name="{name}"><inertial>{_origin(centre, axes)}<mass value="1"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
    )


def _principal(inertia: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments (3,) of an inertia, and its principal axes as columns of a rotation (3, 3)."""
    moments, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0:
        axes[:, 0] = -axes[:, 0]
    return moments, axes


def _origin(translation: np.ndarray, rotation: np.ndarray) -> str:
    return f'<origin xyz="{_numbers(translation)}" rpy="{_numbers(_roll_pitch_yaw(rotation))}"/>'


def _roll_pitch_yaw(rotation: np.ndarray) -> np.ndarray:
    """URDF angles (3,) of a rotation, R = Rz(yaw) Ry(pitch) Rx(roll)."""
    level = float(np.hypot(rotation[0, 0], rotation[1, 0]))
    pitch = np.arctan2(-rotation[2, 0], level)
    if level < 1e-9:  # gimbal lock: set roll to zero
        return np.array([0.0, pitch, np.arctan2(-rotation[0, 1], rotation[1, 1])])
    roll = np.arctan2(rotation[2, 1], rotation[2, 2])
    return np.array([roll, pitch, np.arctan2(rotation[1, 0], rotation[0, 0])])


def _numbers(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)


LARGEST = {"joint position (rad)": 1e-7, "hand position (m)": 1e-6}
LARGEST |= {"joint torque (N m)": 1e-3, "electrodes (counts)": 1.0}
"""Allowed differences. The engines agree to 1e-13 m and 1e-11 N m; contact may amplify another processor's
rounding, up to one count."""


def differences(
    run: str, compiled: Mapping[str, np.ndarray], pybullet: Mapping[str, np.ndarray]
) -> pd.DataFrame:
    """Largest differences between signals (T, n) of the compiled engine and of PyBullet, one row per signal.

    Raises RuntimeError: a difference exceeds `LARGEST`, or one engine stopped earlier.
    """
    rows = []
    for signal, one in compiled.items():
        other, allowed = pybullet[signal], LARGEST[signal]
        if one.shape != other.shape:
            raise RuntimeError(f"{run}: the engines stopped at different ticks: {len(one)} and {len(other)}")
        largest = float(np.abs(one - other).max())
        if not largest <= allowed:
            raise RuntimeError(f"{run}: the engines differ in {signal} by {largest:g}, allowed: {allowed:g}")
        rows.append((run, signal, largest, allowed))
    return pd.DataFrame(rows, columns=["run", "signal", "largest_difference", "allowed"])
