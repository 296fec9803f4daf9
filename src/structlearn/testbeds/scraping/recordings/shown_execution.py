"""One execution on the board for recordings: the run, what its feedback saw and did, and its plots."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
import rerun as rr
import rerun.blueprint as rrb

from structlearn.ground import quaternion
from structlearn.palette import GREY
from structlearn.recordings.demonstration import Demonstration
from structlearn.testbeds.scraping.world.layout import EDGE_M, FLAT_ORIENTATION, ROLL_AXIS
from structlearn.viewer.rrd import entity, plot, send_series, time_column

HEADINGS = {
    "roll on board": "roll of the tool on the board (degrees; 0 is flat)",
    "hand roll": "roll of the hand (degrees; grey: of the board)",
    "coupling": "coupling term (in corrections: its target)",
    "force": "force on the board (N)",
    "torque": "roll torque of the board (mN m)",
}
"""Signals of every execution, by name."""


@dataclass(frozen=True)
class Execution:
    """One run on the board, and what the feedback saw and did in it.

    Attributes:
        label: what kind of run it is.
        run: with orientation, joint positions, wrench, tool-to-board orientation and segments.
        board_deg: roll of the board.
        primitives: names, in order of `run.true_segments`.
        time: (S,) s since the start of the run, of the samples below.
        coupling: (S,) coupling term about the roll axis.
        deviation: (S, 38) counts, what the electrodes read minus what they read in nominal runs.
        cost: (C,) rad, of the first C <= T samples of the run (eq. IV.34); None where it is not shown.
    """

    label: str
    run: Demonstration
    board_deg: float
    primitives: Sequence[str]
    time: np.ndarray
    coupling: np.ndarray
    deviation: np.ndarray
    cost: np.ndarray | None = None

    @property
    def tool_orientation(self) -> np.ndarray:
        """(T, 4) of the tool, base frame."""
        turned = quaternion.product(self.board_orientation, self.run.tool_to_board)
        return quaternion.product(turned, FLAT_ORIENTATION)

    @property
    def board_orientation(self) -> np.ndarray:
        """(4,) of the board, base frame."""
        return quaternion.from_rotation_vector(np.radians(self.board_deg) * ROLL_AXIS)

    @property
    def grasp(self) -> np.ndarray:
        """(T, 3) m, middle between the finger tips."""
        return self.run.position - EDGE_M * quaternion.rotate(self.run.orientation, np.array([0.0, 0.0, 1.0]))

    @property
    def roll_on_board(self) -> np.ndarray:
        """(T,) degrees, roll of the tool relative to the board; 0 when flat."""
        return np.degrees(quaternion.rotation_vector(self.run.tool_to_board) @ ROLL_AXIS)

    @property
    def hand_roll(self) -> np.ndarray:
        """(T,) degrees, roll of the hand relative to fingers straight down."""
        return np.degrees(quaternion.difference(self.run.orientation, FLAT_ORIENTATION) @ ROLL_AXIS)


def execution(
    label: str,
    run: Demonstration,
    board_deg: float,
    primitives: Sequence[str],
    traces: Mapping[str, pd.DataFrame],
    cost: np.ndarray | None = None,
) -> Execution:
    """A run with the traces of its primitives joined on its own clock.

    Args:
        label: what kind of run it is.
        run: with segments of all primitives.
        board_deg: roll of the board.
        primitives: names in order of time.
        traces: by primitive, columns `time_s` since its start, `coupling` and `channel_00` ...; primitives
            without feedback have none.
        cost: see `Execution`.
    """
    starts = dict(zip(primitives, run.true_segments[:, 0], strict=True))
    felt = [name for name in primitives if name in traces]
    joined = pd.concat([traces[name].assign(time_s=traces[name]["time_s"] + starts[name]) for name in felt])
    channels = [name for name in joined.columns if name.startswith("channel_")]
    return Execution(
        label,
        run,
        board_deg,
        tuple(primitives),
        joined["time_s"].to_numpy(float),
        joined["coupling"].to_numpy(float),
        joined[channels].to_numpy(float),
        cost,
    )


def send_signals(
    stream: rr.RecordingStream,
    parent: str,
    one: Execution,
    kept: slice,
    colour: str,
    kinds: Iterable[str] = HEADINGS,
) -> None:
    """Log signals of an execution below a parent; `kinds` as in `HEADINGS`, or "cost" where it is known."""
    signals = _signals(one, kept)
    for kind in kinds:
        times, values = signals[kind]
        curve = entity(parent, kind, one.label)
        send_series(stream, curve, [time_column(times)], values[:, None], [one.label], [colour])


def send_board_roll(stream: rr.RecordingStream, parent: str, one: Execution) -> None:
    """Log the roll that the hand should reach."""
    ends = [time_column(one.run.time[[0, -1]])]
    rolls = np.full((2, 1), one.board_deg)
    send_series(stream, entity(parent, "hand roll", "board"), ends, rolls, ["board"], [GREY])


def signal_plots(parent: str, headings: Mapping[str, str] = HEADINGS) -> list[rrb.TimeSeriesView]:
    """Plots of what `send_signals` and `send_board_roll` log below a parent, with headings by kind."""
    return [plot(heading, [f"{entity(parent, kind)}/**"], legend=False) for kind, heading in headings.items()]


def _signals(one: Execution, kept: slice) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Plotted signals by name: times in s, and values of equal shape (T,)."""
    times, run = one.run.time[kept], one.run
    before = one.run.time[:1]  # without feedback, so that all plots begin together
    cost = np.empty(0) if one.cost is None else one.cost
    return {
        "roll on board": (times, one.roll_on_board[kept]),
        "hand roll": (times, one.hand_roll[kept]),
        "coupling": (np.append(before, one.time), np.append(0.0, one.coupling)),
        "cost": (run.time[: len(cost)][kept], cost[kept]),
        "force": (times, -run.wrench[kept, 2]),
        "torque": (times, -1e3 * run.wrench[kept, 3:] @ ROLL_AXIS),
    }
