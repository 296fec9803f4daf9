"""Run a skill behind a ROS 2 Cartesian controller that follows `target_pose`, such as crisp_controllers.

    python examples/ros2_node.py skill.safetensors --ros-args -r wrench:=/ft_sensor/wrench

Starts where the robot is, publishes a target at every tick, and stops when pose or wrench are stale.
"""

import argparse
import sys

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.node import Node

from structlearn.core.errors import InputError
from structlearn.feedback import Controller, Status, read_skill

RATE_HZ, STALE_S = 250.0, 0.1


class SkillNode(Node):
    """Publishes the poses of a skill as `target_pose`; `done` says why it ended, empty before."""

    def __init__(self, file: str) -> None:
        super().__init__("structlearn_skill")
        skill = read_skill(file)
        self.controller, self.started, self.done = Controller(skill, RATE_HZ), False, ""
        self.heard = dict.fromkeys(["pose", "wrench"] if skill.channels else ["pose"], -np.inf)
        self.create_subscription(PoseStamped, "current_pose", lambda one: self.hear("pose", one), 10)
        self.create_subscription(WrenchStamped, "wrench", lambda one: self.hear("wrench", one), 10)
        self.target = self.create_publisher(PoseStamped, "target_pose", 10)
        self.timer = self.create_timer(1.0 / RATE_HZ, self.tick)
        self.newest: dict[str, PoseStamped | WrenchStamped] = {}

    def hear(self, name: str, message: PoseStamped | WrenchStamped) -> None:
        """Keep the newest message, and when it came."""
        self.newest[name], self.heard[name] = message, self.now()

    def now(self) -> float:
        """Seconds of the node's clock."""
        return self.get_clock().now().nanoseconds * 1e-9

    def tick(self) -> None:
        """Publish the next target; messages have quaternions x, y, z, w, here they are taken by name."""
        stale = [name for name, time in self.heard.items() if self.now() - time > STALE_S]
        if not self.started and not stale:
            pose = self.newest["pose"].pose
            self.controller.start(numbers(pose.position, "xyz"), numbers(pose.orientation, "wxyz"))
            self.started = True
        if self.started and not self.done:
            felt = self.newest.pop("wrench", None)  # each reading once
            felt = felt and np.concatenate([numbers(felt.wrench.force), numbers(felt.wrench.torque)])
            flags, target = self.controller.tick(felt), PoseStamped()
            target.header = self.newest["pose"].header
            for part, axes in (("position", "xyz"), ("orientation", "wxyz")):
                for axis, value in zip(axes, getattr(self.controller, part), strict=True):
                    setattr(getattr(target.pose, part), axis, float(value))
            stale = stale or ["wrench"] * bool(flags & Status.STALE)
            if not stale:
                self.target.publish(target)
            self.done = f"stopped, stale: {stale[0]}" if stale else "finished" * self.controller.finished


def numbers(message: object, axes: str = "xyz") -> np.ndarray:
    """Components of a vector or quaternion."""
    return np.array([getattr(message, axis) for axis in axes])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", help="a skill")
    file = parser.parse_args(rclpy.utilities.remove_ros_args(sys.argv)[1:]).file
    rclpy.init(args=sys.argv)
    try:
        node = SkillNode(file)
    except InputError as error:
        sys.exit(f"error: {error}")
    while not node.done:
        rclpy.spin_once(node)
    print(node.done)
