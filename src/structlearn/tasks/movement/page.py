"""Page of movements."""

from collections.abc import Iterator

from structlearn.tasks.movement import check_section, corrections_section, cuts_section, primitives_section
from structlearn.tasks.section import Section
from structlearn.tasks.task_files import TaskFiles

PARTS = (
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
)


def sections(files: TaskFiles) -> Iterator[Section]:
    """One section for each part that the task has."""
    for make in PARTS:
        if (section := make(files)) is not None:
            yield section
