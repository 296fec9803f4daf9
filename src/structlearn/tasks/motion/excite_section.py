"""The page of a trajectory that was designed to identify an arm from."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.core.params import Parameters
from structlearn.palette import BLUE, CATEGORICAL_COLOURS, GREY
from structlearn.reporting.document import Document, Source
from structlearn.reporting.figure_style import Drawing, legend, panel, styled
from structlearn.reporting.findings import Findings
from structlearn.reporting.publishing import publish_report
from structlearn.rigid_body.motion import Motion
from structlearn.tasks.shown_tables import shown


def publish_excitation(
    folder: Path,
    facts: Mapping[str, object],
    joints: pd.DataFrame,
    gains: pd.DataFrame,
    moved: tuple[np.ndarray, Motion],
    parameters: Parameters,
) -> None:
    """The page with its figures and tables."""
    find = Findings("random trajectories")
    find.exact("gain_median", gains["gain"].median(), len(gains), headline=True)
    find.exact("gain_least", gains["gain"].min(), len(gains), headline=True)
    find.among("joints").exact(
        "limits_kept", int((joints["kept"] == "yes").sum()), len(joints), headline=True
    )
    page = Document(
        template="excite.html.jinja",
        package="structlearn.tasks.motion",
        facts={**facts, **find.numbers(), "compared": len(gains)},
        tables={"joints": shown(joints), "gains": shown(gains)},
        sources={"trajectory": Source(f"{folder}/trajectory.csv", "")},
        command=str(facts["command"]),
        parameters={"excite": parameters},
        simulated=True,
    )
    drawn: dict[str, Drawing | Sequence[Drawing]] = {
        "trajectory": share_panels(joints, *moved),
        "gains": gain_panel(gains),
    }
    publish_report(folder, {"index": page}, drawn, page.tables, find)


@styled
def share_panels(joints: pd.DataFrame, times: np.ndarray, motion: Motion) -> list[Figure]:
    """Positions within their range, velocities and torques over their limits."""
    lower, upper = joints["lower"].replace(-np.inf, -np.pi), joints["upper"].replace(np.inf, np.pi)
    middle, half = 0.5 * (upper + lower), 0.5 * (upper - lower)
    shares = {
        "position": (motion.q - middle.to_numpy()) / half.to_numpy(),
        "velocity": motion.qd / joints["velocity_limit"].to_numpy(),
        "torque of the URDF": motion.torque / joints["torque_limit_n_m"].to_numpy(),
    }
    figures = []
    for name, values in shares.items():
        figure, axes = panel(name, xlabel="time (s)", ylabel="share of the limit", ylim=(-1.05, 1.05))
        for place, joint in enumerate(joints["joint"]):
            colour = CATEGORICAL_COLOURS[place % len(CATEGORICAL_COLOURS)]
            axes.plot(times, values[:, place], color=colour, linewidth=1.2, label=joint)
        figures.append(legend(figure, 3))
    return figures


@styled
def gain_panel(gains: pd.DataFrame) -> Figure:
    """Errors after random trajectories over those after the designed one."""
    figure, axes = panel(
        "Errors after random trajectories", xlabel="random trajectory", ylabel="times larger"
    )
    axes.bar(gains["random_trajectory"], np.sort(gains["gain"])[::-1], color=BLUE)
    axes.axhline(1.0, color=GREY, linewidth=1.5)
    return figure
