"""The page section of a task with touches: a skin and its map, slides over surfaces, or sets of touches."""

from structlearn.core.artefacts import read_table
from structlearn.tasks.section import Section
from structlearn.tasks.task_files import TaskFiles
from structlearn.tasks.touch import skin_section, surface_section, transfer_section
from structlearn.tasks.touch.touch_parameters import TouchParameters


def section(files: TaskFiles) -> Section:
    """Of a task with touches, by what its entry asks for."""
    parameters, folder = files.entry(TouchParameters), files.folder / "touch"
    tables = {path.stem: read_table(path) for path in sorted(folder.glob("*.parquet"))}
    if parameters.surfaces is not None:
        return surface_section.section(tables)
    if parameters.transfer is not None:
        return transfer_section.section(tables)
    return skin_section.section(tables, parameters, folder)
