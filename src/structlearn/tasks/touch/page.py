"""Page of touches."""

from structlearn.tasks.section import Section
from structlearn.tasks.task_files import TaskFiles
from structlearn.tasks.touch import skin_section, surface_section


def sections(files: TaskFiles) -> list[Section]:
    """The section of slides over surfaces, or of a skin."""
    return [surface_section.section(files) if files.has("surfaces") else skin_section.section(files)]
