"""The scraping report: its three pages with their figures."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from structlearn.core.params import read_values
from structlearn.feedback.feedback_models import POINTWISE
from structlearn.primitives.kernels import KERNEL_COUNT
from structlearn.reporting import movement_figures
from structlearn.reporting.claims import judge, read_claims
from structlearn.reporting.document import Document, Source, Table, environment
from structlearn.reporting.figure_style import Drawing, Raster
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import listing
from structlearn.reporting.studies import rests_on
from structlearn.testbeds.scraping import names
from structlearn.testbeds.scraping.page import demonstration_figures, feedback_figures, refinement_figures
from structlearn.testbeds.scraping.page.findings import people_of
from structlearn.testbeds.scraping.page.results import PEOPLE, ScrapingResults
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
    board, names_of_all, people = fed.board, list(fed.primitives), people_of(results)
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
        "expected_traces": feedback_figures.expected_figure(fed),
        "coupling_targets": feedback_figures.targets_figure(fed),
        "models": feedback_figures.models_figure(fed, people),
        "weights": feedback_figures.weights_figure(fed),
        "still": scraping_still(board.examples[POINTWISE][0], board.example_deg),
        "executions": feedback_figures.executions_figure(board, names_of_all),
        "board_roll": feedback_figures.roll_figure(fed),
        "board_cost": feedback_figures.cost_figure(
            board, names_of_all, lambda setting: "" if setting in known else "unseen", people
        ),
        "refinement_learning": refinement_figures.learning_figure(refined, names_of_all),
        "refinement_cost": feedback_figures.cost_figure(refined, names_of_all, refined.role),
    }
    for name in fed.adapted:
        panels = feedback_figures.closed_loop_figure(fed, name)
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
        made["refinement_snapshots"] = refinement_figures.snapshots_figure(refined, names_of_all)
    if refined.searched_primitives:
        made["search_efficiency"] = refinement_figures.search_figure(refined, names_of_all)
    return made
