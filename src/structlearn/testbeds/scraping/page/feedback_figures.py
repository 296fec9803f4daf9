"""Figures of what feedback is learned from, and of the models compared (figure IV.16)."""

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.feedback.model_comparison import dominant_features
from structlearn.ground import signals
from structlearn.palette import BLACK, BLUE, GREY, ORANGE, PURPLE, SKY, VERMILION
from structlearn.reporting.figures import canvas, legend_above, styled
from structlearn.testbeds.scraping.page.feedback_results import SAMPLES, FeedbackResults, unroll_traces

REPRESENTATION_NAMES = {
    "pmnn_100": "PMNN\n100 nodes",
    "pmnn_6": "PMNN\n6 nodes",
    "pmnn_0": "PMNN\nno hidden layer",
    "ffnn_phase": "FFNN\nwith phase",
    "ffnn": "FFNN",
    "pca": "PCA, then\nphase kernels",
    "autoencoder": "autoencoder, then\nphase kernels",
}
REPRESENTATION_COLOURS = {
    "pmnn_100": BLUE,
    "pmnn_6": SKY,
    "pmnn_0": SKY,
    "ffnn_phase": ORANGE,
    "ffnn": ORANGE,
    "pca": PURPLE,
    "autoencoder": PURPLE,
}
STRUCTURES = ("pmnn_100", "pmnn_0", "ffnn_phase", "ffnn")
EMBEDDINGS = ("pmnn_100", "pmnn_6", "pca", "autoencoder")
CHANNELS_SHOWN = 3


def mean_band(panel: Axes, curves: np.ndarray, colour: str, label: str | None = None) -> None:
    """Mean of curves (R, T) over normalised time, and one std on either side."""
    time, mean = np.linspace(0.0, 1.0, curves.shape[1]), curves.mean(axis=0)
    spread = curves.std(axis=0, ddof=1) if len(curves) > 1 else np.zeros_like(mean)
    panel.fill_between(time, mean - spread, mean + spread, color=colour, alpha=0.2, linewidth=0)
    panel.plot(time, mean, color=colour, label=label)


def demonstrated_curves(dataset: CouplingDataset, setting: float, values: np.ndarray) -> np.ndarray:
    """Values (S,) of every demonstration in a setting over normalised time, (L, `SAMPLES`)."""
    inside = dataset.setting == setting
    return np.stack(
        [
            signals.time_normalised(values[inside & (dataset.demonstration == number)], SAMPLES)
            for number in np.unique(dataset.demonstration[inside])
        ]
    )


def setting_colours(settings: Sequence[float]) -> dict[float, str]:
    """One colour per setting, darker where the board is tilted more."""
    places = np.linspace(0.85, 0.0, len(settings))
    return {
        setting: to_hex(colormaps["viridis"](place)) for setting, place in zip(settings, places, strict=True)
    }


@styled
def expected_figure(results: FeedbackResults) -> Figure:
    """Mean and std of a few electrodes in the executions, with the learned expected traces."""
    traces = {name: unroll_traces(results, name) for name in results.primitives}
    moved = np.max([np.ptp(learned, axis=0) for _, learned in traces.values()], axis=0)
    shown = np.sort(np.argsort(-moved, kind="stable")[:CHANNELS_SHOWN])
    figure = canvas(0.8 + 1.5 * len(shown))
    panels = figure.subplots(len(shown), len(traces), sharex=True, sharey="row", squeeze=False)
    time = np.linspace(0.0, 1.0, SAMPLES)
    for column, (name, (runs, learned)) in enumerate(traces.items()):
        panels[0, column].set_title(f"{results.number(name)}. {name}")
        panels[-1, column].set_xlabel("time / duration")
        for panel, channel in zip(panels[:, column], shown, strict=True):
            mean_band(panel, runs[:, :, channel], BLUE, f"{len(runs)} executions, mean ± std")
            look = {"color": VERMILION, "linestyle": (0, (4, 2)), "linewidth": 1.2}
            panel.plot(time, learned[:, channel], **look, label="expected trace, learned")
    for panel, channel in zip(panels[:, 0], shown, strict=True):
        panel.set_ylabel(f"channel {channel + 1}\n(counts)")
    legend_above(figure, panels[0, 0])
    return figure


@styled
def targets_figure(results: FeedbackResults) -> Figure:
    """Coupling targets and the deviation of the most telling channel per setting, mean and std."""
    figure = canvas(4.8)
    panels = figure.subplots(2, len(results.adapted), sharex=True, squeeze=False)
    colours = setting_colours(results.settings_deg)
    for column, name in enumerate(results.adapted):
        dataset, channel = results.datasets[name], results.channels[name][0]
        target, deviation = panels[:, column]
        for setting, colour in colours.items():
            mean_band(target, demonstrated_curves(dataset, setting, dataset.target), colour, f"{setting:g}°")
            curves = demonstrated_curves(dataset, setting, dataset.deviation[:, channel])
            mean_band(deviation, curves, colour)
        target.set(title=f"{results.number(name)}. {name}", ylabel="coupling target (rad)")
        deviation.set(xlabel="time / duration", ylabel=f"deviation, channel {channel + 1}\n(counts)")
    legend_above(figure, panels[0, 0])
    return figure


@styled
def models_figure(results: FeedbackResults) -> Figure:
    """Figure IV.16, top and middle: generalisation NMSE of the representations, mean and std over folds."""
    figure = canvas(5.6)
    panels = figure.subplots(2, len(results.adapted), squeeze=False)
    honest, optimistic = (
        results.model_errors[results.model_errors["stopping"] == stopping].set_index(
            ["primitive", "representation"]
        )
        for stopping in ("validation", "generalization")
    )
    for column, name in enumerate(results.adapted):
        for panel, representations in zip(panels[:, column], (STRUCTURES, EMBEDDINGS), strict=True):
            for place, representation in enumerate(representations):
                if (name, representation) not in honest.index:
                    continue
                row = honest.loc[(name, representation)]
                mean, std = row["generalization_mean"], np.nan_to_num(row["generalization_std"])
                colour = REPRESENTATION_COLOURS[representation]
                panel.bar(place, mean, 0.62, color=colour)
                panel.errorbar(place, mean, std, color=BLACK, linewidth=1.0, capsize=4.0)
                best = optimistic.loc[(name, representation), "generalization_mean"]
                look = {"color": BLACK, "markerfacecolor": "white", "markersize": 5, "linestyle": "none"}
                panel.plot(place + 0.22, best, marker="D", **look)
            names = [REPRESENTATION_NAMES[representation] for representation in representations]
            panel.set_xticks(range(len(names)), names, fontsize=8.0)
            panel.grid(axis="x", visible=False)
            panel.set_ylabel("generalisation NMSE")
            panel.set_ylim(bottom=0.0)
        panels[0, column].set_title(f"{results.number(name)}. {name}: network structures")
        panels[1, column].set_title(f"{results.number(name)}. {name}: features learned inside or apart")
    look = {"color": BLACK, "markerfacecolor": "white", "markersize": 5, "linestyle": "none"}
    handles = [
        Line2D([], [], color=GREY, linewidth=7, label="stopped by validation, mean ± std over folds"),
        Line2D([], [], marker="D", **look, label="best step for the demonstration left out (optimistic)"),
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=2)
    return figure


@styled
def weights_figure(results: FeedbackResults, primitive: str) -> Figure:
    """Figure IV.16, bottom: the hidden nodes that weigh most for each phase kernel."""
    dominant = dominant_features(results.networks[primitive])
    figure = canvas(2.9)
    panel = figure.subplots()
    panel.imshow(dominant, cmap=ListedColormap([BLUE, "#f5d76e"]), aspect="auto", interpolation="nearest")
    panel.set(xlabel="node of the hidden layer", ylabel="phase kernel")
    panel.set_title(f"The ten largest weights of every kernel, “{primitive}”")
    panel.grid(visible=False)
    return figure


def shared_features(dominant: np.ndarray) -> tuple[float, float]:
    """Dominant features (N, H) that two kernels share on average: neighbouring kernels, and any two."""
    common = dominant.astype(int) @ dominant.T.astype(int)
    return float(np.diag(common, 1).mean()), float(common[np.triu_indices(len(common), 1)].mean())


def plain_name(representation: str) -> str:
    """A representation's name in running text."""
    return REPRESENTATION_NAMES[representation].replace("\n", " ").split(",")[0]
