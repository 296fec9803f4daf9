"""The scraping report: its three pages, their figures and sources."""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from dissertation.evidence.claims import judge, read_claims, rendered
from dissertation.evidence.judged_page import JudgedDocument
from dissertation.evidence.results import Results, with_study
from dissertation.evidence.studies import OURS, Study, rests_on
from dissertation.scraping import names
from dissertation.scraping.page import alignment_figures, board_figures, demonstration_figures, tables
from dissertation.scraping.page.findings import STUDY, WHO
from dissertation.scraping.page.stored import Stored, channel_name
from dissertation.scraping.protocol.feedback_models import POINTWISE
from dissertation.scraping.protocol.phase_dependence import dominant_nodes
from dissertation.scraping.protocol.results import UNSEEN, role_of
from dissertation.scraping.world.scene_still import scraping_still
from structlearn.core.params import read_values
from structlearn.primitives.kernels import KERNEL_COUNT
from structlearn.reporting import movement_figures
from structlearn.reporting.document import Source, Table
from structlearn.reporting.figure_style import Drawing
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import listing

PAGES = {"index": "Segmentation and primitives", "feedback": "Feedback", "refinement": "Refinement by trial"}
"""Page titles, by file name."""

SOURCES = {
    "results": Source("data/results/scraping.parquet", "scraping_results"),
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
"""Files behind figures and tables, and the stages that write them."""


def beside(name: str) -> Any:
    """Content of a YAML file beside this module."""
    return read_values(Path(__file__).with_name(f"{name}.yaml"))


def pages(
    stored: Stored,
    frames: tables.Frames,
    find: Findings,
    shown: Mapping[str, Table],
    study: Study | None,
    listed: Mapping[str, Iterable[str]],
) -> dict[str, JudgedDocument]:
    """All pages, keyed by file name.

    `frames`: tables of `tables.derived`; `shown`: the same as displayed; `listed`: parameter keys of each
    page.
    """
    numbers, refined = find.numbers(), stored.tables["refined_scores"]
    count, role = numbers.get("people"), partial(role_of, parameters=stored.parameters["refine"])
    trained = stored.parameters["train_feedback"]
    facts = {
        "pages": PAGES,
        "published": beside("published"),
        "params": stored.parameters,
        "person": stored.parameters["scraping_people"].shown,
        "stored": stored,
        "frames": frames,
        "derive": tables,
        "tilts": tables.settings(stored.tables["scores"], tilted=True),
        "unseen": [one for one in tables.settings(refined, tilted=True) if role(one) == UNSEEN],
        "refined": stored.tables["history"]["primitive"].unique().tolist(),
        "role": role,
        "dominant": {name: dominant_nodes(its) for name, its in stored.networks.items()},
        "trained": names.network_name(trained.network, trained.hidden),
        "curve": partial(tables.curve, frames["refinement_curves"]),
        "channel_name": channel_name,
        "names": names,
        "found": find,
        "numbers": numbers,
        "people": count,
        "kernel_count": KERNEL_COUNT,
        "over": f"Over {count} people" if count else "For one person",
        "degrees": lambda settings: listing(f"{setting:g}°" for setting in settings),
    }
    made = {}
    for page, keys in listed.items():
        name = "segmentation" if page == "index" else page
        claims = read_claims(Path(__file__).with_name(f"{name}_claims.yaml"))
        its = facts | {"page": page}
        untested = [
            {key: rendered(text, its) for key, text in one.items()} for one in beside("untested")[name]
        ]
        made[page] = JudgedDocument(
            template=f"{name}.html.jinja",
            package=__package__,
            stage="scraping_report",
            facts=its | {"untested": untested},
            tables=shown,
            judged=judge(claims, find, its),
            sources=SOURCES,
            parameters={key: stored.parameters[key] for key in keys},
            recordings="../rerun/scraping",
            simulated=True,
            basis=rests_on(STUDY, study),
        )
    return made


def shown_by_figures(own: pd.DataFrame, study: Study | None) -> tuple[Results, Results]:
    """People whose results the figures of feedback and of the refinement show.

    Those of the study where it was made with these parameters, else this run's person. The study's results of
    the refinement lack most tilts, so that its figure is of this run's person.
    """
    population = with_study(own, study, WHO, [], variant=OURS)
    return (population.results if population.results.has("cost") else population.one), population.one


def drawings(
    stored: Stored, frames: tables.Frames, own: pd.DataFrame, study: Study | None
) -> dict[str, Drawing | Sequence[Drawing]]:
    """Figures of the three pages, as far as the data allow, keyed by name."""
    raw, cuts = stored.tables, stored.segmentation
    people, one = shown_by_figures(own, study)
    known = (*stored.parameters["coupling_dataset"].settings_deg, 0.0)
    role = partial(role_of, parameters=stored.parameters["refine"])
    cut_errors, paired = movement_figures.noise_figure(
        frames["noise_sweep"], frames["noise_sweep_comparison"]
    )
    made: dict[str, Drawing | Sequence[Drawing]] = {
        "demonstrations": demonstration_figures.demonstrations_figure(stored),
        "one_demonstration": demonstration_figures.one_demonstration_figure(stored),
        "space": demonstration_figures.space_figure(stored),
        "downsampling": alignment_figures.downsampling_figure(raw["downsampling"]),
        "position_fit": demonstration_figures.position_fit_figure(stored),
        "forcing": demonstration_figures.forcing_figure(stored.primitives),
        "sequence": movement_figures.sequence_figure(stored.sequences),
        "sequence_space": demonstration_figures.sequence_space_figure(stored.sequences),
        "noise_sweep": paired,
        "orientation_fit": demonstration_figures.orientation_fit_figure(stored),
        "expected_traces": board_figures.expected_figure(stored),
        "coupling_targets": board_figures.targets_figure(stored),
        "models": board_figures.models_figure(people),
        "weights": board_figures.weights_figure(stored),
        "still": [scraping_still(stored.tilted[POINTWISE][0], stored.tilt_deg), cut_errors],
        "executions": board_figures.executions_figure(stored),
        "board_roll": board_figures.roll_figure(stored),
        "board_cost": board_figures.cost_figure(
            stored, people, one, "cost", lambda tilt: "" if tilt in known else "unseen"
        ),
        "refinement_learning": board_figures.learning_figure(stored, frames["refinement_curves"]),
        "refinement_cost": board_figures.cost_figure(
            stored, one, one, "refined_cost", lambda tilt: role(tilt) if tilt else "default"
        ),
        "alignment": alignment_figures.alignment_figure(stored.was_cut, cuts, stored.found_primitives),
    }
    for name in stored.adapted:
        panels = board_figures.closed_loop_figure(stored, name)
        shown = {0, len(panels) // 2, len(panels) - 1}
        made[f"closed_loop_{name}"] = [panels[place] for place in sorted(shown)]
        made[f"other_tilts_{name}"] = [one for place, one in enumerate(panels) if place not in shown]
    first = stored.found_primitives[0]
    guess = stored.most_refined_guess(first.name)
    made["correspondences"] = alignment_figures.correspondence_figure(stored.reference, guess, cuts, first)
    if stored.refined_deg in tables.settings(raw["refined_scores"]):
        made["refinement_snapshots"] = board_figures.snapshots_figure(stored)
    if "search_efficiency" in frames:
        made["search_efficiency"] = board_figures.search_figure(stored, frames["search_efficiency"])
    return made
