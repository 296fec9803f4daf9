"""The scraping report: its pages with figures and tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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
from structlearn.reporting.studies import Study, read_study, rests_on
from structlearn.segmentation.segments import commanded_cuts, read_segmentation
from structlearn.testbeds.scraping import files, names
from structlearn.testbeds.scraping.page import (
    demonstration_figures,
    feedback_figures,
    refinement_figures,
    tables,
)
from structlearn.testbeds.scraping.page.feedback_results import BoardResults, FeedbackResults
from structlearn.testbeds.scraping.page.findings import OURS, STUDY, ScrapingPeople, findings
from structlearn.testbeds.scraping.page.refinement_results import (
    ADDED,
    EXPLORATION,
    RefinementResults,
    study_tables,
)
from structlearn.testbeds.scraping.page.segmentation_results import SegmentationResults
from structlearn.testbeds.scraping.protocol.execution_scores import AFTER, BEFORE, NOMINAL
from structlearn.testbeds.scraping.world.scene_still import scraping_still

Drawings = dict[str, Drawing | Sequence[Drawing]]
PACKAGE = "structlearn.testbeds.scraping.page"
STAGE = "scraping_report"
PAGES = {"index": "Segmentation and primitives", "feedback": "Feedback", "refinement": "Refinement by trial"}
"""Title by file name."""

STUDIES = (STUDY, ADDED, EXPLORATION)
"""That the pages rest on."""

PARAMETERS = {
    "index": ("clock", "simulate", "segment", "segment_sweep", "fit_primitives", "generalise"),
    "feedback": (
        *("scraping_people", "testbed", "expected_traces", "record_corrections", "coupling_dataset"),
        *("train_feedback", "compare_models", "evaluate_feedback"),
    ),
    "refinement": ("refine", "evaluate_refinement", "compare_search"),
}
"""By page, keys of `params.yaml` that its results were made with."""

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


@dataclass(frozen=True)
class ScrapingResults:
    """What the report rests on."""

    segmentation: SegmentationResults
    feedback: FeedbackResults
    refinement: RefinementResults
    studies: Mapping[str, Study | None]  # all of `STUDIES` by name; None where not run with these parameters
    parameters: Mapping[str, Any]  # all of `PARAMETERS` by key

    @property
    def people(self) -> ScrapingPeople:
        """Of the study that claims rest on."""
        return ScrapingPeople(self.studies.get(STUDY), OURS, self.feedback.primitives)


def scraping_findings(results: ScrapingResults) -> Findings:
    """All of the three pages."""
    person = results.parameters["scraping_people"].shown
    parts = results.segmentation, results.feedback, results.refinement
    return findings(*parts, results.studies.get(STUDY), person)


def pages(
    results: ScrapingResults, find: Findings, shown: Mapping[str, Table], printed: Mapping[str, Any]
) -> dict[str, Document]:
    """The pages by file name; `printed`: what the dissertation prints, of `published`."""
    people_study, count = results.studies.get(STUDY), results.people.count
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
        "over": f"Over {count} people"
        if count
        else "Over people, who were not studied with these parameters,",
        "degrees": lambda settings: listing(f"{setting:g}°" for setting in settings),
    }
    made = {}
    for page in PAGES:
        name = "segmentation" if page == "index" else page
        claims = read_claims(Path(__file__).with_name(f"{name}_claims.yaml"))
        its = facts | {"page": page}
        made[page] = Document(
            template=f"{name}.html.jinja",
            package=PACKAGE,
            stage=STAGE,
            facts=its,
            tables=shown,
            judged=judge(claims, find, environment(PACKAGE), its),
            sources=SOURCES,
            parameters={key: results.parameters[key] for key in PARAMETERS[page]},
            recordings="../rerun/scraping",
            simulated=True,
            basis=rests_on(STUDY, people_study),
        )
    return made


def published() -> Mapping[str, Any]:
    """What the dissertation prints for this testbed."""
    return read_values(Path(__file__).with_name("published.yaml"))


def all_tables(results: ScrapingResults, printed: Mapping[str, Any]) -> dict[str, Table]:
    """Those of the three pages."""
    primitives, refinement = results.feedback.primitives, results.refinement
    refined = {name: list(primitives).index(name) + 1 for name in refinement.refined}
    return (
        tables.segmentation_tables(results.segmentation)
        | tables.feedback_tables(results.feedback, printed)
        | tables.refinement_tables(refinement, primitives, printed)
        | study_tables(results.studies, refined)
    )


def all_drawings(results: ScrapingResults) -> Drawings:
    """Those of the three pages, as far as the data go."""
    return (
        segmentation_drawings(results.segmentation)
        | feedback_drawings(results.feedback, results.people)
        | refinement_drawings(results.refinement, list(results.feedback.primitives))
    )


def segmentation_drawings(results: SegmentationResults) -> Drawings:
    """Figures of the page on segmentation and primitives, as far as the data go."""
    made: Drawings = {
        "demonstrations": demonstration_figures.demonstrations_figure(results),
        "one_demonstration": demonstration_figures.one_demonstration_figure(
            results.example, results.segmentation
        ),
        "space": demonstration_figures.space_figure(results),
        "downsampling": movement_figures.downsampling_figure(results.downsampling),
        "position_fit": demonstration_figures.position_fit_figure(results),
        "forcing": demonstration_figures.forcing_figure(results),
        "sequence": movement_figures.sequence_figure(results.sequences),
        "sequence_space": demonstration_figures.sequence_space_figure(results.sequences),
        "noise_sweep": movement_figures.noise_figure(results.sweep, results.sweep_comparison),
        "orientation_fit": demonstration_figures.orientation_fit_figure(results),
    }
    if results.guesses:
        first = results.found_primitives[0]
        guess = results.most_refined_guess(first.name)
        made["correspondences"] = movement_figures.correspondence_figure(
            results.reference, guess, results.segmentation, first
        )
        made["alignment"] = movement_figures.alignment_figure(
            results.was_cut, results.segmentation, results.found_primitives
        )
    return made


def feedback_drawings(results: FeedbackResults, studied: ScrapingPeople) -> Drawings:
    """Figures of the page on feedback models; two of them show the people studied."""
    board, known = results.board, (*results.seen_deg, 0.0)
    made: Drawings = {
        "expected_traces": feedback_figures.expected_figure(results),
        "coupling_targets": feedback_figures.targets_figure(results),
        "models": feedback_figures.models_figure(results, studied),
        "weights": feedback_figures.weights_figure(results),
        "still": scraping_still(board.examples[POINTWISE][0], board.example_deg),
        "executions": feedback_figures.executions_figure(board, results.primitives),
        "board_roll": feedback_figures.roll_figure(results),
        "board_cost": feedback_figures.cost_figure(
            board, results.primitives, lambda setting: "" if setting in known else "unseen", studied
        ),
    }
    for name in results.adapted:
        panels = feedback_figures.closed_loop_figure(results, name)
        made[f"closed_loop_{name}"] = [Raster(panel) for panel in panels]  # lines by the hundred
    return made


def refinement_drawings(results: RefinementResults, primitives: list[str]) -> Drawings:
    """Figures of the page on refinement by trial, as far as the data go."""
    made: Drawings = {
        "refinement_learning": refinement_figures.learning_figure(results, primitives),
        "refinement_cost": feedback_figures.cost_figure(results, primitives, results.role),
    }
    if results.evaluated:
        made["refinement_snapshots"] = refinement_figures.snapshots_figure(results, primitives)
    if results.searched_primitives:
        made["search_efficiency"] = refinement_figures.search_figure(results, primitives)
    return made


def read_results(found: files.ScrapingFiles, parameters: Mapping[str, Any]) -> ScrapingResults:
    """Outputs of the stages and of studies."""
    primitives = found.primitives()
    segmentation = SegmentationResults(
        demonstrations=found.runs("nominal"),
        segmentation=read_segmentation(found.segments),
        noise=found.table("noise"),
        downsampling=found.table("downsampling"),
        downsampling_people=found.table("downsampling_people"),
        primitives=primitives,
        reproduction=found.table("reproduction"),
        nominal=found.table("nominal"),
        generalised=found.table("generalised"),
        segment_parameters=parameters["segment"],
        fit_parameters=parameters["fit_primitives"],
    )
    own = [primitive.name for primitive in primitives]
    return ScrapingResults(
        segmentation,
        read_feedback(found, own, parameters),
        read_refinement(found, parameters),
        {name: read_study(name) for name in STUDIES},
        parameters,
    )


def read_feedback(
    found: files.ScrapingFiles, primitives: list[str], parameters: Mapping[str, Any]
) -> FeedbackResults:
    """What the feedback stages wrote."""
    unrolls, datasets = found.runs("unrolls"), found.datasets()
    return FeedbackResults(
        primitives=primitives,
        unrolls=unrolls,
        unroll_cuts=commanded_cuts(unrolls, primitives),
        expected=found.expected(),
        datasets=datasets,
        checks={name: found.checks(name) for name in datasets},
        networks=found.networks(POINTWISE),
        comparison=found.table("comparison"),
        orderings=found.table("orderings"),
        seen_deg=parameters["coupling_dataset"].settings_deg,
        board=_board(found, parameters),
    )


def _board(found: files.ScrapingFiles, parameters: Mapping[str, Any]) -> BoardResults:
    """What was executed on the board."""
    largest = max(parameters["evaluate_feedback"].settings_deg)
    return BoardResults(
        scores=found.table("scores"),
        traces=found.table("traces"),
        path_errors=found.table("path_errors"),
        examples={model: found.runs_at(largest, files.CLOSED_LOOP, model) for model in (NOMINAL, POINTWISE)},
        corrected=found.runs_at(largest, files.CORRECTIONS),
        example_deg=largest,
        axis=parameters["coupling_dataset"].unit_axis,
        force_n=parameters["testbed"].control.force_n,
    )


def read_refinement(found: files.ScrapingFiles, parameters: Mapping[str, Any]) -> RefinementResults:
    """What the stages of the refinement wrote."""
    tilt = parameters["refine"].setting_deg
    examples = {model: found.runs_at(tilt, files.REFINED, model) for model in (NOMINAL, BEFORE, AFTER)}
    return RefinementResults(
        scores=found.table("refined_scores"),
        examples={model: runs for model, runs in examples.items() if runs},
        example_deg=tilt,
        axis=parameters["coupling_dataset"].unit_axis,
        history=found.table("history"),
        search=found.table("search"),
        parameters=parameters["refine"],
    )
