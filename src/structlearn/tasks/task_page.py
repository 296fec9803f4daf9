"""Page of a task: one section for each of its parts, and the claims about a public set."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from dissertation.recorded import representations_section, transfer_section
from structlearn.core.params import read_values
from structlearn.reporting.claims import Judged, judge, read_claims, unknown
from structlearn.reporting.document import Document, Source, Table, environment
from structlearn.reporting.figure_style import Drawing
from structlearn.reporting.findings import Findings
from structlearn.reporting.publishing import publish_report
from structlearn.tasks.motion import motion_section
from structlearn.tasks.movement import check_section, corrections_section, cuts_section, primitives_section
from structlearn.tasks.obstacles import scene_section
from structlearn.tasks.project import CLONE, PACKAGE, entry_files, is_lab, pipeline
from structlearn.tasks.section import Section
from structlearn.tasks.task_entry import read_checked
from structlearn.tasks.task_files import TaskFiles, is_public
from structlearn.tasks.touch import skin_section, surface_section

SECTIONS: dict[str, tuple[Callable[[TaskFiles], Section | None], ...]] = {
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
    "touch": (skin_section.section, surface_section.section, transfer_section.section),
    "obstacles": (scene_section.section, representations_section.section),
}

NAMED = ("primitives", "feedback", "skill", "check", "motion", "touch", "obstacles")
STAGES = {"recorded": "import_movement", "segments": "segment"} | {name: name for name in NAMED}
"""Stage that writes each folder of a task's data."""


def publish_page(files: TaskFiles) -> None:
    """Publish a task's page with its figures, tables, claims and findings."""
    kind, task, absent = files.kind, read_checked(files.parameters), files.absent
    sections = [] if absent else [one for make in SECTIONS[kind] if (one := _made(make, files)) is not None]
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
    page = Document(
        template="task.html.jinja",
        package=PACKAGE,
        stage=of_task.format(f"report_{kind}"),
        facts=facts,
        tables=tables,
        judged=judged(files.name, find, facts),
        sources=sources,
        parameters={f"{kind}.{files.name}": task},
        recordings="rerun",
        root="../..",
        command=again,
        simulated=simulated,
    )
    publish_report(files.report, {"index": page}, pictures, tables, find)


def command(name: str, public: bool) -> str:
    """Command that reproduces a task's results."""
    if public:
        return "make recorded DATA=FOLDER"
    return f"structlearn run {name}" if is_lab() else f"make own TASK={name}"


def _made(make: Callable[[TaskFiles], Section | None], files: TaskFiles) -> Section | None:
    """Make a section, with template paths relative to the tasks package; None if the task lacks it."""
    section = make(files)
    if section is None:
        return None
    folder = Path(make.__module__.removeprefix(f"{PACKAGE}.").replace(".", "/")).parent
    template, lead = section.template, section.lead
    if not template:
        template, lead = f"{section.name}.html.jinja", f"{section.name}_lead.html.jinja"
        lead = lead if (Path(__file__).parent / folder / lead).exists() else ""
    lead = (folder / lead).as_posix() if lead else ""
    return replace(section, template=(folder / template).as_posix(), lead=lead)


def judged(name: str, find: Findings, facts: Mapping[str, object]) -> list[Judged]:
    """Judge the claims in `claims/NAME.yaml` beside a task's entry; not tested if there are no data."""
    path = CLONE / "claims" / f"{name}.yaml"
    if not path.exists():
        return []
    claims = read_claims(path)
    without = unknown("nothing recorded decides it" if find else "not recorded here")
    found = {one.evidence: find.get(one.evidence) or without for one in claims}
    published = path.with_name("published.yaml")
    facts = {"published": read_values(published) if published.exists() else {}} | dict(facts)
    return judge(claims, found, environment(PACKAGE), facts)
