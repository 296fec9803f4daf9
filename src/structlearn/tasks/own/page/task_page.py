"""The page of a task: a section for every part that it has."""

from collections.abc import Callable

from structlearn.reporting.document import Document, Source
from structlearn.reporting.publishing import HEADLINES, publish_report
from structlearn.tasks.own.page import (
    came_in_section,
    check_section,
    cuts_section,
    feedback_section,
    motion_section,
    obstacles_section,
    primitives_section,
    touch_section,
)
from structlearn.tasks.own.page.section import Section
from structlearn.tasks.task_entry import read_checked
from structlearn.tasks.task_files import TaskFiles

PACKAGE = "structlearn.tasks.own.page"
PIPELINE = "stages/own/dvc.yaml"


PARTS: tuple[tuple[str, Callable[[TaskFiles], Section]], ...] = (
    ("segment", came_in_section.section),
    ("segment", cuts_section.section),
    ("segment", primitives_section.section),
    ("feedback", feedback_section.section),
    ("skill", check_section.skill_section),
    ("robot", check_section.section),
    ("motion", motion_section.section),
    ("touch", touch_section.section),
    ("obstacles", obstacles_section.section),
)
"""Key of the task's parameters, null where it has no such part, and what makes its section, in order."""

STAGES = {
    "recordings": ("demonstrations", "import"),
    "demonstrations": ("demonstrations", "import"),
    "segments": ("segments", "segment"),
    "primitives": ("primitives", "primitives"),
    "feedback": ("feedback", "feedback"),
    "skill": ("skill", "skill"),
    "check": ("check", "check"),
    "motion": ("motion", "motion"),
    "touch": ("touch", "touch"),
    "obstacles": ("obstacles", "obstacles"),
}
"""By the name of a source: folder of the task's data, and the stage that writes it."""


def publish_page(files: TaskFiles) -> None:
    """Publish the page of a task with its figures, tables and key figures."""
    sections = [make(files) for key, make in PARTS if files.has(key)]
    shown = {section.name: section for section in sections}
    tables = {name: table for section in sections for name, table in section.tables.items()}
    pictures = {name: drawing for section in sections for name, drawing in section.pictures.items()}
    metrics = {name: value for section in sections for name, value in section.metrics.items()}
    page = Document(
        template="task.html.jinja",
        package=PACKAGE,
        stage=f"{PIPELINE}:report@{files.name}",
        facts={name: section.facts for name, section in shown.items()}
        | {"task": files.name, "sections": sections, "shown": shown},
        tables=tables,
        sources={
            name: Source(f"{files.folder}/{folder}", f"{PIPELINE}:{stage}@{files.name}")
            for name, (folder, stage) in STAGES.items()
        },
        parameters={f"tasks.{files.name}": read_checked(files.parameters)},
        recordings="recordings",
        simulated=any(one.simulated for one in files.runs("demonstrations")) if "cuts" in shown else False,
    )
    publish_report(files.report, {"index": page}, pictures, tables, metrics, list(metrics)[:HEADLINES])
