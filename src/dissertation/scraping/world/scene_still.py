"""Images of the robot scraping the tilted board: a still of one run, and a loop of two runs side by side."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from dissertation.scraping.world import layout
from dissertation.simulation.still import Solid, View, still
from structlearn.core import quaternion
from structlearn.core.parallel import parallel_map
from structlearn.palette import BLACK, Look
from structlearn.readers.demonstration import Demonstration

ARM = "kuka_iiwa/model.urdf"  # with meshes, in PyBullet's data folder
BOARD_M = np.array([0.10, 0.18, 0.006])
BENCH_M = np.array([0.16, 0.24, 0.02])
TIP_M = 0.0075  # of the fingers, beyond the grasp
PALM_M, FINGER_M = np.array([0.07, 0.09, 0.065]), np.array([0.018, 0.02, layout.GRASP_M + TIP_M])
BLADE_M = 0.003
"""Sizes of parts drawn as boxes; the simulation only has their masses and contacts."""

WOOD, STEEL, SKIN, TOOL = (
    *((0.84, 0.76, 0.62, 1.0), (0.45, 0.48, 0.52, 1.0)),
    *((0.30, 0.33, 0.37, 1.0), (0.84, 0.37, 0.0, 1.0)),
)
VIEW = View(target=(0.36, -0.02, 0.29), distance=1.55, yaw_deg=34.0, pitch_deg=-16.0)

CLOSE = View(target=(0.63, -0.02, 0.135), distance=0.5, yaw_deg=12.0, pitch_deg=-9.0)
"""View along the scraping direction, in which the tool's roll on the board is visible."""

PANEL, WORDS = (420, 380), 72  # pixels of one run in the loop, and of the text above it
TILT_S, HOLD_S = 0.8, 0.8  # duration of the board's tilt before the run, and of the pause after it
FRAMES_PER_S, SPEED = 12, 3.0  # of the loop; speed-up over real time
QUALITY = 70  # of WebP: the largest with a loop safely below 1 MB


def scraping_still(run: Demonstration, board_deg: float) -> np.ndarray:
    """Image (H, W, 3) uint8 of the robot in the middle of its last primitive.

    `run`: an execution with joint positions, orientation, tool-to-board orientation and segments.
    """
    moment = round(float(run.signal("true_segments")[-1].mean()) / run.dt)
    return still(VIEW, _solids(run, moment, board_deg), ARM, run.signal("joint_positions")[moment])


def write_loop(path: Path, runs: Sequence[tuple[Look, Demonstration]], board_deg: float) -> None:
    """Write an animated WebP: the board tilts, then the runs are executed side by side, in close-up.

    It begins in the middle of the last primitive, where the runs differ: viewers that do not play it, and
    readers who look once, see that.
    """
    frames = round(TILT_S * FRAMES_PER_S)
    last = round(float(runs[0][1].signal("true_segments")[-1, 1]) / runs[0][1].dt)
    step = round(SPEED / FRAMES_PER_S / runs[0][1].dt)
    tilts = [0.5 - 0.5 * np.cos(np.pi * frame / frames) for frame in range(frames)]  # eased in and out
    moments = [(0, tilt * board_deg) for tilt in tilts]
    moments += [(moment, board_deg) for moment in range(0, last + 1, step)]
    drawn = partial(_frame, runs=runs, board_deg=board_deg)
    durations = [round(1000 / FRAMES_PER_S)] * (len(moments) - 1) + [round(1000 * HOLD_S)]
    telling = round(float(runs[0][1].signal("true_segments")[-1].mean()) / runs[0][1].dt)
    start = int(np.argmin([abs(moment - telling) for moment, _ in moments]))
    moments = moments[start:] + moments[:start]
    durations = durations[start:] + durations[:start]
    first, *others = parallel_map(drawn, moments, "frames of the loop", local=True)
    first.save(path, "WEBP", save_all=True, append_images=others, duration=durations, loop=0, quality=QUALITY)


def _frame(
    moment: tuple[int, float], runs: Sequence[tuple[Look, Demonstration]], board_deg: float
) -> Image.Image:
    """Frame of all runs at a moment: sample index, and tilt in degrees at which the board is drawn."""
    sample, drawn_deg = moment
    frame = Image.new("RGB", (len(runs) * PANEL[0], WORDS + PANEL[1]), "white")
    pen, font = ImageDraw.Draw(frame), ImageFont.load_default(21)
    board = layout.board_orientation(board_deg - drawn_deg)
    for place, (look, run) in enumerate(runs):
        solids = _solids(run, sample, board_deg, drawn_deg)
        picture = still(CLOSE, solids, ARM, run.signal("joint_positions")[sample], size=PANEL)
        left = place * PANEL[0]
        frame.paste(Image.fromarray(picture), (left, WORDS))
        tool = quaternion.product(board, run.signal("tool_to_board")[sample])
        off = abs(np.degrees(quaternion.rotation_vector(tool) @ layout.ROLL_AXIS))
        pen.text((left + 14, 10), look.name, look.colour, font)
        pen.text((left + 14, 38), f"tool {off:.0f}\N{DEGREE SIGN} from flat", BLACK, font)
    return frame


def _solids(run: Demonstration, moment: int, board_deg: float, drawn_deg: float | None = None) -> list[Solid]:
    """Board, hand and tool at one sample of a run at tilt `board_deg`; the board may be drawn at another."""
    drawn = layout.board_orientation(board_deg if drawn_deg is None else drawn_deg)
    hand, tool = run.signal("orientation")[moment], layout.tool_orientation(run, board_deg)[moment]
    grasp = layout.grasp_place(run)[moment]

    def held(size: np.ndarray, offset: tuple[float, float, float], turn: np.ndarray, colour: tuple) -> Solid:
        """A box fixed to the hand or the tool, at `offset` from the grasp."""
        return Solid("box", size / 2, grasp + quaternion.rotate(turn, np.array(offset)), turn, colour)

    below = layout.CONTACT_M - quaternion.rotate(drawn, np.array([0.0, 0.0, 0.5 * BOARD_M[2]]))
    base = layout.CONTACT_M[:2].tolist()
    blade = np.array([layout.EDGE_WIDTH_M, BLADE_M * 4, layout.EDGE_M + 0.015])
    return [
        Solid("box", BOARD_M / 2, below, drawn, WOOD),
        Solid("cylinder", (0.012, 0.07), (*base, 0.055), colour=STEEL),
        Solid("box", BENCH_M / 2, (*base, 0.01), colour=STEEL),
        held(PALM_M, (0.0, 0.0, -layout.GRASP_M - 0.5 * PALM_M[2]), hand, SKIN),
        held(FINGER_M, (0.016, 0.0, TIP_M - 0.5 * FINGER_M[2]), hand, SKIN),
        held(FINGER_M, (-0.016, 0.0, TIP_M - 0.5 * FINGER_M[2]), hand, SKIN),
        held(blade, (0.0, 0.0, layout.EDGE_M / 2), tool, TOOL),
    ]
