"""A still of the robot that scrapes the tilted board, as one recorded moment of an execution has it."""

import numpy as np

from structlearn.core import quaternion
from structlearn.readers.demonstration import Demonstration
from structlearn.simulation.still import Solid, View, still
from structlearn.testbeds.scraping.world.layout import (
    CONTACT_M,
    EDGE_M,
    EDGE_WIDTH_M,
    FLAT_ORIENTATION,
    GRASP_M,
    ROLL_AXIS,
)

ARM = "kuka_iiwa/model.urdf"  # Of the arm with its meshes, among the data that PyBullet brings
BOARD_M = np.array([0.10, 0.18, 0.006])
BENCH_M = np.array([0.16, 0.24, 0.02])
PALM_M, FINGER_M, BLADE_M = np.array([0.07, 0.09, 0.04]), np.array([0.018, 0.02, 0.055]), 0.003
"""Sizes of what is drawn as boxes; the simulation knows their masses and contacts, not their shapes."""

WOOD, STEEL, SKIN, TOOL = (
    *((0.84, 0.76, 0.62, 1.0), (0.45, 0.48, 0.52, 1.0)),
    *((0.30, 0.33, 0.37, 1.0), (0.84, 0.37, 0.0, 1.0)),
)
VIEW = View(target=(0.36, -0.02, 0.29), distance=1.55, yaw_deg=34.0, pitch_deg=-16.0)


def scraping_still(run: Demonstration, board_deg: float) -> np.ndarray:
    """The robot in the middle of its last primitive.

    `run`: an execution with joint positions, orientation, tool-to-board orientation and segments. Returns
    (H, W, 3) bytes.
    """
    moment = round(float(run.signal("true_segments")[-1].mean()) / run.dt)
    board = quaternion.from_rotation_vector(np.radians(board_deg) * ROLL_AXIS)
    down = np.array([0.0, 0.0, 1.0])
    hand = run.signal("orientation")[moment]
    grasp = run.position[moment] - EDGE_M * quaternion.rotate(hand, down)
    tool = quaternion.product(
        quaternion.product(board, run.signal("tool_to_board")[moment]), FLAT_ORIENTATION
    )

    def held(size: np.ndarray, offset: tuple[float, float, float], turn: np.ndarray, colour: tuple) -> Solid:
        """A box that is fixed to the hand or the tool, `offset` from the grasp."""
        return Solid("box", size / 2, grasp + quaternion.rotate(turn, np.array(offset)), turn, colour)

    below = CONTACT_M - quaternion.rotate(board, 0.5 * BOARD_M[2] * down)
    base = CONTACT_M[:2].tolist()
    solids = [
        Solid("box", BOARD_M / 2, below, board, WOOD),
        Solid("cylinder", (0.012, 0.07), (*base, 0.055), colour=STEEL),
        Solid("box", BENCH_M / 2, (*base, 0.01), colour=STEEL),
        held(PALM_M, (0.0, 0.0, -GRASP_M - 0.02), hand, SKIN),
        held(FINGER_M, (0.016, 0.0, -0.02), hand, SKIN),
        held(FINGER_M, (-0.016, 0.0, -0.02), hand, SKIN),
        held(np.array([EDGE_WIDTH_M, BLADE_M * 4, EDGE_M + 0.015]), (0.0, 0.0, EDGE_M / 2), tool, TOOL),
    ]
    return still(VIEW, solids, ARM, run.signal("joint_positions")[moment])
