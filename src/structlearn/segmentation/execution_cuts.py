"""Where the primitives lie in executions by a robot: commanded, or found as in demonstrations."""

from collections.abc import Sequence

import pandas as pd

from structlearn.recordings.demonstration import Demonstration
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import cut


def commanded_cuts(runs: Sequence[Demonstration], names: Sequence[str]) -> dict[str, pd.DataFrame]:
    """Segments of executions that carry what was commanded.

    `runs`: executions of one task, each with `true_segments` (P, 2). Returns by primitive: index
    demonstration, columns `start_s` and `end_s`.
    """
    labels = pd.Index([run.name for run in runs], name="demonstration")
    segments = [run.true_segments for run in runs if run.true_segments is not None]
    return {
        name: pd.DataFrame([one[place] for one in segments], columns=["start_s", "end_s"], index=labels)
        for place, name in enumerate(names)
    }


def execution_cuts(
    runs: Sequence[Demonstration], names: Sequence[str], parameters: SegmentParameters
) -> dict[str, pd.DataFrame]:
    """Segments of executions: the commanded ones, or where a robot did not tell, what cutting finds.

    `parameters`: of the cutting. Their reference is a demonstration, so the first run stands in for it; none
    may be left out. Returns by primitive: index demonstration, columns `start_s` and `end_s`. Raises
    InputError: a run without commanded segments cannot be cut.
    """
    if all(run.true_segments is not None and len(run.true_segments) == len(names) for run in runs):
        return commanded_cuts(runs, names)
    found = cut(runs, parameters.model_copy(update={"reference": None, "skip_failures": False}))
    return {name: found.result(name)[["start_s", "end_s"]] for name in names}
