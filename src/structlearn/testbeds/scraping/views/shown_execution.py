"""Executions on the board that recordings show: the first of each kind in every setting, and their plots."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
import rerun as rr
import rerun.blueprint as rrb

from structlearn.core import quaternion
from structlearn.feedback.coupling_dataset import to_table
from structlearn.feedback.feedback_models import POINTWISE
from structlearn.palette import GREY, Look
from structlearn.readers.demonstration import Demonstration
from structlearn.testbeds.scraping.files import CLOSED_LOOP, CORRECTIONS, REFINED, ScrapingFiles
from structlearn.testbeds.scraping.names import CORRECTED, RUNS
from structlearn.testbeds.scraping.protocol.execution_scores import (
    AFTER,
    BEFORE,
    NOMINAL,
    nominal_orientation,
    orientation_cost,
)
from structlearn.testbeds.scraping.world.layout import EDGE_M, FLAT_ORIENTATION, ROLL_AXIS
from structlearn.viewer.rrd import entity, plot, send_curve, thinning

RATE_HZ = 50.0  # Poses, colours and samples of signals per second: smooth to the eye; they are most of a file
HEADINGS = {
    "roll on board": "roll of the tool on the board (degrees; 0 is flat)",
    "hand roll": "roll of the hand (degrees; grey: of the board)",
    "coupling": "coupling term (rad)",
    "cost": "cost: tool off its nominal orientation (rad)",
    "force": "force on the board (N)",
    "torque": "roll torque of the board (mN m)",
}
"""Signals by name; the cost takes the place of the force where it is known."""


@dataclass(frozen=True)
class Execution:
    """One run on the board, and what the feedback saw and did in it."""

    look: Look  # name and colour of what kind of run it is
    run: Demonstration  # with orientation, joint positions, wrench, tool-to-board orientation and segments
    board_deg: float  # roll of the board
    primitives: Sequence[str]  # names, in order of `run.true_segments`
    # what was felt and done in the primitives with feedback, columns `primitive`, `time_s` since its start,
    # `coupling` (rad, about the roll axis) and `channel_00` ... (counts, what the electrodes read minus what
    # they read in nominal runs).
    traces: pd.DataFrame
    # (C,) rad, of the first C <= T samples of the run (eq. IV.34); None where it is not shown.
    cost: np.ndarray | None = None

    @property
    def kept(self) -> slice:
        """Samples of the run that are shown."""
        return slice(None, None, thinning(self.run.dt, RATE_HZ))

    @cached_property
    def felt(self) -> pd.DataFrame:
        """(S, ...) the traces in order of time, with `time_s` since the start of the run."""
        starts = dict(zip(self.primitives, self.run.signal("true_segments")[:, 0], strict=True))
        since_start = self.traces["time_s"] + self.traces["primitive"].map(starts)
        return self.traces.assign(time_s=since_start).sort_values("time_s", kind="stable")

    @property
    def deviation(self) -> np.ndarray:
        """(S, 38) counts, what the electrodes read minus what they read in nominal runs."""
        return self.felt.filter(regex="^channel_").to_numpy(float)

    @property
    def tool_orientation(self) -> np.ndarray:
        """(T, 4) of the tool, base frame."""
        turned = quaternion.product(self.board_orientation, self.run.signal("tool_to_board"))
        return quaternion.product(turned, FLAT_ORIENTATION)

    @property
    def board_orientation(self) -> np.ndarray:
        """(4,) of the board, base frame."""
        return quaternion.from_rotation_vector(np.radians(self.board_deg) * ROLL_AXIS)

    @property
    def grasp(self) -> np.ndarray:
        """(T, 3) m, middle between the finger tips."""
        down = quaternion.rotate(self.run.signal("orientation"), np.array([0.0, 0.0, 1.0]))
        return self.run.position - EDGE_M * down

    @property
    def roll_on_board(self) -> np.ndarray:
        """(T,) degrees, roll of the tool relative to the board; 0 when flat."""
        return np.degrees(quaternion.rotation_vector(self.run.signal("tool_to_board")) @ ROLL_AXIS)

    @property
    def hand_roll(self) -> np.ndarray:
        """(T,) degrees, roll of the hand relative to fingers straight down."""
        return np.degrees(quaternion.difference(self.run.signal("orientation"), FLAT_ORIENTATION) @ ROLL_AXIS)

    @property
    def signals(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Plotted signals by name as in `HEADINGS`: times (N,) in s, and values (N,)."""
        run, kept, wrench = self.run, self.kept, self.run.signal("wrench")
        before = run.time[:1]  # without feedback, so that all plots begin together
        signals = {
            "roll on board": (run.time[kept], self.roll_on_board[kept]),
            "hand roll": (run.time[kept], self.hand_roll[kept]),
            "coupling": (np.append(before, self.felt["time_s"]), np.append(0.0, self.felt["coupling"])),
        }
        if self.cost is None:
            signals["force"] = (run.time[kept], -wrench[kept, 2])
        else:
            signals["cost"] = (run.time[: len(self.cost)][kept], self.cost[kept])
        return signals | {"torque": (run.time[kept], -1e3 * wrench[kept, 3:] @ ROLL_AXIS)}


def send_signals(
    stream: rr.RecordingStream, parent: str, executions: Sequence[Execution]
) -> list[rrb.TimeSeriesView]:
    """Log the signals of executions in one setting below a parent, and the roll that the hand is to reach."""
    for one in executions:
        for kind, (times, values) in one.signals.items():
            send_curve(
                stream, entity(parent, kind, one.look.name), times, values, one.look.name, one.look.colour
            )
    board = entity(parent, "hand roll", "board")
    send_curve(stream, board, one.run.time[[0, -1]], np.full(2, one.board_deg), "board", GREY)
    return [plot(HEADINGS[kind], [f"{entity(parent, kind)}/**"], legend=False) for kind in one.signals]


NEEDED = ("orientation", "joint_positions", "wrench", "tool_to_board", "true_segments")
"""Of a run that is shown."""

FEEDBACK_RUNS = {
    NOMINAL: (CLOSED_LOOP, NOMINAL),
    CORRECTED: (CORRECTIONS, ""),
    POINTWISE: (CLOSED_LOOP, POINTWISE),  # trained as in the dissertation
}
REFINED_RUNS = {model: (REFINED, model) for model in (NOMINAL, BEFORE, AFTER)}
"""Where the runs lie that a recording puts beside each other, for `ScrapingFiles.runs_at`."""


def read_feedback_runs(files: ScrapingFiles) -> dict[float, list[Execution]]:
    """The first nominal, corrected and closed-loop run of every setting that has all three.

    Returns by roll of the board in degrees, the largest first; empty where nothing was executed. Raises
    InputError: a file is not readable.
    """
    traces = files.table("traces")
    if traces.empty:
        return {}
    corrected = [to_table(dataset).assign(primitive=name) for name, dataset in files.datasets().items()]
    targets = pd.concat(corrected).query("demonstration == 0").rename(columns={"target": "coupling"})
    return _read(files, FEEDBACK_RUNS, pd.concat([_first_runs(traces), targets.assign(model=CORRECTED)]))


def read_refined_runs(files: ScrapingFiles) -> dict[float, list[Execution]]:
    """The first run without feedback, before and after refinement by trial of every setting, with its cost.

    Returns, raises:
        As `read_feedback_runs`.
    """
    traces = files.table("refined_traces")
    if traces.empty:
        return {}
    return _read(files, REFINED_RUNS, _first_runs(traces), nominal_orientation(files.runs("unrolls")))


def _first_runs(traces: pd.DataFrame) -> pd.DataFrame:
    return traces[traces["run"] == traces["run"].min()]


def _read(
    files: ScrapingFiles,
    places: Mapping[str, tuple[str, str]],
    traces: pd.DataFrame,
    nominal: np.ndarray | None = None,
) -> dict[float, list[Execution]]:
    """Executions of the settings that have a complete run of every kind, with cost if nominal is known."""
    primitives = [primitive.name for primitive in files.primitives()]
    shown = {}
    for setting in sorted(traces["setting_deg"].unique(), reverse=True):
        found = {
            kind: run
            for kind, (folder, model) in places.items()
            for run in files.runs_at(setting, folder, model)[:1]
            if all(getattr(run, name) is not None for name in NEEDED)
        }
        if len(found) == len(places):
            felt = dict(iter(traces[traces["setting_deg"] == setting].groupby("model")))
            shown[float(setting)] = [
                Execution(
                    RUNS[kind],
                    run,
                    float(setting),
                    primitives,
                    felt[kind],
                    None if nominal is None else orientation_cost(run, nominal),
                )
                for kind, run in found.items()
            ]
    return shown
