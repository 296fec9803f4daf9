"""Run a skill in PyBullet at 1 kHz beside the true time: a Franka Panda follows by inverse kinematics.

    python examples/pybullet_1khz.py data/tasks/pick/skill/skill.safetensors      # --gui shows it

Every millisecond: a pose from the controller, joints for it, a step of the physics, and a wait for the clock.
"""

import argparse
import time

import numpy as np
import pybullet

from structlearn.core.stage import run
from structlearn.feedback import Controller, read_skill
from structlearn.primitives.sequence import default_start
from structlearn.readers.urdf_file import urdf_path
from structlearn.rigid_body import Follower, read_arm

URDF, TIP = "franka_panda/panda.urdf", "panda_grasptarget"
FINGERS = ("panda_finger_joint1", "panda_finger_joint2")
REST = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.8])  # rad
DT = 1e-3  # s


def main(file: str, gui: bool = False) -> dict[str, float]:
    """Run a skill once; how late its ticks are, and how far the arm is from where it should be."""
    skill = read_skill(file)
    controller, start = Controller(skill, rate_hz=1.0 / DT), default_start(skill.primitives)
    controller.start(start.position, start.orientation)
    follower = Follower(read_arm(urdf_path(URDF), TIP, FINGERS), REST, DT, start.orientation is not None)
    joints = follower.start(start.position, start.orientation)
    client = pybullet.connect(pybullet.GUI if gui else pybullet.DIRECT)
    pybullet.setTimeStep(DT)
    robot = pybullet.loadURDF(str(urdf_path(URDF)), useFixedBase=True)
    infos = [pybullet.getJointInfo(robot, joint) for joint in range(pybullet.getNumJoints(robot))]
    tip = [info[12].decode() for info in infos].index(TIP)
    for joint, angle in enumerate(joints):  # the arm's joints are the first
        pybullet.resetJointState(robot, joint, angle)
    began, late, off = time.perf_counter(), [], []
    while not controller.finished:
        controller.tick(None)  # or the newest counts of the sensors
        before, joints = joints, follower.step(controller.position, controller.orientation)
        velocities, mode = (joints - before) / DT, pybullet.POSITION_CONTROL
        pybullet.setJointMotorControlArray(robot, range(len(REST)), mode, joints, velocities)
        pybullet.stepSimulation()
        off.append(np.linalg.norm(pybullet.getLinkState(robot, tip)[4] - controller.position))
        left = began + len(off) * DT - time.perf_counter()
        late.append(max(-left, 0.0))
        time.sleep(max(left, 0.0))
    pybullet.disconnect(client)
    lag = {"largest lag (ms)": 1e3 * max(late), "lag at the end (ms)": 1e3 * late[-1]}
    return {"ticks": len(late), "late": np.count_nonzero(late)} | lag | {"tip off (mm)": 1e3 * max(off)}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", help="a skill")
    parser.add_argument("--gui", action="store_true", help="show it")
    given = parser.parse_args()
    run(
        lambda: print("\n".join(f"{name}: {value:.4g}" for name, value in main(**vars(given)).items())),
        stage=False,
    )
