"""PyBullet instead of the compiled loop: same robot, same loads, its own integration."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from structlearn.rigid_body.compiled_chain import kinematics
from structlearn.simulation.bullet_arm import BulletArm
from structlearn.testbeds.scraping.world.execution import Advance
from structlearn.testbeds.scraping.world.scraping_robot import whole
from structlearn.testbeds.scraping.world.scraping_world import World, load


@contextmanager
def in_pybullet(world: World) -> Iterator[Advance]:
    """What `scraping_world.advance` does, with PyBullet integrating the motion; for `execution.execute`."""
    robot = whole()
    with BulletArm(robot.tree, robot.inertias, np.zeros(len(world.q)), world.dt) as arm:
        arm.place(world.q, world.v)

        def advance(torques: np.ndarray) -> None:
            for _ in range(world.substeps):
                load(world, torques)
                world.q[:], world.v[:] = arm.step(world.torques)
                kinematics(world.body, world.q, world.work)

        yield advance
