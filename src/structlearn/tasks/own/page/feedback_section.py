"""Feedback: what people corrected, and how well a network predicts it where it has not learned."""

import numpy as np
from matplotlib.figure import Figure

from structlearn.core import signals
from structlearn.core.errors import InputError
from structlearn.feedback.coupling import Axis, unit
from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.palette import CATEGORICAL_COLOURS
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import styled
from structlearn.reporting.panels import legend, panel
from structlearn.reporting.prose import capitalised
from structlearn.tasks.own.protocol.own_feedback import read_own_feedback
from structlearn.tasks.section import Section
from structlearn.tasks.task_entry import OwnFeedbackParameters
from structlearn.tasks.task_files import TaskFiles

SAMPLES = 200
DRAWN = 6
"""Settings that are drawn."""

POOR = 1.0
"""NMSE from which on a model is no better than the mean."""

CHECKED = ("reproduction", "smoothing", "others")
"""How columns of checks begin."""


def section(files: TaskFiles) -> Section:
    """Of a task with corrections."""
    parameters = files.part("feedback", OwnFeedbackParameters)
    learned = read_own_feedback(files.folder / "feedback")
    if learned is None:
        raise InputError(f"{files.folder / 'feedback'}: was written without feedback; run its stage")
    scores, checks = learned.scores, learned.checks
    own = scores[scores["learned"]].groupby(["primitive", "axis"], sort=False)["nmse"].mean()
    measures = [name for name in checks.columns if name.split("_")[0] in CHECKED]
    by_setting = checks.groupby(["primitive", "setting"], sort=False)
    return Section(
        "feedback",
        "Feedback from corrections",
        "feedback.html.jinja",
        facts={
            "parameters": parameters,
            "executions": len(files.runs("executions")),
            "corrections": int(checks.groupby("primitive").size().max()),
            "by": "setting" if len(parameters.settings) > 1 else "part of the demonstrations",
            "worst": own.max(),
            "worst_key": own.idxmax(),
            "poor": [f"{name} {axis}" for (name, axis), value in own.items() if value >= POOR],
        },
        metrics={f"feedback_{name}_{axis}_nmse": value for (name, axis), value in own.items()},
        tables={
            "feedback_scores": Table(
                scores,
                {"nmse": ".2f"},
                {"left_out": "left out", "nmse": "NMSE", "learned": "of what is learned from"},
            ),
            "feedback_checks": Table(
                by_setting[measures].max().reset_index(), dict.fromkeys(measures, ".3g")
            ),
        },
        pictures={
            "feedback_targets": [
                targets_panel(f"{capitalised(name)}, {axis}", axis, dataset)
                for name, by_axis in learned.datasets.items()
                for axis, dataset in by_axis.items()
            ]
        },
    )


@styled
def targets_panel(title: str, axis: Axis, dataset: CouplingDataset) -> Figure:
    """Coupling targets of one primitive on one axis, mean and std by setting."""
    figure, axes = panel(title, 2.9, xlabel="time / duration", ylabel=f"coupling target ({unit(axis)})")
    time = np.linspace(0.0, 1.0, SAMPLES)
    settings = list(dict.fromkeys(dataset.setting))[:DRAWN]
    for colour, setting in zip(CATEGORICAL_COLOURS, settings, strict=False):
        its = dataset.where(dataset.setting == setting)
        runs = [its.target[its.demonstration == one] for one in dict.fromkeys(its.demonstration)]
        curves = np.array([signals.time_normalised(run[:, None], SAMPLES)[:, 0] for run in runs])
        mean, spread = curves.mean(axis=0), curves.std(axis=0)
        axes.plot(time, mean, color=colour, label=str(setting))
        axes.fill_between(time, mean - spread, mean + spread, color=colour, alpha=0.15, linewidth=0)
    return legend(figure)
