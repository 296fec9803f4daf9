"""Unscrewing: orientation primitives of nearly a full turn."""

import numpy as np
from matplotlib.figure import Figure

from structlearn.core import signals
from structlearn.core.artefacts import Metrics
from structlearn.palette import BLACK
from structlearn.primitives.fitting import orientations
from structlearn.primitives.twist_swing import dominant_axes, on_chart
from structlearn.reporting.claims import Found, exact
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import styled
from structlearn.reporting.panels import SAMPLES, legend, panel
from structlearn.tasks.public import public_names
from structlearn.tasks.public.page.parts.part import Part, Pictures
from structlearn.tasks.public.page.recorded_results import RecordedResults
from structlearn.tasks.public.page.recorded_tables import shown
from structlearn.tasks.public.protocol.movement import turning


def metrics(results: RecordedResults) -> Metrics:
    """Of primitives from one log and from all."""
    errors = results["unscrewing_errors"]
    single, joint = errors[errors["learned_from"] != "all"], errors[errors["learned_from"] == "all"]
    return {
        "unscrewing_mean_deg_single": single["mean_deg"].mean(),
        "unscrewing_mean_deg_joint": joint["mean_deg"].item(),
        "unscrewing_end_deg_single": single["end_deg"].max(),
        "unscrewing_end_deg_joint": joint["end_deg"].item(),
    }


def evidence(results: RecordedResults) -> dict[str, Found]:
    """By the names of the claims."""
    turns = results["unscrewing_errors"]
    single, joint = turns[turns["learned_from"] != "all"], turns[turns["learned_from"] == "all"]
    return {
        "turns": {
            "mean of a log": exact(single["mean_deg"].max(), len(single)),
            "mean of all": exact(joint["mean_deg"].max(), len(single)),
            "at the end": exact(turns["end_deg"].max(), len(turns)),
        }
    }


def facts(results: RecordedResults) -> dict[str, object]:
    """Values for its sentences."""
    turns = results["unscrewing_errors"].query("learned_from != 'all'")
    return {
        "logs": list(turns["learned_from"]),
        "least_turn": turns["turn_deg"].min(),
        "most_turn": turns["turn_deg"].max(),
    }


def tables(results: RecordedResults) -> dict[str, Table]:
    """Tables keyed by name."""
    return {"unscrewing": shown(results["unscrewing_errors"])}


def pictures(results: RecordedResults) -> Pictures:
    """Figures keyed by name."""
    return {"turning": turn_panel(results)}


@styled
def turn_panel(results: RecordedResults) -> Figure:
    """Twist about the dominant axis, and swings about the others, of every log and of the primitive."""
    figure, axes = panel(
        "Unscrewing: turn of the hand", xlabel="time / duration", ylabel="degrees to the goal"
    )
    logs = orientations(results.unscrewing_segments)
    unrolled = turning(results.unscrewing_primitives[0]).unroll(logs[0].dt)
    frame = dominant_axes(logs)
    for path, look in [*((log, public_names.RECORDED) for log in logs), (unrolled, public_names.LEARNED)]:
        angles = np.degrees(signals.time_normalised(on_chart(path, frame).position, 2 * SAMPLES))
        for line, angle in zip(("-", "--", ":"), angles.T, strict=True):
            axes.plot(np.linspace(0.0, 1.0, len(angle)), angle, line, color=look.colour)
    for look in (public_names.RECORDED, public_names.LEARNED):
        axes.plot([], [], color=look.colour, label=look.name)
    for line, label in (("-", "twist"), ("--", "swing"), (":", "second swing")):
        axes.plot([], [], line, color=BLACK, label=label)
    return legend(figure, 3)


PART = Part(
    name="unscrewing",
    heading="Unscrewing",
    page="movements",
    needs=("unscrewing_errors",),
    parameters=("recorded_unscrewing",),
    metrics=metrics,
    evidence=evidence,
    facts=facts,
    tables=tables,
    pictures=pictures,
)
