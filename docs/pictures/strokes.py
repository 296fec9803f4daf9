"""Picture of the page on own data: strokes of a simulated wiping task, cut, learned and commanded.

python docs/pictures/strokes.py
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from dissertation.simulation import wiping
from dissertation.simulation.pick_and_place import as_recording
from structlearn.core.params import merged
from structlearn.palette import BLACK, DEMONSTRATION_COLOUR, primitive_colour
from structlearn.primitives.fitting import RhythmicSegment, learn_primitive, sequence_segments
from structlearn.primitives.sequence import unroll
from structlearn.readers import synchronise
from structlearn.reporting.figure_style import canvas, save, styled
from structlearn.reporting.movement_figures import shade_primitives, speed
from structlearn.segmentation.segments import cut
from structlearn.tasks.kinds import kind_defaults
from structlearn.tasks.movement.parameters import TaskFitParameters, TaskSegmentParameters

NAMES = ["reach", {"name": "wipe", "axis": "strokes"}, "retreat"]
RATE_HZ, SHOWN, CYCLES = 200.0, 2, (2.0, 5.5)  # demonstration of the left panel; commanded numbers of cycles
ACROSS = 1  # axis along which is wiped


@styled
def picture() -> Figure:
    """Speed with cuts; all strokes over the cycle; skills of two numbers of cycles."""
    runs = [synchronise(as_recording(take), RATE_HZ) for take in wiping.takes(seed=1)]
    defaults = kind_defaults("movement")
    cuts = cut(runs, TaskSegmentParameters.model_validate(merged(defaults["segment"], {"primitives": NAMES})))
    fit = TaskFitParameters.model_validate(defaults["fit"])
    segments = sequence_segments(runs, cuts.results, fit.smoothing_hz)
    reach, wipe, retreat = (learn_primitive(name, its, fit) for name, its in segments.items())
    figure = canvas(2.2)
    shown, strokes, skills = figure.subplots(1, 3)
    run, colour = runs[SHOWN], primitive_colour(1)
    ends = [tuple(rows.loc[run.name, ["start_s", "end_s"]]) for rows in cuts.results.values()]
    shade_primitives(shown, ends, list(segments))
    shown.plot(run.time, 1e3 * speed(run), color=BLACK, linewidth=1.0)
    shown.set(xlabel="time (s)", ylabel="speed (mm/s)")
    for segment in segments["wipe"]:
        assert isinstance(segment, RhythmicSegment)
        path, (first, cycles) = segment[0].position[:, ACROSS], segment.rhythm
        strokes.plot(np.linspace(first, first + cycles, len(path)), 1e3 * path, color=DEMONSTRATION_COLOUR)
    strokes.set(xlabel="cycles", ylabel="y (mm)")
    for number, look in zip(CYCLES, ({"color": colour, "linewidth": 2.5}, {"color": BLACK}), strict=True):
        path = unroll([reach, wipe.repeated(number), retreat], 1.0 / RATE_HZ).position
        skills.plot(path.time, 1e3 * path.position[:, ACROSS], label=f"{number:g} cycles", **look)
    skills.set(xlabel="time (s)", ylabel="y (mm)")
    figure.legend(loc="outside upper right", ncols=2)
    return figure


if __name__ == "__main__":
    save(picture(), Path(__file__).with_suffix(""))
