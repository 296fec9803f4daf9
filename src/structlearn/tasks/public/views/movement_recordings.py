"""Recordings of recorded movements, and of what was learned from them."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from structlearn.primitives.vector import VectorPrimitive, deviation, without_offset
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.slide import material_of
from structlearn.tasks.public.protocol.slides import GROUPS, SlideParameters, trial_groups
from structlearn.tasks.public.public_names import SLIDE_GROUPS
from structlearn.viewer.notes import legend
from structlearn.viewer.recorded_demonstrations import write_demonstrations


def write_slides(
    path: Path, trials: Sequence[Demonstration], expected: VectorPrimitive, parameters: SlideParameters
) -> None:
    """The slides; electrodes show their deviation from the expected traces."""
    groups = trial_groups([trial.name for trial in trials], parameters)
    materials = dict.fromkeys(material_of(trial.name) for trial in trials)
    learned = next(material_of(name) for name, group in groups.items() if group == "learned")
    order = sorted(trials, key=lambda trial: GROUPS.index(groups[trial.name]))  # the first ones have a tab
    deviating = [
        replace(trial, tactile=deviation(expected, without_offset(trial.signal("tactile")), trial.dt))
        for trial in order
    ]
    note = (
        f"A robot slides a tactile finger over {' and '.join(materials)}. Tabs of single trials show how far "
        f"each electrode deviates from the traces expected of {learned}:\n\n"
        f"{legend(dict(SLIDE_GROUPS.values()))}"
    )
    colours = [SLIDE_GROUPS[groups[trial.name]].colour for trial in order]
    title = "Slides: deviation from the expected traces"
    write_demonstrations(path, deviating, None, title, note, colours=colours)
