"""Page of a task: the sections of its kind of data."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

from structlearn.readers.demonstration import read_about
from structlearn.reporting.document import Document, Source, Table, environment
from structlearn.reporting.figure_style import Drawing
from structlearn.reporting.findings import Findings
from structlearn.reporting.publishing import publish_report
from structlearn.tasks.kinds import module_of
from structlearn.tasks.project import ENTRIES
from structlearn.tasks.section import Section
from structlearn.tasks.task_entry import read_checked
from structlearn.tasks.task_files import TaskFiles

# Stage that writes each folder of a task's data; besides, the learning stage has the name of its folder
STAGES = {"segments": "segment"} | {name: name for name in ("primitives", "feedback", "skill", "check")}


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


def task_page(files: TaskFiles) -> TaskPage:
    """Page of a task."""
    kind, task, absent = files.kind, read_checked(files.parameters), files.absent
    short = kind.rpartition(".")[2]
    sections = [] if absent else list(_in_place(module_of(kind, "page"), files))
    stages = STAGES | {"recorded": f"import_{short}", short: short}
    sources = {
        name: Source(f"{files.folder}/{name}", f"{stage}@{files.name}") for name, stage in stages.items()
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
    again = f"structlearn run {files.name}"
    facts: dict[str, Any] = {section.name: section.facts for section in sections}
    facts |= find.numbers() | {
        "find": find,
        "task": files.name,
        "title": task.title or files.name,
        "stage": "segment" if kind == "movement" else short,
        "file": ENTRIES.name,
        "inside": "",  # folder of the project, where pages are moved out of it
        "again": again,
        "absent": absent,
        "left_out": files.left_out().to_dict("records"),
        "sections": sections,
    }
    if kind == "movement" and not absent:
        demonstrations = read_about(files.recorded / "demonstrations.parquet").values()
        simulated = any(about["provenance"].get("origin") == "simulated" for about in demonstrations)
    else:
        simulated = any(section.facts.get("origin", {}).get("origin") == "simulated" for section in sections)
    document = Document(
        template="task.html.jinja",
        package=__package__,
        stage=f"report_{short}@{files.name}",
        facts=facts,
        tables=tables,
        sources=sources,
        parameters={f"{short}.{files.name}": task},
        recordings="rerun",
        command=again,
        simulated=simulated,
    )
    return TaskPage(document, pictures, find)


def _in_place(page: ModuleType, files: TaskFiles) -> Iterator[Section]:
    """Sections of a kind's page, with the templates that are beside it."""
    templates = environment(str(page.__package__))
    for section in page.sections(files):
        name, lead = section.template or f"{section.name}.html.jinja", section.lead
        if not section.template:
            lead = f"{section.name}_lead.html.jinja"
            lead = lead if (Path(str(page.__file__)).parent / lead).exists() else ""
        template = templates.get_template(str(name))
        yield replace(section, template=template, lead=templates.get_template(str(lead)) if lead else "")
