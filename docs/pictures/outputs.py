"""Picture of the page on own data: a gripper of a simulated task, as demonstrated and as commanded.

python docs/pictures/outputs.py
"""

import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from dissertation.simulation.pick_and_place import takes, write_takes
from structlearn.core.params import read_values
from structlearn.palette import DEMONSTRATION_COLOUR, REPRODUCTION_COLOUR
from structlearn.primitives.fitting import learn_sequence
from structlearn.primitives.sequence import sequence_table, unroll
from structlearn.readers import read_recordings, synchronise
from structlearn.reporting.figure_style import canvas, save, styled
from structlearn.reporting.movement_figures import shade_primitives
from structlearn.segmentation.segments import cut
from structlearn.tasks.movement.primitives_section import stretched_outputs
from structlearn.tasks.task_entry import as_task

ENTRY = Path(__file__).parents[2] / "examples/grasp.yaml"
RATE_HZ = 200.0


@styled
def picture() -> Figure:
    """Opening of the gripper, and whether it is told to close, over the primitives."""
    task = as_task("movement", read_values(ENTRY)["movement"]["grasp"], ENTRY, "movement.grasp")
    with tempfile.TemporaryDirectory() as folder:
        write_takes(takes(seed=1, moves=3), Path(folder))
        runs = [synchronise(one, RATE_HZ) for one in read_recordings(folder, task.topics, task.stamps)]
    cuts = cut(runs, task.segment).results
    path = unroll(learn_sequence(runs, cuts, task.fit), 1.0 / RATE_HZ)
    table = sequence_table(path, list(cuts), (), runs[0].output_names, runs[0].digital_names)
    parts = table.groupby("primitive", sort=False)["time_s"].agg(["first", "last"])
    figure = canvas(2.2)
    panels = figure.subplots(1, 2)
    for panel, (column, curves) in zip(panels, stretched_outputs(runs, cuts, table).items(), strict=True):
        factor, style = (1e3, "default") if column.startswith("output.") else (1.0, "steps-post")
        for number, (time, values) in enumerate(curves):
            label = None if number else "demonstrated"
            look = {"color": DEMONSTRATION_COLOUR, "linewidth": 0.8}
            panel.plot(time, factor * values, drawstyle=style, label=label, **look)
        commanded = factor * table[column].to_numpy()
        panel.plot(table["time_s"], commanded, drawstyle=style, color=REPRODUCTION_COLOUR, label="skill")
        shade_primitives(panel, parts.to_numpy(), list(parts.index))
        panel.set(xlabel="time (s)", xlim=np.array(parts)[[0, -1], [0, 1]])
    panels[0].set_ylabel("opening (mm)")
    panels[1].set(ylabel="grasp", yticks=[0, 1], yticklabels=["off", "on"])
    panels[0].legend(loc="center")
    return figure


if __name__ == "__main__":
    save(picture(), Path(__file__).with_suffix(""))
