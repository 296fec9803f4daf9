"""Errors and torques of models of a recorded arm: tables by joint, and figures."""

import pandas as pd
from matplotlib.figure import Figure

from structlearn.palette import BLACK
from structlearn.reporting.figure_style import styled
from structlearn.reporting.panels import legend, panel
from structlearn.testbeds.recorded import names

TRACED = ("urdf", "mlp", "cov_viscous", "cov_coulomb")
"""Columns of torques that are drawn beside the measured ones."""


def errors_by_joint(errors: pd.DataFrame, part: str) -> pd.DataFrame:
    """NMSE on a part by model and friction, in their order, and joint; mean over seeds.

    Args:
        errors: of `arm_identification.error_table`.
        part: one of its parts.
    """
    rows = errors[errors["part"] == part]
    wide = rows.pivot_table(index=["model", "friction"], columns="joint", values="nmse", sort=False)
    models, frictions = list(names.DYNAMICS_MODELS), list(names.FRICTIONS)
    keys = [(frictions.index(friction), models.index(model)) for model, friction in wide.index]
    return wide.iloc[sorted(range(len(keys)), key=keys.__getitem__)]


@styled
def joint_errors_panel(errors: pd.DataFrame) -> Figure:
    """NMSE over the joints; rows of errors are of models and friction, columns of joints."""
    figure, axes = panel("Every joint", 3.5, xlabel="joint", ylabel="NMSE on the test part", yscale="log")
    for key, look in names.DYNAMICS_LOOKS.items():
        if key in errors.index:
            its, line = errors.loc[key], "--" if key[0] == "least_squares" else "-"
            axes.plot(its.index, its, line, marker="o", markersize=4, color=look.colour, label=look.name)
    axes.set_xticks(errors.columns)
    return legend(figure)


@styled
def torque_panel(traces: pd.DataFrame, joint: int, title: str, xlabel: str) -> Figure:
    """Torque of one joint, measured and by models, of a table of `arm_identification.trace_table`."""
    figure, axes = panel(title, 3.5, xlabel=xlabel, ylabel="torque (N m)")
    looks = {"_".join(key).removesuffix("_none"): look for key, look in names.DYNAMICS_LOOKS.items()}
    its = traces.query("joint == @joint")
    axes.plot(its["time_s"], its["measured"], color=BLACK, linewidth=2.4, alpha=0.35, label="measured")
    for name in TRACED:
        axes.plot(its["time_s"], its[name], color=looks[name].colour, linewidth=1.0, label=looks[name].name)
    low, high = its["measured"].min(), its["measured"].max()
    axes.set_ylim(low - 0.5 * (high - low), high + 0.5 * (high - low))
    return legend(figure)
