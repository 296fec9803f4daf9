"""Reaches: cut points between rests, and one primitive of all."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.core import signals
from structlearn.core.artefacts import Metrics
from structlearn.palette import BLUE, LIGHT_GREY, METHOD_NAMES, ORANGE
from structlearn.primitives.position import in_local_frame
from structlearn.reporting import segmentation_figures
from structlearn.reporting.claims import Evidence, Found, difference, exact, mean
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import styled
from structlearn.reporting.panels import SAMPLES, legend, panel
from structlearn.reporting.prose import level_name, listing
from structlearn.segmentation.alignment import METHODS, RESULT
from structlearn.segmentation.cut_errors import errors_by_level, errors_by_seed, paired_comparison
from structlearn.tasks.public import public_names
from structlearn.tasks.public.page.parts.part import Part, Pictures
from structlearn.tasks.public.page.recorded_results import RecordedResults
from structlearn.tasks.public.page.recorded_tables import shown

SPREAD_SAMPLES = 500
"""Of a reach in normalised time, as in `movement.own_spread_mm`."""


def by_level(results: RecordedResults) -> pd.DataFrame:
    """Mean cut error of the reaches per noise level and method, over the draws."""
    return errors_by_level(errors_by_seed(results["cut_errors"]))


def own_distances_mm(results: RecordedResults) -> np.ndarray:
    """(L,) distance of every reach from the mean of all, in local frame and normalised time."""
    paths = [in_local_frame(position, "up").position for position, _ in results.reach_segments]
    curves = np.array([signals.time_normalised(path, SPREAD_SAMPLES) for path in paths])
    return 1e3 * np.linalg.norm(curves - curves.mean(axis=0), axis=2).mean(axis=1)


def reach_fit(results: RecordedResults) -> pd.DataFrame:
    """Distance of the primitive from the reaches, learned from or left out."""
    by = results["reach_errors"].groupby("variant", sort=False)
    found = by.agg(mean_mm=("mean_mm", "mean"), max_mm=("max_mm", "max"), end_max_mm=("end_mm", "max"))
    return found.rename_axis("reaches").reset_index()


def metrics(results: RecordedResults) -> Metrics:
    """Errors of cuts and of the primitive."""
    values: Metrics = {}
    for row in by_level(results).itertuples():
        method = "" if row.method == RESULT else f"_{row.method}"
        values[f"reach_cut_error_ms_{level_name(row.noise_mm)}mm{method}"] = row.mean_ms
    prefixes = {"learned from": "reach_fit", "left out": "reach_left_ten_out"}
    for row in reach_fit(results).to_dict("records"):
        prefix = prefixes.get(row["reaches"], "reach_fit_unscaled")
        values |= {f"{prefix}_{name}": row[name] for name in ("mean_mm", "max_mm", "end_max_mm")}
    return values | {"reach_own_spread_mm": own_distances_mm(results).mean()}


def evidence(results: RecordedResults) -> dict[str, Found]:
    """By the names of the claims."""
    errors = {
        name: its.set_index("demonstration") for name, its in results["reach_errors"].groupby("variant")
    }
    learned = errors["learned from"].index
    ends_mm = errors["learned from, forcing not scaled"]["end_mm"].reindex(learned)
    lengths_mm = [
        1e3 * np.linalg.norm(path.position[-1] - path.position[0]) for path, _ in results.reach_segments
    ]
    from_mean = pd.Series(own_distances_mm(results), learned)
    return {
        "printed_over_crossing": cut_gains(results, "zvc", "wls_text"),
        "printed_over_least_squares": cut_gains(results, "ls", "wls_text"),
        "ours_over_crossing": cut_gains(results, "zvc", "wls"),
        "ours_over_warping": cut_gains(results, "dtw", "wls"),
        "reach_ends": exact((100 * ends_mm / lengths_mm).max(), len(ends_mm)),
        "reaches_left_out": mean((errors["left out"]["mean_mm"] - from_mean).dropna()),
    }


def cut_gains(results: RecordedResults, first: str, second: str) -> dict[str, Evidence]:
    """Cut error in ms of one method minus that of another, by noise; pairs are reaches, averaged over draws.

    The draws of rests and noise are not independent evidence: without noise they hardly differ.
    """
    table = results["cut_errors"]
    both_ends = 1e3 * table[["start_error_s", "end_error_s"]].abs().mean(axis=1)
    wide = table.assign(error_ms=both_ends).pivot_table(
        index=["noise_mm", "demonstration"], columns="method", values="error_ms"
    )
    wide = wide.dropna(subset=[first, second])
    return {
        f"{level:g} mm": difference(its[first], its[second]) for level, its in wide.groupby(level="noise_mm")
    }


def facts(results: RecordedResults) -> dict[str, object]:
    """Values for its sentences."""
    best = by_level(results).pivot_table(index="noise_mm", columns="method", values="mean_ms").idxmin(axis=1)
    winners = listing(f"“{METHOD_NAMES[method]}” at {level:g} mm" for level, method in best.items())
    return {"reach_count": len(results.reach_segments), "winners": winners}


def tables(results: RecordedResults) -> dict[str, Table]:
    """Tables keyed by name."""
    wide = by_level(results).pivot_table(index="noise_mm", columns="method", values="mean_ms")
    headings = {method: f"{name} (ms)" for method, name in METHOD_NAMES.items()}
    formats = dict.fromkeys(METHODS, ".1f")
    cuts = Table(wide[list(METHODS)].reset_index(), formats, headings | {"noise_mm": "noise (mm)"})
    return {
        "reach_comparison": Table(paired_comparison(errors_by_seed(results["cut_errors"]))),
        "reach_cuts": cuts,
        "reach_fit": shown(reach_fit(results), max_mm=".1f", end_max_mm=".3f"),
    }


def pictures(results: RecordedResults) -> Pictures:
    """Figures keyed by name."""
    by_seed = errors_by_seed(results["cut_errors"])
    return {
        "reach_paths": [paths_panel(results, *view) for view in (("x", "z"), ("x", "y"))],
        "reach_cuts": segmentation_figures.noise_figure(
            errors_by_level(by_seed), paired_comparison(by_seed), "noise added (mm)", "same draw"
        ),
        "reaches": [fit_panel(results, "mean_mm", 5), fit_panel(results, "max_mm", 10)],
    }


@styled
def paths_panel(results: RecordedResults, first: str, second: str) -> Figure:
    """Reaches and their primitive in the local frame, from one side."""
    words = {"x": "forward", "y": "to the side", "z": "up"}
    seen = {"z": "side", "y": "above"}[second]
    figure, axes = panel(
        f"Reaches from {'the ' * (seen == 'side')}{seen}", 3.3, xlabel=f"{words[first]} (mm)"
    )
    axes.set_ylabel(f"{words[second]} (mm)")
    place = ["xyz".index(first), "xyz".index(second)]
    learned = results.reach_primitives[0].position
    unrolled = in_local_frame(learned.unroll(results.reach_segments[0][0].dt), learned.frame)
    paths = [in_local_frame(position, learned.frame) for position, _ in results.reach_segments]
    for number, path in enumerate([*paths, unrolled]):
        look = public_names.LEARNED if path is unrolled else public_names.RECORDED
        points = 1e3 * signals.time_normalised(path.position, SAMPLES)[:, place]
        style = {"color": look.colour, "linewidth": 2.0} if path is unrolled else {"color": LIGHT_GREY}
        label = look.name if number in (0, len(paths)) else None
        axes.plot(*points.T, label=label, **({"linewidth": 0.7} | style))
    return legend(figure)


@styled
def fit_panel(results: RecordedResults, column: str, width_mm: float) -> Figure:
    """How far the primitive is from every reach, in bins of a width."""
    which = {"mean_mm": "Mean", "max_mm": "Largest"}[column]
    figure, axes = panel(f"{which} distance of the primitive", xlabel="distance (mm)", ylabel="reaches")
    for variant, colour in (("learned from", BLUE), ("left out", ORANGE)):
        values = results["reach_errors"].query("variant == @variant")[column]
        bins = np.arange(0.0, values.max() + width_mm, width_mm)
        axes.hist(values, bins.tolist(), histtype="step", color=colour, label=variant, linewidth=1.6)
    return legend(figure)


PART = Part(
    name="reaches",
    heading="Reaches",
    page="movements",
    needs=("cut_errors", "reach_errors"),
    parameters=("recorded_reaches",),
    metrics=metrics,
    evidence=evidence,
    facts=facts,
    tables=tables,
    pictures=pictures,
)
