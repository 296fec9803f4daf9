"""The loop that makes a robot follow a skill, each millisecond, with its deadlines accounted for.

    python examples/follower_loop.py data/own/pick/skill.safetensors

`FakeArm` has the shape of robots' own libraries: a read that waits for the robot and so sets the pace, and a
write. In pylibfranka they are `readOnce` and `writeOnce(JointPositions(...))` of what
`start_joint_position_control` gives; a client of lbr_fri has `setJointPosition` in its `command`. (franky plans
motions by itself: give it waypoints.) Run `make check` first, and bring the arm to the first joints beforehand.
"""

import sys
import time

import numpy as np

from structlearn.feedback.runtime import Controller, Status
from structlearn.feedback.skill import ReactiveSkill
from structlearn.feedback.skill_file import read_skill
from structlearn.primitives.sequence import default_start
from structlearn.rigid_body.inverse_kinematics import Follower, read_arm
from structlearn.simulation.arm import urdf_path

URDF, TIP = "franka_panda/panda.urdf", "panda_grasptarget"
FINGERS = ("panda_finger_joint1", "panda_finger_joint2")
REST = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.8])  # rad
DT = 1e-3  # s


class FakeArm:
    """Goes where it is told at once, and keeps the time as a robot does."""

    def __init__(self, joints: np.ndarray) -> None:
        self.joints, self.next = joints, time.perf_counter()

    def read(self) -> np.ndarray:
        """Wait for the next millisecond; joints in rad."""
        self.next += DT
        time.sleep(max(self.next - time.perf_counter(), 0.0))
        return self.joints

    def write(self, joints: np.ndarray) -> None:
        """Take joints in rad for this millisecond."""
        self.joints = joints


def main(skill: ReactiveSkill) -> dict[str, float]:
    """Run it once; how long the work of a tick takes, and how many deadlines it misses."""
    controller, start = Controller(skill, rate_hz=1.0 / DT), default_start(skill.primitives)
    controller.start(start.position, start.orientation)
    follower = Follower(read_arm(urdf_path(URDF), TIP, FINGERS), REST, DT, start.orientation is not None)
    arm, work, stale = FakeArm(follower.start(start.position, start.orientation)), [], 0
    while not controller.finished:
        arm.read()
        began = time.perf_counter()
        stale += bool(controller.tick(None) & Status.STALE)  # None: or the sensors' newest counts
        arm.write(follower.step(controller.position, controller.orientation))
        work.append(1e3 * (time.perf_counter() - began))
    median, most = np.percentile(work, [50, 99])
    missed = np.count_nonzero(np.array(work) > 1e3 * DT)
    return {"ticks": len(work), "median (ms)": median, "99 % (ms)": most, "missed": missed, "stale": stale}


if __name__ == "__main__":
    for name, value in main(read_skill(sys.argv[1])).items():
        print(f"{name}: {value:.3g}")
