"""Figures of touch, recorded beside simulated: traces, changes by contact, noise, spectra, components."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.palette import BLACK, CATEGORICAL_COLOURS, GREY
from structlearn.reporting.figure_style import Drawing, styled
from structlearn.reporting.panels import legend, panel
from structlearn.tasks.public.protocol.touch_calibration import REFERENCE, SIMULATED
from structlearn.tasks.public.public_names import TOUCH_WORLDS

SHOWN = 4
"""Electrodes of a finger that have a colour; all others are grey."""


def pictures(stored: Mapping[str, pd.DataFrame], variance: float) -> dict[str, Drawing | Sequence[Drawing]]:
    """All figures by name; `variance` is the share that principal components must hold."""
    electrodes = stored["electrodes"]
    return {
        "traces": trace_panels(stored["traces"]),
        "electrodes": [
            amplitude_panel(electrodes, "contact", "Change by contact"),
            amplitude_panel(electrodes, "range", "Range in contact"),
            noise_panel(electrodes),
            components_panel(stored["components"], variance),
        ],
        "spectra": [spectrum_panel(stored["spectra"], name) for name in ("strongest", "median")],
    }


@styled
def trace_panels(traces: pd.DataFrame) -> list[Figure]:
    """One run of both sets of scraping: every electrode of both fingers over time."""
    limit = 1.05 * traces["change"].abs().max()
    figures = []
    for finger, group in (
        (finger, group) for finger in ("left", "right") for group in (REFERENCE, SIMULATED)
    ):
        its = traces[(traces["group"] == group) & (traces["finger"] == finger)]
        wide = its.pivot_table(index="time_s", columns="electrode", values="change").iloc[::4]
        order = wide.abs().max().sort_values(ascending=False, kind="stable").index
        title = f"{group.capitalize()}: {finger} finger"
        figure, axes = panel(title, xlabel="time since contact (s)", ylabel="change (counts)")
        axes.plot(wide.index, wide[order[SHOWN:]], color=GREY, linewidth=0.6)
        for colour, electrode in zip(CATEGORICAL_COLOURS, order[:SHOWN], strict=False):
            axes.plot(wide.index, wide[electrode], color=colour, linewidth=1.1, label=f"E{electrode}")
        axes.axvline(0.0, color=BLACK, linewidth=0.7, linestyle=":")
        axes.set_ylim(-limit, limit)
        figures.append(legend(figure, SHOWN))
    return figures


@styled
def amplitude_panel(electrodes: pd.DataFrame, name: str, title: str) -> Figure:
    """A column's magnitude for every finger of both sets of scraping, electrodes in falling order."""
    figure, axes = panel(title, xlabel="electrodes of a finger, sorted", ylabel="counts", yscale="log")
    for group, width, opacity in ((SIMULATED, 0.7, 0.6), (REFERENCE, 1.8, 1.0)):
        label: str | None = group
        for _, finger in electrodes[electrodes["group"] == group].groupby(["run", "finger"], sort=False):
            values = np.maximum(np.sort(finger[name].abs().to_numpy())[::-1], 0.3)
            axes.plot(
                np.arange(1, len(values) + 1),
                values,
                label=label,
                color=TOUCH_WORLDS[group],
                linewidth=width,
                alpha=opacity,
            )
            label = None
    axes.set_xticks([1, 5, 10, 15, 19])
    return legend(figure)


@styled
def noise_panel(electrodes: pd.DataFrame) -> Figure:
    """Distribution of the electrodes' noise in all sets."""
    figure, axes = panel("Noise of the electrodes", xscale="log", xlim=(0.3, 6.0))
    axes.set(xlabel="standard deviation (counts)", ylabel="share of electrodes below")
    for group, its in electrodes.groupby("group", sort=False):
        values = np.sort(its["noise"].to_numpy())
        axes.plot(values, np.linspace(0.0, 1.0, len(values)), color=TOUCH_WORLDS[group], label=group)
    axes.set_xticks([0.5, 1, 2, 5], ["0.5", "1", "2", "5"])
    axes.minorticks_off()
    return legend(figure)


@styled
def spectrum_panel(spectra: pd.DataFrame, name: str) -> Figure:
    """Power density of the `strongest` or the `median` electrode of a finger, in all sets."""
    figure, axes = panel(f"{name.capitalize()} electrode", xscale="log", yscale="log")
    axes.set(xlabel="frequency (Hz)", ylabel="counts² / Hz")
    for group, its in spectra.groupby("group", sort=False):
        axes.plot(its["frequency_hz"], its[name], color=TOUCH_WORLDS[group], label=group)
    axes.set_xticks([0.5, 1, 2, 5, 10, 20, 50], ["0.5", "1", "2", "5", "10", "20", "50"])
    axes.minorticks_off()
    return legend(figure)


@styled
def components_panel(components: pd.DataFrame, variance: float) -> Figure:
    """Variance that is left after some principal components of a finger's electrodes, in all sets."""
    figure, axes = panel("Dimensions of the movement", yscale="log", ylim=(1e-5, 1.3))
    axes.set(xlabel="principal components of a finger", ylabel="share of variance left")
    for group, its in components.groupby("group", sort=False):
        colour = TOUCH_WORLDS[group]
        axes.plot(its["components"], its["left"], label=group, color=colour, marker="o", markersize=3.5)
    axes.axhline(1 - variance, color=BLACK, linewidth=0.8, linestyle=":")
    axes.set_xlim(-0.2, 12.2)
    return legend(figure)
