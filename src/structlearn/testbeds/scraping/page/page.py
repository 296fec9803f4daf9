"""The scraping report: its three pages with their tables, figures and sources."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import pandas as pd

from structlearn.core.metrics import mean_interval, verdict
from structlearn.core.params import read_values
from structlearn.feedback.coupling_dataset import PARTS
from structlearn.feedback.feedback_models import POINTWISE, UNROLLED
from structlearn.primitives.kernels import KERNEL_COUNT
from structlearn.reporting import movement_figures
from structlearn.reporting.claims import judge, read_claims
from structlearn.reporting.document import Document, Source, Table, environment
from structlearn.reporting.figure_style import Drawing, Raster
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import listing, with_spread
from structlearn.reporting.studies import rests_on
from structlearn.segmentation.alignment import RESULT
from structlearn.testbeds.scraping import names
from structlearn.testbeds.scraping.names import primitive_title
from structlearn.testbeds.scraping.page import board_figures, demonstration_figures
from structlearn.testbeds.scraping.page.executed import ExecutionResults
from structlearn.testbeds.scraping.page.findings import people_of
from structlearn.testbeds.scraping.page.results import PEOPLE, FeedbackResults, ScrapingResults
from structlearn.testbeds.scraping.protocol.execution_scores import NOMINAL
from structlearn.testbeds.scraping.world.scene_still import scraping_still

PAGES = {"index": "Segmentation and primitives", "feedback": "Feedback", "refinement": "Refinement by trial"}
"""Title by file name."""

SOURCES = {
    "demonstrations": Source("data/runs/scraping/nominal.parquet", "scraping_import_nominal"),
    "segments": Source("data/segments/scraping", "scraping_segment"),
    "sweep": Source("data/segments/scraping_sweep", "scraping_sweep"),
    "primitives": Source("data/primitives/scraping", "scraping_fit_primitives"),
    "expected": Source("data/feedback/scraping/expected", "scraping_expected_traces"),
    "dataset": Source("data/feedback/scraping/dataset", "scraping_coupling_dataset"),
    "models": Source("data/feedback/scraping/models", "scraping_train_feedback"),
    "comparison": Source("data/feedback/scraping/comparison", "scraping_compare_models"),
    "closed_loop": Source("data/runs/scraping/closed_loop", "scraping_evaluate_feedback"),
    "corrections": Source("data/runs/scraping/corrections", "scraping_import_corrections"),
    "evaluation": Source("data/feedback/scraping/evaluation", "scraping_evaluate_feedback"),
    "refinement": Source("data/feedback/scraping/refinement", "scraping_refine"),
    "refined": Source("data/feedback/scraping/refined", "scraping_evaluate_refinement"),
    "search": Source("data/feedback/scraping/search", "scraping_compare_search"),
}
"""Files that figures and tables come from, with the stages that make them."""


def published() -> Mapping[str, Any]:
    """What the dissertation prints for this testbed."""
    return read_values(Path(__file__).with_name("published.yaml"))


def pages(
    results: ScrapingResults,
    find: Findings,
    shown: Mapping[str, Table],
    printed: Mapping[str, Any],
    listed: Mapping[str, Iterable[str]],
) -> dict[str, Document]:
    """The pages by file name; `printed`: of `published`; `listed`: keys of the parameters of each page."""
    count = people_of(results).count
    over = f"Over {count} people" if count else "Over people, who were not studied with these parameters,"
    facts = {
        "pages": PAGES,
        "published": printed,
        "params": results.parameters,
        "person": results.parameters["scraping_people"].shown,
        "results": results.segmentation,
        "feedback": results.feedback,
        "refinement": results.refinement,
        "primitives": results.feedback.primitives,
        "names": names,
        "found": find,
        "people": count,
        "kernel_count": KERNEL_COUNT,
        "over": over,
        "degrees": lambda settings: listing(f"{setting:g}°" for setting in settings),
    }
    made = {}
    for page, keys in listed.items():
        name = "segmentation" if page == "index" else page
        claims = read_claims(Path(__file__).with_name(f"{name}_claims.yaml"))
        its = facts | {"page": page}
        made[page] = Document(
            template=f"{name}.html.jinja",
            package=__package__,
            stage="scraping_report",
            facts=its,
            tables=shown,
            judged=judge(claims, find, environment(__package__), its),
            sources=SOURCES,
            parameters={key: results.parameters[key] for key in keys},
            recordings="../rerun/scraping",
            simulated=True,
            basis=rests_on(PEOPLE, results.study),
        )
    return made


def drawings(results: ScrapingResults) -> dict[str, Drawing | Sequence[Drawing]]:
    """Figures of the three pages, as far as the data go; two of them show the people studied."""
    cut, fed, refined = results.segmentation, results.feedback, results.refinement
    names_of_all, people = list(fed.primitives), people_of(results)
    known = (*fed.seen_deg, 0.0)
    made: dict[str, Drawing | Sequence[Drawing]] = {
        "demonstrations": demonstration_figures.demonstrations_figure(cut),
        "one_demonstration": demonstration_figures.one_demonstration_figure(cut.example, cut.segmentation),
        "space": demonstration_figures.space_figure(cut),
        "downsampling": movement_figures.downsampling_figure(cut.downsampling),
        "position_fit": demonstration_figures.position_fit_figure(cut),
        "forcing": demonstration_figures.forcing_figure(cut),
        "sequence": movement_figures.sequence_figure(cut.sequences),
        "sequence_space": demonstration_figures.sequence_space_figure(cut.sequences),
        "noise_sweep": movement_figures.noise_figure(cut.sweep, cut.sweep_comparison),
        "orientation_fit": demonstration_figures.orientation_fit_figure(cut),
        "expected_traces": board_figures.expected_figure(fed),
        "coupling_targets": board_figures.targets_figure(fed),
        "models": board_figures.models_figure(fed, people),
        "weights": board_figures.weights_figure(fed),
        "still": scraping_still(fed.examples[POINTWISE][0], fed.example_deg),
        "executions": board_figures.executions_figure(fed),
        "board_roll": board_figures.roll_figure(fed),
        "board_cost": board_figures.cost_figure(
            fed, names_of_all, lambda setting: "" if setting in known else "unseen", people
        ),
        "refinement_learning": board_figures.learning_figure(refined, names_of_all),
        "refinement_cost": board_figures.cost_figure(refined, names_of_all, refined.role),
    }
    for name in fed.adapted:
        panels = board_figures.closed_loop_figure(fed, name)
        made[f"closed_loop_{name}"] = [Raster(panel) for panel in panels]  # lines by the hundred
    if cut.guesses:
        first = cut.found_primitives[0]
        made["correspondences"] = movement_figures.correspondence_figure(
            cut.reference, cut.most_refined_guess(first.name), cut.segmentation, first
        )
        made["alignment"] = movement_figures.alignment_figure(
            cut.was_cut, cut.segmentation, cut.found_primitives
        )
    if refined.evaluated:
        made["refinement_snapshots"] = board_figures.snapshots_figure(refined, names_of_all)
    if refined.searched_primitives:
        made["search_efficiency"] = board_figures.search_figure(refined, names_of_all)
    return made


LOOKS = names.CUT_METHODS | names.REPRESENTATIONS | names.RUNS | names.SEARCHES | names.ROLLOUTS
WORDS: Mapping[str, Mapping[Any, str]] = {
    column: {key: look.name for key, look in LOOKS.items()}
    for column in ("method", "model", "baseline", "representation", "better", "worse", "kind")
} | {
    "left_out": {False: "all", True: "all but the one compared"},
    "seen": {True: "learned from", False: "never learned from"},
    "stopping": {"validation": "validation", "generalization": "the one left out"},
}
"""By column, what is written for a key; names are those of figures and recordings."""

DECIMALS = {
    2: "spread_mm distance_mm gain_mm low_mm high_mm mean_mm mean_deg end_deg ratio reproduction_deg "
    "roll_torque_mn_m mean_shift_ms pointwise_deg pointwise_std unrolled_deg unrolled_std std_deg norm_rad "
    "others shift_samples shift_samples_text",
    1: "mean_ms max_shift_ms max_mm max_deg difference_ms low_ms high_ms half_width_ms mean std low high "
    "step lower_rad since_lower_rad since_half_width end_roll_deg cost_rad mean_below mean_above",
    3: "end_mm smoothing_deg difference lower_deg force_n force_std_n "
    + " ".join(f"{part}_{what}" for part in PARTS for what in ("mean", "std")),
    0: "max_ms",
}
FORMATS = {name: f".{digits}f" for digits, names in DECIMALS.items() for name in names.split()}
FORMATS |= {
    "half_width": ".3g",
    "noise_mm": "g",
    "setting_deg": "g",
    "work": ".2g",
    "p_value": ".2g",
    "dimensions": ".2g",
}
UNITS = {"mm": "mm", "ms": "ms", "deg": "°", "rad": "rad", "n": "N", "s": "s"}
HEADINGS = {
    "factor": "g",
    "which": "",
    "setting_deg": "board (°)",
    "better": "first",
    "worse": "second",
    "low": "from",
    "high": "to",
    "left_out": "learned from",
    "others": "other axes",
    "shift_samples": "largest, coarse samples",
    "shift_samples_text": "as printed, coarse samples",
    "roll_torque_mn_m": "roll torque (mN m)",
    "lower_rad": "lower by (rad)",
    "since_lower_rad": "lower than iteration 2 (rad)",
    "generalization": "generalisation",
}


def tables(results: ScrapingResults, printed: Mapping[str, Any]) -> dict[str, Table]:
    """Tables of the three pages that have any rows; `printed`: see `published`."""
    cut, fed, refined = results.segmentation, results.feedback, results.refinement
    frames = {
        "demonstrations_left_out": cut.segmentation.left_out,
        "cut_points": cut.segmentation.cuts,
        "cut_errors": cut.errors_of_cuts,
        "alignment": cut.alignment,
        "noise_sweep": cut.sweep,
        "noise_sweep_comparison": cut.sweep_comparison,
        "downsampling": cut.downsampling,
        "reproduction": cut.fit,
        "coupling_checks": fed.checks,
        "model_errors": fed.model_errors.reset_index(),
        "model_orderings": fed.orderings,
        "model_nmse": nmse_beside_published(results, printed),
        "board_nominal": fed.nominal.reset_index(),
        "board_costs": fed.costs,
        "board_cost_ratios": fed.ratios,
        "board_coupling": fed.coupling,
        "path_errors": path_comparison(fed),
        "hand_roll": hand_rolls(fed, fed.primitives, printed),
        "refinement_curves": refined.curves,
        "refinement_progress": refined.progress,
        "refinement_costs": refined.costs,
        "refinement_cost_ratios": refined.ratios,
        "refinement_between": refined.between,
        "refinement_faults": refined.faults,
    }
    if refined.examples:
        frames["hand_roll_refined"] = hand_rolls(refined, fed.primitives, printed)
    if len(refined.search):
        frames |= {"search_efficiency": refined.searches, "searches": refined.searched.reset_index()}
    return {name: _shown(frame) for name, frame in frames.items() if frame is not None and len(frame)}


def _shown(frame: pd.DataFrame) -> Table:
    """A table with names for keys and headings; rows of the method that is used below are bold."""
    headings = {name: HEADINGS.get(name, _heading(name)) for name in frame.columns}
    strong = frozenset(place for place, one in enumerate(frame.get("method", ())) if one == RESULT)
    return Table(frame, FORMATS, headings, strong, WORDS)


def _heading(column: str) -> str:
    """`mean_ms` as `mean (ms)`."""
    name, _, unit = column.rpartition("_")
    return f"{name.replace('_', ' ')} ({UNITS[unit]})" if name and unit in UNITS else column.replace("_", " ")


def nmse_beside_published(results: ScrapingResults, published: Mapping) -> pd.DataFrame:
    """Table IV.5: NMSE of PMNN with 100 nodes, mean ± std over the folds."""
    fed, rows = results.feedback, []
    for name in fed.adapted:
        title = primitive_title(fed.primitives, name)
        printed = published["nmse"].get(name, {})
        if printed:
            cells = {part: with_spread(mean, std, ".2f") for part in PARTS for mean, std in [printed[part]]}
            rows.append({"primitive": title, "which": "published"} | cells)
        for stopping, rule in (("generalization", ", as published"), ("validation", "")):
            error = fed.model_errors.loc[(name, "pmnn_100", stopping)]
            cells = {part: with_spread(error[f"{part}_mean"], error[f"{part}_std"], ".3f") for part in PARTS}
            which = f"here, step best for {WORDS['stopping'][stopping]}{rule}"
            rows.append({"primitive": title, "which": which} | cells)
    return pd.DataFrame(rows)


def path_comparison(results: FeedbackResults) -> pd.DataFrame:
    """Errors of the unrolled path, pointwise beside unrolled, in training settings and others.

    One row per `primitive` and `seen`: `count` of demonstrations, mean and std of both models, the mean
    paired difference `lower_deg` (pointwise minus unrolled), and the `verdict` on the unrolled model.
    """
    keys = ["primitive", "setting_deg", "demonstration"]
    wide = results.path_errors.pivot_table("error_deg", keys, "model").reset_index()
    known = wide["setting_deg"].isin(list(results.seen_deg))
    rows = []
    for name, seen in product(results.adapted, (True, False)):
        part = wide[(wide["primitive"] == name) & (known == seen)]
        if len(part):
            row: dict[str, object] = {"primitive": name, "seen": seen, "count": len(part)}
            for model in (POINTWISE, UNROLLED):
                row |= {f"{model}_deg": part[model].mean(), f"{model}_std": part[model].std()}
            lower, half_width = mean_interval((part[POINTWISE] - part[UNROLLED]).to_numpy())
            row |= {"lower_deg": lower, "half_width": half_width}
            rows.append(row | {"verdict": str(verdict(lower - half_width, lower + half_width))})
    return pd.DataFrame(rows)


def hand_rolls(executed: ExecutionResults, primitives: Sequence[str], published: Mapping) -> pd.DataFrame:
    """Figure IV.17: rolls of the hand in degrees; the protractor's stand beside those at the same tilt."""
    columns, printed = ["start", *(f"end of {name}" for name in primitives)], published["hand"]
    rows = []
    if executed.example_deg == printed["setting_deg"]:
        for model, words in ((NOMINAL, "no feedback"), (POINTWISE, "with feedback")):
            readings = [f"{reading:.1f}" for reading in printed[model]]
            rows.append({"which": f"published, {words}"} | dict(zip(columns, readings, strict=False)))
    for model, found in executed.hand_roll.groupby("model", sort=False):
        cells = [with_spread(*reading) for reading in zip(found["mean_deg"], found["std_deg"], strict=True)]
        rows.append({"which": f"here, {names.RUNS[model].name}"} | dict(zip(columns, cells, strict=True)))
    return pd.DataFrame(rows)
