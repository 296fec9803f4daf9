"""PyBullet as the other engine of the scraping testbed: same robot, same loads, its own integration."""

import re
import tempfile
from pathlib import Path
from typing import Self

import numpy as np
import pybullet

from structlearn.rigid_body.compiled_chain import kinematics
from structlearn.testbeds.scraping.world import scraping_robot
from structlearn.testbeds.scraping.world.scraping_robot import GRAVITY
from structlearn.testbeds.scraping.world.scraping_world import World, load


class Bullet:
    """Moves a world. Use as a context manager: PyBullet's server is closed at the end."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._client = pybullet.connect(pybullet.DIRECT)
        pybullet.setGravity(0.0, 0.0, -GRAVITY, physicsClientId=self._client)
        pybullet.setTimeStep(world.dt, physicsClientId=self._client)
        self._body, self._joints = load_robot(self._client)
        for joint, angle, speed in zip(self._joints, world.q, world.v, strict=True):
            pybullet.resetJointState(self._body, joint, angle, speed, physicsClientId=self._client)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pybullet.disconnect(self._client)

    def advance(self, torques: np.ndarray) -> None:
        """As `scraping_world.advance`."""
        world = self._world
        for _ in range(world.substeps):
            load(world, torques)
            pybullet.setJointMotorControlArray(
                self._body,
                self._joints,
                pybullet.TORQUE_CONTROL,
                forces=world.torques.tolist(),
                physicsClientId=self._client,
            )
            pybullet.stepSimulation(physicsClientId=self._client)
            states = pybullet.getJointStates(self._body, self._joints, physicsClientId=self._client)
            world.q[:] = [state[0] for state in states]
            world.v[:] = [state[1] for state in states]
            kinematics(world.body, world.q, world.work)


def load_robot(client: int) -> tuple[int, list[int]]:
    """Load the robot into a PyBullet client, all joints free of motors, friction and damping.

    Returns:
        The body, and its thirteen movable joints: arm, then grasp.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scraping_robot.urdf"
        # Bullet solves a constraint for every joint with limits in every step, which doubles the cost of a
        # step; the task stays far from them. An upper limit below the lower one means none.
        file.write_text(re.sub(r'lower="[^"]*" upper="[^"]*"', 'lower="1" upper="-1"', scraping_robot.urdf()))
        body = pybullet.loadURDF(
            str(file), useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE, physicsClientId=client
        )  # without the flag Bullet makes up inertias from collision shapes
    joints = []
    for joint in range(-1, pybullet.getNumJoints(body, physicsClientId=client)):
        pybullet.changeDynamics(
            body, joint, linearDamping=0, angularDamping=0, jointDamping=0, physicsClientId=client
        )
        if (
            joint >= 0
            and pybullet.getJointInfo(body, joint, physicsClientId=client)[2] != pybullet.JOINT_FIXED
        ):
            joints.append(joint)
    pybullet.setJointMotorControlArray(
        body, joints, pybullet.VELOCITY_CONTROL, forces=[0.0] * len(joints), physicsClientId=client
    )
    return body, joints
