"""Figures of what dynamics models learned: bodies, friction, and a payload on the way."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.palette import BLACK, BLUE, GREY, VERMILION
from structlearn.reporting.figures import canvas, legend_above, styled
from structlearn.rigid_body.model_names import NAMES
from structlearn.testbeds.dynamics.page.dynamics_figures import look
from structlearn.testbeds.dynamics.page.dynamics_results import DynamicsResults

MARKERS = {"nostr": "x", "symm": "+", "spd": "s", "tri": "^", "cov": "o"}

SHOWN_JOINTS = (1, 2, 4, 6)
"""Of which friction is drawn: large and small ones, one of a kind."""


@styled
def bodies_figure(results: DynamicsResults) -> Figure:
    """Base parameters and masses, learned over true, of the first seed."""
    figure = canvas(3.8)
    panels = figure.subplots(1, 2)
    pairs = ((results.base, "value", "truth"), (results.links, "mass_kg", "true_mass_kg"))
    for panel, (table, learned, true) in zip(panels, pairs, strict=True):
        for model in results.structures:
            its = table[(table["model"] == model) & (table["loss"] == results.loss) & (table["seed"] == 0)]
            marked = {"marker": MARKERS[model], "fillstyle": "none", "color": look(model)["color"]}
            panel.plot(its[true], its[learned], linestyle="", markersize=5, label=NAMES[model], **marked)
        ends = [table[true].min(), table[true].max()]
        panel.plot(ends, ends, color=GREY, linewidth=0.9, zorder=0)
    # values from 0.001 to 10 of either sign
    panels[0].set(xscale="symlog", yscale="symlog")
    for axis in (panels[0].set_xscale, panels[0].set_yscale):
        axis("symlog", linthresh=0.01, linscale=0.6)
    panels[0].set(
        title="Base parameters (kg m², kg m)",
        xlabel="of the robot (scale linear up to 0.01)",
        ylabel="learned",
    )
    panels[1].set(title="Masses of the links (kg)", xlabel="of the robot", ylabel="learned")
    legend_above(figure, panels[0])
    return figure


@styled
def friction_figure(results: DynamicsResults) -> Figure:
    """Torques of the robot that no rigid body explains, over the joint's speed, and the learned friction."""
    rows = results.residuals
    joints = [joint for joint in SHOWN_JOINTS if joint in set(rows["joint"])]
    figure = canvas(2.7)
    panels = figure.subplots(1, len(joints), squeeze=False)[0]
    for panel, joint in zip(panels, joints, strict=True):
        its = rows[rows["joint"] == joint].sort_values("velocity_rad_s")
        speed = its["velocity_rad_s"]
        panel.plot(speed, its["residual_n_m"], ".", color=GREY, markersize=1.6, alpha=0.6, label="measured")
        panel.plot(speed, its["friction_n_m"], color=BLUE, label="learned friction: viscous and Coulomb")
        panel.set(title=f"Joint {joint}", xlabel="speed (rad/s)")
        spread = its["residual_n_m"].abs().quantile(0.995)
        panel.set_ylim(-1.3 * spread, 1.3 * spread)
    panels[0].set_ylabel("torque (N m)")
    legend_above(figure, panels[0])
    return figure


@styled
def payload_figure(results: DynamicsResults) -> Figure:
    """What is learned of a payload that is picked up, and what the models make of the torques."""
    payload = results.payload
    figure = canvas(2.9)
    panels = figure.subplots(1, 3, sharex=True)
    truth = np.where(payload["time_s"] < results.pick_up_s, 0.0, 1.0)
    point = np.linalg.norm(results.carried.point_m)
    moment = np.linalg.norm(payload[[f"moment_{axis}_kg_m" for axis in "xyz"]], axis=1)
    _learned(panels[0], payload, payload["mass_kg"], truth * results.carried.mass_kg)
    _learned(panels[1], payload, moment, truth * results.carried.mass_kg * point)
    panels[2].plot(payload["time_s"], payload["nmse_fixed"], color=VERMILION, label="model of the empty arm")
    panels[2].plot(payload["time_s"], payload["nmse_learned"], color=BLUE)
    panels[0].set(title="Mass in the hand (kg)")
    panels[1].set(title="Its first moment (kg m)")
    panels[2].set(title="NMSE of the next batch", yscale="log")
    for panel in panels:
        panel.set_xlabel("time (s)")
    handles = [*panels[0].lines, panels[2].lines[0]]
    names = [line.get_label() for line in handles]
    figure.legend(handles, names, loc="outside upper left", ncols=len(handles))
    return figure


def pictures(results: DynamicsResults) -> dict[str, Figure]:
    """The figures of this module by name."""
    return {
        "bodies": bodies_figure(results),
        "friction": friction_figure(results),
        "payload": payload_figure(results),
    }


def _learned(panel, payload: pd.DataFrame, values: np.ndarray, truth: np.ndarray) -> None:
    panel.plot(payload["time_s"], truth, color=BLACK, linestyle="--", linewidth=1.0, label="carried")
    panel.plot(payload["time_s"], values, color=BLUE, label="learned online")
