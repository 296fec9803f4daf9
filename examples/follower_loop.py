"""The loop that makes a robot follow a skill, each millisecond, with its deadlines accounted for.

    python examples/follower_loop.py data/tasks/pick/skill/skill.safetensors       # after `structlearn check`

`FakeArm` has the shape of robots' own libraries, such as `readOnce` and `writeOnce` of pylibfranka and
`setJointPosition` of lbr_fri; franky plans by itself, from waypoints. A true arm has to be where it starts.
"""

import argparse
import time

import numpy as np

from structlearn.core.stage import run
from structlearn.feedback import Controller, read_skill
from structlearn.primitives.sequence import default_start
from structlearn.readers.urdf_file import urdf_path
from structlearn.rigid_body import Follower, read_arm

URDF, TIP = "franka_panda/panda.urdf", "panda_grasptarget"
FINGERS = ("panda_finger_joint1", "panda_finger_joint2")
REST = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.8])  # rad
DT = 1e-3  # s


class FakeArm:
    """Goes where it is told at once, and keeps the time as a robot does."""

    def __init__(self, joints: np.ndarray) -> None:
        self.joints, self.next = joints, time.perf_counter()

    def read(self) -> np.ndarray:
        """Joints in rad, at the next millisecond."""
        time.sleep(max(self.next - time.perf_counter(), 0.0))
        self.next += DT
        return self.joints

    def write(self, joints: np.ndarray) -> None:
        """Joints in rad, from now on."""
        self.joints = joints


def main(file: str) -> dict[str, float]:
    """Run a skill once; how long after its beginning a tick is done, and how many are so too late."""
    skill, done = read_skill(file), []
    controller, start = Controller(skill, 1.0 / DT), default_start(skill.primitives)
    controller.start(start.position, start.orientation)
    follower = Follower(read_arm(urdf_path(URDF), TIP, FINGERS), REST, DT, start.orientation is not None)
    arm = FakeArm(follower.start(start.position, start.orientation))
    while not controller.finished:
        arm.read()
        controller.tick(None)  # or the newest counts of the sensors
        arm.write(follower.step(controller.position, controller.orientation))
        done.append(1e3 * (time.perf_counter() - arm.next + DT))
    (median, most), missed = np.percentile(done, [50, 99]), np.count_nonzero(np.array(done) > 1e3 * DT)
    return {"ticks": len(done), "median (ms)": median, "99 % (ms)": most, "missed": missed}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", help="a skill")
    file = parser.parse_args().file
    run(lambda: print("\n".join(f"{name}: {value:.4g}" for name, value in main(file).items())), stage=False)
