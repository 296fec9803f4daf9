"""Recordings of a task's movements, and of what was learned from them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import rerun as rr

from structlearn.core import signals
from structlearn.feedback.coupling_model import CouplingModel, read_networks
from structlearn.palette import DEMONSTRATION_COLOUR, LIGHT_GREY, PHASE_PATHS, REPRODUCTION_COLOUR, Look
from structlearn.primitives import sequence
from structlearn.primitives.fitting import orientations, segment_paths, whole_run_cuts
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.trajectory import OrientationTrajectory
from structlearn.primitives.twist_swing import dominant_axes, from_chart, on_chart
from structlearn.readers.demonstration import SIGNAL_UNITS, Demonstration
from structlearn.segmentation.alignment import RESULT
from structlearn.segmentation.segments import Segmentation
from structlearn.tasks.movement.parameters import PARTS, MovementEntry
from structlearn.tasks.movement.phase_corrections import complete, typical_paths
from structlearn.tasks.task_files import TaskFiles
from structlearn.viewer import items, views
from structlearn.viewer.demonstrations import demonstrations
from structlearn.viewer.items import Item, entity, series
from structlearn.viewer.primitives import primitives
from structlearn.viewer.recording import Recording

DEMONSTRATED = (
    "Colours show the primitives, white is outside of them; each demonstration has a tab with its signals."
)
LEARNED = """Thick: the primitives in turn, from and to the mean start and goals (nominal) and others
(generalised); faint: demonstrations."""
TURNS = """Turns of the hand: recorded runs, and the primitive learned from all of them. All are stretched to
its duration and turn to their goals, where every pointer meets its mark. The axis of the turn points up; what
is left of the motion is the swing.

"""
RECORDED, PRIMITIVE = Look("recorded", DEMONSTRATION_COLOUR), Look("primitive", REPRODUCTION_COLOUR)
EXECUTION = "execution"  # name for an execution whose parts were recorded separately
RATE_HZ = 50.0  # sampling rate of turns
RADIUS, APART = 0.04, 0.11  # m, of the caps; between the centres of neighbouring caps
EYE = np.array([0.26, 0.0, 0.2])  # camera position in m, relative to the middle of the row
UP = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # makes the chart's dominant axis point up
CHART = ("twist", "swing", "second swing")

NOTHING = ""


def recordings(files: TaskFiles) -> dict[str, Recording]:
    """Recordings of the demonstrations, of the primitives, and of what else was learned."""
    own, runs, learned = files.entry(MovementEntry), files.runs("demonstrations"), files.primitives()
    cut = joined_execution(runs) if own.presegmented == PARTS else (runs, files.segmentation())
    paths = {name: files.table(f"primitives/{name}") for name in ("nominal", "generalised")}
    shown = {
        "demonstrations": demonstrations(*cut, f"{files.name}: demonstrations", DEMONSTRATED),
        "primitives": primitives(runs, learned, paths, f"{files.name}: primitives", LEARNED),
    }
    if own.turns:
        segments = segment_paths(runs, whole_run_cuts(runs), own.fit.smoothing_hz)
        shown["turns"] = turns(orientations(segments), learned[0])
    if (files.folder / "feedback/completeness.parquet").exists():
        complete_runs = complete(files.runs("corrected"), files.table("feedback/completeness"))
        networks = read_networks(files.folder / "feedback/phase_networks.safetensors")
        shown["corrected"] = corrected(complete_runs, learned, networks)
    return shown


def corrected(
    runs: Sequence[Demonstration], nominal: Sequence[PosePrimitive], networks: Mapping[str, CouplingModel]
) -> Recording:
    """The complete corrected runs, and the nominal primitive with and without learned coupling."""
    tables = {}
    for name, unrolled in typical_paths(nominal[0].position, runs, list(networks.items())).items():
        whole_path = sequence.SequencePath(unrolled, None, np.array([0, len(unrolled.time) - 1]))
        tables[PHASE_PATHS[name].name] = sequence.sequence_table(whole_path, [nominal[0].name])
    colours = dict(PHASE_PATHS[name] for name in ("nominal", "coupling"))
    note = (
        f"The nominal primitive among {len(runs)} corrected runs, from their mean start to the mean "
        f"goal, without and with the coupling term learned from most of them:\n\n{views.legend(colours)}"
    )
    title = "Corrected runs: the primitive with coupling"
    return primitives(runs, nominal, tables, title, note, colours=colours)


def joined_execution(parts: Sequence[Demonstration]) -> tuple[list[Demonstration], Segmentation]:
    """Join consecutive parts into one demonstration, with their starts and ends as cuts."""
    times, starts = [], [0.0]
    for part in parts:
        times.append(part.time + starts[-1])
        starts.append(times[-1][-1] + part.dt)
    recorded: dict[str, Any] = {}
    for name in SIGNAL_UNITS:
        signals = [getattr(part, name) for part in parts]
        recorded[name] = None if any(signal is None for signal in signals) else np.concatenate(signals)
    execution = replace(parts[0], name=EXECUTION, time=np.concatenate(times), **recorded)
    of = {"demonstration": EXECUTION, "primitive": [part.name for part in parts], "method": RESULT}
    cuts = pd.DataFrame(of | {"start_s": starts[:-1], "end_s": starts[1:]})
    return [execution], Segmentation(cuts, pd.DataFrame(), pd.DataFrame(), pd.DataFrame(), EXECUTION)


def turns(logs: Sequence[OrientationTrajectory], primitive: PosePrimitive) -> Recording:
    """Turns of the hand and of the primitive on a common axis."""
    axes, learned = dominant_axes(logs), primitive.orientation
    assert learned is not None
    shown = [*((f"log {number}", log, RECORDED.colour) for number, log in enumerate(logs, 1))]
    shown.append((PRIMITIVE.name, learned.unroll(logs[0].dt), PRIMITIVE.colour))
    samples = round(learned.duration * RATE_HZ)
    times, caps = np.linspace(0.0, learned.duration, samples), list[Item]()
    curves: dict[str, list[Item]] = {chart: [] for chart in CHART}
    for place, (name, turn, colour) in enumerate(shown):
        angles = signals.time_normalised(on_chart(turn, axes).position, samples)  # (samples, 3) rad
        caps += _cap(name, colour, place, times, from_chart(angles, UP))
        for chart, values in zip(CHART, np.degrees(angles).T, strict=True):
            curves[chart].append(series(entity(chart, name), times, values, name, colour))
    middle = np.array([0.0, 0.5 * APART * (len(shown) - 1), 0.0])
    scene = views.eye("Axis of the turn up", caps, middle, EYE)
    notes = views.notes(TURNS + views.legend(dict([RECORDED, PRIMITIVE])))
    plots = [views.plot(f"{name} (degrees to the goal)", its) for name, its in curves.items()]
    left, right = views.column(scene, notes, shares=[3, 2]), views.column(*plots, shares=[3, 1, 1])
    return Recording("Turns of the hand and the primitive", views.row(left, right, shares=[1, 1]))


def _cap(name: str, colour: str, place: int, times: np.ndarray, orientation: np.ndarray) -> list[Item]:
    """A cap with a pointer at a place in the row, turning with (T, 4), and the goal's mark."""
    middle, height = np.array([0.0, APART * place, 0.0]), 0.27 * RADIUS
    front = middle + np.array([[1.15 * RADIUS, 0.0, height], [1.8 * RADIUS, 0.0, 0.0]])
    pointer = [[0.0, 0.0, height], [RADIUS, 0.0, height]]
    size: dict[str, Any] = {"lengths": [0.5 * RADIUS], "radii": [RADIUS]}
    cap = items.solid(entity("caps", name), rr.Cylinders3D, colour, 0.8, **size)
    return [
        *(cap, items.moving_frame(cap.path, times, np.tile(middle, (len(orientation), 1)), "", orientation)),
        items.lines(entity("caps", name, "pointer"), [pointer], LIGHT_GREY, 0.003),
        items.dots(entity("marks", name), front[:1], colour, 0.004),
        items.dots(entity("marks", name, "name"), front[1:], colour, 0.0, labels=[name]),
    ]
