"""The page section of a task with touches: a skin and its map, slides over surfaces, or sets of touches."""

from dataclasses import replace

from structlearn.core.artefacts import read_table
from structlearn.readers.demonstration import read_series
from structlearn.tasks.section import Section
from structlearn.tasks.task_files import TaskFiles
from structlearn.tasks.touch import skin_section, surface_section, transfer_section
from structlearn.tasks.touch.touch_parameters import TouchParameters


def section(files: TaskFiles) -> Section:
    """Of a task with touches, by what its entry asks for."""
    parameters, folder = files.entry(TouchParameters), files.folder / "touch"
    tables = {path.stem: read_table(path) for path in sorted(folder.glob("*.parquet"))}
    if parameters.surfaces is not None:
        shown = surface_section.section(tables)
    elif parameters.transfer is not None:
        shown = transfer_section.section(tables)
    else:
        shown = skin_section.section(tables, parameters, folder)
    return replace(shown, facts={**shown.facts, "origins": origins(files)})


def origins(files: TaskFiles) -> list[str]:
    """Sources of a public set with their licences."""
    recorded = [one for path in sorted(files.recorded.glob("*.parquet")) for one in read_series(path)]
    known = [one.about.get("provenance", one.about) for one in recorded]
    named = [f"{its['source']} ({its['licence']})" for its in known if "licence" in its]
    return list(dict.fromkeys(named))
