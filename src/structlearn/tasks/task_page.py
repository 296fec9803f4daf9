"""Page of a task: one section for each of its parts."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from structlearn.reporting.document import Document, Source, Table
from structlearn.reporting.figure_style import Drawing
from structlearn.reporting.findings import Findings
from structlearn.reporting.publishing import publish_report
from structlearn.tasks.motion import motion_section
from structlearn.tasks.movement import check_section, corrections_section, cuts_section, primitives_section
from structlearn.tasks.obstacles import scene_section
from structlearn.tasks.project import PACKAGE, entry_files, is_lab, pipeline
from structlearn.tasks.section import Section
from structlearn.tasks.task_entry import read_checked
from structlearn.tasks.task_files import TaskFiles, is_public
from structlearn.tasks.touch import skin_section, surface_section

MakeSection = Callable[[TaskFiles], Section | None]
SECTIONS: dict[str, tuple[MakeSection, ...]] = {
    "movement": (
        cuts_section.recordings_section,
        cuts_section.cuts_section,
        cuts_section.rests_section,
        primitives_section.primitives_section,
        primitives_section.turns_section,
        primitives_section.execution_section,
        primitives_section.traces_section,
        corrections_section.phase_section,
        corrections_section.feedback_section,
        check_section.skill_section,
        check_section.check_section,
    ),
    "motion": (motion_section.section,),
    "touch": (skin_section.section, surface_section.section),
    "obstacles": (scene_section.section,),
}

NAMED = ("primitives", "feedback", "skill", "check", "motion", "touch", "obstacles")
STAGES = {"recorded": "import_movement", "segments": "segment"} | {name: name for name in NAMED}
"""Stage that writes each folder of a task's data."""


@dataclass(frozen=True)
class TaskPage:
    """A task's page with what it shows."""

    document: Document
    pictures: Mapping[str, Drawing | Sequence[Drawing]]  # figures by name
    find: Findings  # every number that the sections state


def publish_page(files: TaskFiles) -> None:
    """Publish a task's page with its figures, tables and findings."""
    page = task_page(files)
    tables = page.document.tables
    publish_report(files.report, {"index": page.document}, page.pictures, tables, page.find)


def task_page(files: TaskFiles, more: Sequence[MakeSection] = ()) -> TaskPage:
    """Page of a task; `more`: sections after those of its kind."""
    kind, task, absent = files.kind, read_checked(files.parameters), files.absent
    makers = () if absent else (*SECTIONS[kind], *more)
    sections = [one for make in makers if (one := _made(make, files)) is not None]
    of_task = f"{pipeline()}:{{}}@{files.name}"
    sources = {
        name: Source(f"{files.folder}/{name}", of_task.format(stage)) for name, stage in STAGES.items()
    }
    sources |= dict.fromkeys(("recordings", "demonstrations"), sources["recorded"])
    find = Findings()
    tables: dict[str, Table] = {}
    pictures: dict[str, Drawing | Sequence[Drawing]] = {}
    for section in sections:
        find.include(section.find)
        tables |= section.tables
        pictures |= section.pictures
        sources |= section.sources
    public = is_public(task.source)
    again = command(files.name, public)
    facts: dict[str, Any] = {section.name: section.facts for section in sections}
    facts |= find.numbers() | {
        "find": find,
        "task": files.name,
        "title": task.title or files.name,
        "stage": "segment" if kind == "movement" else kind,
        "file": entry_files()[0 if public else -1].as_posix(),
        "public": public,
        "lab": is_lab(),
        "pipeline": pipeline(),
        "again": again,
        "absent": absent,
        "left_out": files.left_out().to_dict("records"),
        "sections": sections,
    }
    if kind == "movement" and not absent:
        simulated = any(one.simulated for one in files.runs("demonstrations"))
    else:
        simulated = any(one.facts.get("origin", {}).get("origin") == "simulated" for one in sections)
    document = Document(
        template="task.html.jinja",
        package=PACKAGE,
        stage=of_task.format(f"report_{kind}"),
        facts=facts,
        tables=tables,
        sources=sources,
        parameters={f"{kind}.{files.name}": task},
        recordings="rerun",
        command=again,
        simulated=simulated,
    )
    return TaskPage(document, pictures, find)


def command(name: str, public: bool) -> str:
    """Command that reproduces a task's results."""
    if public:
        return "make recorded DATA=FOLDER"
    return f"structlearn run {name}" if is_lab() else f"make own TASK={name}"


def _made(make: MakeSection, files: TaskFiles) -> Section | None:
    """Make a section, with template paths relative to this package; None if the task lacks it.

    Those of a section from another package stay relative to that one.
    """
    section = make(files)
    if section is None:
        return None
    here, beside = Path(__file__).parent, Path(inspect.getfile(make)).parent
    folder = beside.relative_to(here) if beside.is_relative_to(here) else Path()
    template, lead = section.template, section.lead
    if not template:
        template, lead = f"{section.name}.html.jinja", f"{section.name}_lead.html.jinja"
        lead = lead if (beside / lead).exists() else ""
    lead = (folder / lead).as_posix() if lead else ""
    return replace(section, template=(folder / template).as_posix(), lead=lead)
