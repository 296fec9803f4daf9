"""Sections on touch in a latent space, and on simulated beside recorded touch."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from dissertation.recorded.transfer.learning import PARTNERS, SIMULATED
from structlearn.reporting.document import Table
from structlearn.reporting.evidence import Evidence, exact, geometric_mean
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import rounded
from structlearn.tasks.motion.motion_results import stated
from structlearn.tasks.section import Section, shown
from structlearn.tasks.task_files import TaskFiles
from structlearn.tasks.touch.touch_names import COMPONENTS, PLAIN, SPACES, STRUCTURED

Tables = Mapping[str, pd.DataFrame]

MODELS = (STRUCTURED, PLAIN, COMPONENTS)
QUANTITIES = ("contact", "range", "noise", "active", "dimensions", "spectrum")  # of `finger_statistics`


def sections(files: TaskFiles) -> list[Section]:
    """Sections from the tables of `learning.learn`."""
    tables = files.tables("transfer")
    find = find_transfer(tables)
    found = {"touch_scores": scores_table(tables)}
    if "fingers" in tables:
        found["fingers"] = shown(tables["fingers"], ratio=".2f")
    section = Section(
        "touch",
        "Touch in a latent space",
        "transfer.html.jinja",
        "transfer_lead.html.jinja",
        facts={
            "sets": tables["sets"].set_index("set").to_dict("index"),
            "fingers": "fingers" in tables,
            "origins": files.origins(),
        },
        find=find,
        tables=found,
    )
    return [section]


def by_part(tables: Tables, error: str, source: str, target: str, model: str = STRUCTURED) -> pd.Series:
    """Errors by part held out, mean over seeds; by seed if there is only one part."""
    its = tables["errors"].query("learned_from == @source and test_run == @target and model == @model")
    return its.groupby("part" if len(set(its["part"])) > 1 else "seed")[error].mean()


def pairs(tables: Tables) -> list[tuple[str, str]]:
    """Sets learned from, and sets tested on."""
    there = set(tables["sets"]["set"])
    named = [(name, name) for name in (*PARTNERS, *PARTNERS.values()) if name in there]
    return named + [(partner, name) for name, partner in PARTNERS.items() if name in there]


def find_transfer(tables: Tables) -> Findings:
    """Findings, by the names that claims and sentences use; errors are skewed, so means are geometric."""
    find, sets = (
        Findings("trials held out, or seeds"),
        [name for name in PARTNERS if (name, name) in pairs(tables)],
    )

    def typical(error: str, source: str, target: str, over: str = "") -> Evidence:
        its = by_part(tables, error, source, target)
        if over:  # a rival without seeds
            rival = by_part(tables, error, source, target, over)
            its = its / (rival if len(rival) == len(its) else rival.mean())
        return geometric_mean(its.to_numpy())

    find.add("reconstruction", {name: typical("reconstruction", name, name) for name in sets})
    find.add("map_distances", {name: typical("distances", name, name) for name in sets})
    find.add("over_components", {name: typical("reconstruction", name, name, COMPONENTS) for name in sets})
    if (SIMULATED, SIMULATED) in pairs(tables):
        over = typical("reconstruction", SIMULATED, SIMULATED, COMPONENTS)
        find.add("over_components_simulated", over)
    else:
        find.unknown("over_components_simulated", "its recorded set is missing")
    carried = {name: typical("reconstruction", PARTNERS[name], name) for name in sets}
    find.add("carried_over", carried)
    for name in sets:
        find.exact(f"reconstruction_nmse_simulated_to_{name}", carried[name].value, headline=True)
    fingers = tables.get("fingers")
    for quantity in QUANTITIES:
        if fingers is None:
            find.unknown(quantity, "no scraping execution is recorded here")
        else:
            its = fingers[fingers["quantity"] == quantity]
            ratios = {row.case.removesuffix(" (counts)"): exact(row.ratio) for row in its.itertuples()}
            find.among("recorded executions").add(quantity, ratios)
    return find


def scores_table(tables: Tables) -> Table:
    """Geometric means over trials held out or seeds, with their intervals as text."""

    def text(source: str, target: str, error: str, model: str) -> str:
        found = geometric_mean(by_part(tables, error, source, target, model).to_numpy())
        return stated(found, ".2f") if np.isfinite(found.low) else rounded(found.value, ".2f")

    columns = [(f"reconstruction, {SPACES[model].name}", "reconstruction", model) for model in MODELS]
    columns += [(f"{error}, structured", error, STRUCTURED) for error in ("distances", "pressure")]
    rows = [
        {"learned from": source, "tested on": target if source != target else "held-out trials"}
        | {heading: text(source, target, error, model) for heading, error, model in columns}
        for source, target in pairs(tables)
    ]
    return Table(pd.DataFrame(rows))
