"""The page section of a task with touches: a skin and its map, slides over surfaces, or sets of touches."""

from structlearn.core.artefacts import read_table
from structlearn.reporting.claims import Evidence
from structlearn.reporting.document import Source
from structlearn.reporting.findings import Findings
from structlearn.tasks.section import Section
from structlearn.tasks.task_entry import PIPELINE, TouchEntry
from structlearn.tasks.task_files import TaskFiles
from structlearn.tasks.touch.page import skin_section, surface_section, transfer_section
from structlearn.tasks.touch.page.skin_figures import skin_pictures

HEADLINES = (
    *("map_nmse", "latent_mm", "laid_mm", "laid_cross_run_mm", "pressure_nmse", "force_n", "servo_success"),
    *("reconstruction_nmse_simulated_to_slides", "reconstruction_nmse_simulated_to_unscrewing"),
    *("reconstruction_nmse_slides", "reconstruction_nmse_unscrewing"),
)
"""Findings that stand first."""


def section(files: TaskFiles) -> Section:
    """Of a task with touches, by what its entry asks for."""
    entry = files.entry(TouchEntry)
    tables = {path.stem: read_table(path) for path in sorted((files.folder / "touch").glob("*.parquet"))}
    source = {"touch": Source(f"{files.folder}/touch", f"{PIPELINE}:touch@{files.name}")}
    if entry.surfaces is not None:
        find = surface_section.find_surfaces(tables)
        return Section(
            "touch",
            "Slides over materials",
            "surfaces.html.jinja",
            "surfaces_lead.html.jinja",
            facts=surface_section.surface_facts(tables, find),
            metrics=metrics(files.name, find),
            tables=surface_section.surface_tables(tables),
            pictures=surface_section.surface_pictures(tables),
            sources=source,
            evidence=find,
        )
    if entry.transfer is not None:
        find = transfer_section.find_transfer(tables)
        return Section(
            "touch",
            "Touch in a latent space",
            "transfer.html.jinja",
            "transfer_lead.html.jinja",
            facts=transfer_section.transfer_facts(tables, find),
            metrics=metrics("touch", find),
            tables=transfer_section.transfer_tables(tables),
            pictures=transfer_section.transfer_pictures(tables),
            sources=source,
            evidence=find,
        )
    runs = skin_section.SkinRuns(tables, entry.tuned_on)
    find = skin_section.find_skin(runs)
    return Section(
        "touch",
        "A magnetic skin" if entry.by_norm else "The skin",
        "skin.html.jinja",
        "skin_lead.html.jinja",
        facts=skin_section.skin_facts(runs, find, entry) | {"folder": f"{files.folder}/touch"},
        metrics=metrics(files.name, find),
        tables=skin_section.skin_tables(runs),
        pictures=skin_pictures(runs),
        sources=source,
        evidence=find,
    )


def metrics(name: str, find: Findings) -> dict[str, float]:
    """Findings without cases, called `NAME_...`, those that stand for all others first."""
    known = {key: found.value for key, found in find.items() if isinstance(found, Evidence)}
    first = [key for key in HEADLINES if key in known]
    stem = name.replace("-", "_")
    return {f"{stem}_{key}": known[key] for key in [*first, *(one for one in known if one not in first)]}
