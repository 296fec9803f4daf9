"""Figures of touch, recorded beside simulated: traces, changes by contact, noise, spectra, components."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.palette import BLACK, CATEGORICAL_COLOURS, GREEN, GREY, PURPLE, VERMILION
from structlearn.reporting.figures import canvas, styled
from structlearn.testbeds.recorded.protocol.touch_calibration import REFERENCE, SIMULATED

SHOWN = 4
"""Electrodes of a finger that have a colour; all others are grey."""

OTHER_COLOURS = (PURPLE, GREEN)


def set_colours(groups: list[str]) -> dict[str, str]:
    """Colour of every set: recorded scraping black, simulated scraping red, all others their own."""
    others = [group for group in groups if group not in (REFERENCE, SIMULATED)]
    return {REFERENCE: BLACK, SIMULATED: VERMILION} | {
        group: OTHER_COLOURS[place % len(OTHER_COLOURS)] for place, group in enumerate(others)
    }


@styled
def traces_figure(traces: pd.DataFrame) -> Figure:
    """One run of both sets of scraping: every electrode of both fingers over time.

    Args:
        traces: `recorded.calibration.trace_table`.
    """
    figure = canvas(5.6)
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    for column, group in enumerate((REFERENCE, SIMULATED)):
        for row, finger in enumerate(("left", "right")):
            panel = panels[row, column]
            its = traces[(traces["group"] == group) & (traces["finger"] == finger)]
            wide = its.pivot_table(index="time_s", columns="electrode", values="change")
            order = wide.abs().max().sort_values(ascending=False, kind="stable").index
            for electrode in order[SHOWN:]:
                panel.plot(wide.index, wide[electrode], color=GREY, linewidth=0.6)
            for colour, electrode in zip(CATEGORICAL_COLOURS, order[:SHOWN], strict=False):
                panel.plot(wide.index, wide[electrode], color=colour, linewidth=1.1, label=f"{electrode}")
            panel.axvline(0.0, color=BLACK, linewidth=0.7, linestyle=":")
            panel.set_title(f"{group[:1].upper()}{group[1:]}: {finger} finger")
            panel.legend(title="electrode", ncols=2, columnspacing=1.0)
            if column == 0:
                panel.set_ylabel("change (counts)")
            if row == 1:
                panel.set_xlabel("time since contact (s)")
    return figure


@styled
def electrodes_figure(electrodes: pd.DataFrame) -> Figure:
    """Change by contact and range in contact of every finger, electrodes sorted, and noise of all sets.

    Args:
        electrodes: `recorded.calibration.electrode_table`.
    """
    figure = canvas(3.4)
    panels = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.1))
    colours = set_colours(list(dict.fromkeys(electrodes["group"])))
    titles = {"contact": "Change by contact", "range": "Range in contact"}
    for panel, (name, title) in zip(panels, titles.items(), strict=False):
        for group in (SIMULATED, REFERENCE):
            its = electrodes[electrodes["group"] == group]
            for place, (_, finger) in enumerate(its.groupby(["run", "finger"], sort=False)):
                values = np.sort(finger[name].abs().to_numpy())[::-1]
                recorded = group == REFERENCE
                panel.plot(
                    np.arange(1, len(values) + 1),
                    np.maximum(values, 0.3),
                    color=colours[group],
                    linewidth=1.8 if recorded else 0.7,
                    alpha=1.0 if recorded else 0.6,
                    label=group if place == 0 else None,
                    zorder=3 if recorded else 2,
                )
        panel.set(yscale="log", title=title, xlabel="electrodes of a finger, sorted", ylabel="counts")
        panel.set_xticks([1, 5, 10, 15, 19])
    panels[0].legend()
    for group, colour in colours.items():
        values = np.sort(electrodes.loc[electrodes["group"] == group, "noise"].to_numpy())
        panels[2].plot(values, np.linspace(0.0, 1.0, len(values)), color=colour, label=group)
    panels[2].set(xscale="log", xlim=(0.3, 6.0), title="Noise of the electrodes")
    panels[2].set(xlabel="standard deviation (counts)", ylabel="share of electrodes below")
    panels[2].set_xticks([0.5, 1, 2, 5], ["0.5", "1", "2", "5"])
    panels[2].minorticks_off()
    panels[2].legend(loc="lower right")
    return figure


@styled
def spectra_figure(spectra: pd.DataFrame) -> Figure:
    """Power density of the strongest and of the median electrode of a finger, in all sets.

    Args:
        spectra: `recorded.calibration.spectrum_table`.
    """
    figure = canvas(3.4)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for group, colour in set_colours(list(dict.fromkeys(spectra["group"]))).items():
        its = spectra[spectra["group"] == group]
        for panel, name in zip(panels, ("strongest", "median"), strict=True):
            panel.plot(its["frequency_hz"], its[name], color=colour, label=group)
    for panel, name in zip(panels, ("Strongest electrode", "Median electrode"), strict=True):
        panel.set(xscale="log", yscale="log", title=name, xlabel="frequency (Hz)")
        panel.set_xticks([0.5, 1, 2, 5, 10, 20, 50], ["0.5", "1", "2", "5", "10", "20", "50"])
        panel.minorticks_off()
    panels[0].set_ylabel("counts² / Hz")
    panels[1].legend()
    return figure


@styled
def components_figure(components: pd.DataFrame, variance: float) -> Figure:
    """Variance that is left after some principal components of a finger's electrodes, in all sets.

    Args:
        components: `recorded.calibration.component_table`.
        variance: share that must be held.
    """
    figure = canvas(3.0)
    panel = figure.subplots()
    for group, colour in set_colours(list(dict.fromkeys(components["group"]))).items():
        its = components[components["group"] == group]
        panel.plot(its["components"], its["left"], color=colour, marker="o", markersize=3.5, label=group)
    panel.axhline(1 - variance, color=BLACK, linewidth=0.8, linestyle=":")
    panel.set(yscale="log", ylim=(1e-5, 1.3), xlim=(-0.2, 12.2), xlabel="principal components of a finger")
    panel.set(ylabel="share of variance left", title="Dimensions of the movement in contact")
    panel.legend()
    return figure
