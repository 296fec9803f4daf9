"""Recordings of recorded movements, and of what was learned from them."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from structlearn.feedback.coupling_model import CouplingModel
from structlearn.primitives import sequence
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.vector import VectorPrimitive, deviation, without_offset
from structlearn.recordings.demonstration import SIGNALS, Demonstration
from structlearn.recordings.slide import material_of
from structlearn.segmentation.alignment import RESULT
from structlearn.segmentation.segments import Segmentation
from structlearn.testbeds.recorded.names import LEARNED, PATHS, SLIDE_GROUPS
from structlearn.testbeds.recorded.protocol.corrected_reaches import typical_paths
from structlearn.testbeds.recorded.protocol.slides import GROUPS, SlideParameters, trial_groups
from structlearn.viewer.learned_primitives import write_primitives
from structlearn.viewer.notes import legend
from structlearn.viewer.recorded_demonstrations import write_demonstrations

EXECUTION = "execution"
"""Name of the scraping execution, whose parts were recorded one by one."""


def write_reaches(path: Path, reaches: Sequence[Demonstration], primitives: Sequence[PosePrimitive]) -> None:
    """The reaches, and the primitive learned from all of them."""
    unrolled = sequence.unroll(primitives, reaches[0].dt, from_rest=False)
    tables = {LEARNED.name: sequence.sequence_table(unrolled, [primitive.name for primitive in primitives])}
    note = (
        f"One primitive learned from {len(reaches)} reaches of a person, some of which are drawn faintly. "
        "Axes stand at its mean start; its path is unrolled from there to the mean goal."
    )
    title = f"{len(reaches)} reaches and the primitive"
    write_primitives(path, reaches, primitives, tables, title, note, colours=dict([LEARNED]))


def write_higher_reaches(
    path: Path,
    higher: Sequence[Demonstration],
    nominal: Sequence[PosePrimitive],
    networks: Mapping[str, CouplingModel],
) -> None:
    """The complete higher reaches, and the nominal primitive with and without the coupling learned."""
    looks = dict(zip(("nominal", "adapted"), (PATHS["nominal"], PATHS["coupling"]), strict=True))
    tables = {
        looks[name].name: sequence.sequence_table(
            sequence.SequencePath(unrolled, None, np.array([0, len(unrolled.time) - 1])), [nominal[0].name]
        )
        for name, unrolled in typical_paths(nominal[0].position, higher, list(networks.items())).items()
    }
    colours = dict(looks.values())
    note = (
        f"The nominal primitive among {len(higher)} higher reaches, from their mean start to the mean goal, "
        f"without and with the coupling term learned from most of them:\n\n{legend(colours)}"
    )
    title = "Higher reaches: the primitive with coupling"
    write_primitives(path, higher, nominal, tables, title, note, colours=colours)


def write_execution(path: Path, parts: Sequence[Demonstration]) -> None:
    """The scraping execution as recorded, one part after the other."""
    whole, cuts = joined(parts)
    note = (
        f"A robot scrapes with a tool between two tactile fingers: {', '.join(part.name for part in parts)}, "
        "one after the other. Path, positions and lane have a colour per primitive. The second tab has "
        "force, torque and the 19 electrodes of each finger, in counts since the start."
    )
    write_demonstrations(path, [whole], cuts, "Scraping execution: as recorded", note)


def write_sequence(
    path: Path, parts: Sequence[Demonstration], primitives: Sequence[PosePrimitive], unrolled: pd.DataFrame
) -> None:
    """The sequence learned from the execution."""
    note = (
        "A primitive learned from each part of the recorded execution (faint), unrolled one after the other, "
        "each from the state in which the one before it ended: accelerations do not jump at the switches."
    )
    title = "Scraping execution: learned sequence"
    write_primitives(path, parts, primitives, {"sequence": unrolled}, title, note)


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


def joined(parts: Sequence[Demonstration]) -> tuple[Demonstration, Segmentation]:
    """Parts that follow each other as one demonstration, and where each begins and ends."""
    times, starts = [], [0.0]
    for part in parts:
        times.append(part.time + starts[-1])
        starts.append(times[-1][-1] + part.dt)
    signals: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in SIGNALS
        if all(getattr(part, name) is not None for part in parts)
    }
    nothing: dict[str, Any] = {
        one.name: None for one in fields(Demonstration) if one.name in SIGNALS and one.name not in signals
    }
    whole = replace(parts[0], name=EXECUTION, time=np.concatenate(times), **signals, **nothing)
    rows = [
        (EXECUTION, part.name, RESULT, start, end)
        for part, start, end in zip(parts, starts[:-1], starts[1:], strict=True)
    ]
    cuts = pd.DataFrame(rows, columns=["demonstration", "primitive", "method", "start_s", "end_s"])
    return whole, Segmentation(cuts, pd.DataFrame(), pd.DataFrame(), pd.DataFrame(), EXECUTION)
