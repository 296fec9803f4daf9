"""Page that compares simulated with recorded touch: tables, claims and figures."""

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from dissertation.evidence.claims import judge, read_claims
from dissertation.evidence.judged_page import JudgedDocument, publish_judged
from dissertation.recorded.calibration.touch_calibration import FINGERS, CalibrationParameters
from structlearn.palette import BLACK, CATEGORICAL_COLOURS, GREY
from structlearn.reporting.document import Source, Table
from structlearn.reporting.evidence import exact
from structlearn.reporting.figure_style import Drawing, legend, panel, styled
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import listing, rounded
from structlearn.tasks.section import shown
from structlearn.tasks.touch.touch_names import CALIBRATED, REFERENCE, WORLDS

PACKAGE = __package__
SHOWN = 4  # electrodes per finger drawn in colour; the others are grey

# columns of `touch_calibration.comparison`, with their headings
STATISTICS = {
    "contact_strongest": "contact, strongest electrode (counts)",
    "contact_second": "contact, second strongest (counts)",
    "contact_fourth": "contact, fourth strongest (counts)",
    "contact_median": "contact, median electrode (counts)",
    "contact_many": "contact, electrodes beyond 100 counts",
    "range_strongest": "range, strongest electrode (counts)",
    "range_second": "range, second strongest (counts)",
    "range_fourth": "range, fourth strongest (counts)",
    "range_median": "range, median electrode (counts)",
    "noise_median": "noise, median electrode (counts)",
    "noise_largest": "noise, noisiest electrode (counts)",
    "active": "active electrodes",
    "pca_dimensions": "principal components",
    "power_slow": "0.4 to 2 Hz, strongest electrode (counts)",
    "power_middle": "2 to 10 Hz, strongest electrode (counts)",
    "power_fast": "10 to 50 Hz, strongest electrode (counts)",
}
# beginnings of the names of a claim's statistics
CLAIMS = {name: name for name in ("contact", "range", "noise", "active")}
CLAIMS |= {"dimensions": "pca", "spectrum": "power"}

HEADLINES = ("contact_strongest", "noise_median", "pca_dimensions")


def publish_calibration(stored: Mapping[str, pd.DataFrame], parameters: CalibrationParameters) -> None:
    """Publish the page; without tables it states that nothing is recorded."""
    find = find_calibration(stored)
    pages = {"index": calibration_document(stored, find, parameters)}
    drawn = calibration_pictures(stored, parameters.variance) if stored else {}
    publish_judged("reports/calibration", pages, drawn, pages["index"].tables, find)


def find_calibration(stored: Mapping[str, pd.DataFrame]) -> Findings:
    """Medians of all statistics, and ratios of medians by claim, simulated over recorded."""
    find = Findings("fingers in runs")
    if not stored:
        for claim in CLAIMS:
            find.unknown(claim, "no scraping execution is recorded here")
        return find
    comparison = stored["comparison"].set_index("statistic")
    find.exact("agree", int(comparison["agrees"].sum()), headline=True)
    find.exact("compared", len(comparison), headline=True)
    for name, row in comparison.iterrows():
        for world in ("recorded", "simulated"):
            find.exact(f"{name}_{world}", row[world], headline=name in HEADLINES)
    for claim, start in CLAIMS.items():
        ratios = comparison["ratio"][[name for name in comparison.index if name.startswith(start)]]
        find.add(claim, {_case(name): exact(ratio, 1) for name, ratio in ratios.items()})
    return find


def _case(name: str) -> str:
    """`strongest electrode`, or the band of a spectrum."""
    words = STATISTICS[name].removesuffix(" (counts)").split(", ")
    return words[0] if name.startswith("power") else words[-1]


def page_tables(stored: Mapping[str, pd.DataFrame]) -> dict[str, Table]:
    """The comparison, and medians of all sets."""
    statistics = [name for name in STATISTICS if name in stored["fingers"]]
    medians = stored["fingers"].groupby("group")[statistics].median().T
    medians = medians[[group for group in WORLDS if group in medians]]
    medians.insert(0, "statistic", [STATISTICS[name] for name in statistics])
    comparison = stored["comparison"].assign(statistic=stored["comparison"]["statistic"].map(STATISTICS))
    return {
        "statistics": shown(comparison, ratio=".2f"),
        "medians": shown(medians, **dict.fromkeys(WORLDS, ".4g")),
    }


def strongest(electrodes: pd.DataFrame, group: str) -> str:
    """`16 (left, +100) and 1 (right, +300)`: the two electrodes per finger that change most, first run."""
    its = electrodes[electrodes["group"] == group]
    its = its[its["run"] == its["run"].iloc[0]]
    order = its["contact"].abs().sort_values(ascending=False, kind="stable").index
    rows = its.loc[order].groupby("finger", sort=True).head(2)
    return listing(
        f"{row.electrode} ({row.finger}, {rounded(row.contact, '+.0f')})" for row in rows.itertuples()
    )


def calibration_document(
    stored: Mapping[str, pd.DataFrame], find: Findings, parameters: CalibrationParameters
) -> JudgedDocument:
    """Calibration page: tables, judged claims and figures."""
    claims = read_claims(Path(__file__).with_name("calibration_claims.yaml"))
    facts: dict[str, object] = parameters.model_dump() | {"variance_percent": 100 * parameters.variance}
    judged, stage = judge(claims, find, facts), "calibration_report"
    if not stored:
        return JudgedDocument("not_calibrated.html.jinja", PACKAGE, stage, judged=judged, clone="../..")
    facts |= find.numbers() | {
        "compared_rows": stored["comparison"].set_index("statistic").to_dict("index"),
        "runs": stored["fingers"].query("group == @CALIBRATED")["run"].nunique(),
        "strongest_recorded": strongest(stored["electrodes"], REFERENCE),
        "strongest_simulated": strongest(stored["electrodes"], CALIBRATED),
    }
    return JudgedDocument(
        template="calibration.html.jinja",
        package=PACKAGE,
        stage=stage,
        clone="../..",  # of the project of public sets
        facts=facts,
        tables=page_tables(stored),
        judged=judged,
        sources={name: Source(f"data/calibration/{name}.parquet", "calibrate") for name in stored},
        parameters={"calibrate": parameters},
        simulated=True,
    )


def calibration_pictures(
    stored: Mapping[str, pd.DataFrame], variance: float
) -> dict[str, Drawing | Sequence[Drawing]]:
    """Figures by name; `variance`: share that principal components must hold."""
    noise = stored["electrodes"].sort_values("noise", kind="stable")[["group", "noise"]]
    by_group = noise.groupby("group")["noise"]
    noise["share"] = by_group.cumcount() / (by_group.transform("size") - 1)
    return {
        "traces": trace_panels(stored["traces"]),
        "electrodes": [
            amplitude_panel(stored["electrodes"], "contact", "Change by contact"),
            amplitude_panel(stored["electrodes"], "range", "Range in contact"),
            sets_panel(
                noise,
                "Noise of the electrodes",
                [0.5, 1, 2, 5],
                xlim=(0.3, 6.0),
                xlabel="standard deviation (counts)",
                ylabel="share of electrodes below",
            ),
            components_panel(stored["components"], variance),
        ],
        "spectra": [
            sets_panel(
                stored["spectra"][["group", "frequency_hz", name]],
                f"{name.capitalize()} electrode",
                [0.5, 1, 2, 5, 10, 20, 50],
                yscale="log",
                xlabel="frequency (Hz)",
                ylabel="counts² / Hz",
            )
            for name in ("strongest", "median")
        ],
    }


@styled
def trace_panels(traces: pd.DataFrame) -> list[Figure]:
    """One run of both sets of scraping: every electrode of both fingers over time."""
    limit = 1.05 * traces["change"].abs().max()
    figures = []
    for finger, group in product(FINGERS, (REFERENCE, CALIBRATED)):
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
    """Magnitudes of a column for every finger of both sets of scraping, electrodes in decreasing order."""
    figure, axes = panel(title, xlabel="electrodes of a finger, sorted", ylabel="counts", yscale="log")
    for group, width, opacity in ((CALIBRATED, 0.7, 0.6), (REFERENCE, 1.8, 1.0)):
        label: str | None = group
        for _, finger in electrodes[electrodes["group"] == group].groupby(["run", "finger"], sort=False):
            values = np.maximum(np.sort(finger[name].abs().to_numpy())[::-1], 0.3)
            style: dict[str, Any] = {"color": WORLDS[group], "linewidth": width, "alpha": opacity}
            axes.plot(np.arange(1, len(values) + 1), values, **style, label=label)
            label = None
    axes.set_xticks([1, 5, 10, 15, 19])
    return legend(figure)


@styled
def sets_panel(table: pd.DataFrame, title: str, ticks: Sequence[float], **labels: Any) -> Figure:
    """A curve for each set, over a logarithmic axis: columns `group`, x and y."""
    figure, axes = panel(title, xscale="log", **labels)
    for group, colour in WORLDS.items():
        _, x, y = table[table["group"] == group].to_numpy().T
        if len(x):
            axes.plot(x, y, color=colour, label=group)
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    return legend(figure)


@styled
def components_panel(components: pd.DataFrame, variance: float) -> Figure:
    """Variance left after some principal components of a finger, in all sets."""
    figure, axes = panel("Dimensions of the movement", yscale="log", ylim=(1e-5, 1.3))
    axes.set(xlabel="principal components of a finger", ylabel="share of variance unexplained")
    for group, its in components.groupby("group", sort=False):
        colour = WORLDS[group]
        axes.plot(its["components"], its["left"], label=group, color=colour, marker="o", markersize=3.5)
    axes.axhline(1 - variance, color=BLACK, linewidth=0.8, linestyle=":")
    axes.set_xlim(-0.2, 12.2)
    return legend(figure)
