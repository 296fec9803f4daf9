"""A small scraping testbed in memory, for the tests of the report."""

from collections.abc import Iterable
from itertools import product

import numpy as np
import pandas as pd
from committed import committed
from conftest import minimum_jerk

from dissertation.scraping.protocol.cut_sweep import downsampling_effect
from structlearn.core import quaternion
from structlearn.primitives import sequence
from structlearn.primitives.fitting import FitParameters, cross_validation, learn_sequence
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.alignment import METHODS
from structlearn.segmentation.parameters import PrimitiveParameters, SegmentParameters
from structlearn.segmentation.segments import cut

DT = 0.01


def grid(**levels: Iterable[object]) -> pd.DataFrame:
    """Every combination of some levels, a column each; the last one changes first."""
    return pd.DataFrame(product(*levels.values()), columns=list(levels))


PARAMETERS = committed(
    SegmentParameters,
    "segment",
    primitives=(
        PrimitiveParameters(name="down", axis="z", threshold_m_s=0.02),
        PrimitiveParameters(name="turn", axis="between", threshold_m_s=None),
        PrimitiveParameters(name="scrape", axis="y", threshold_m_s=0.02),
    ),
)
FIT = committed(FitParameters, "fit_primitives", kernel_count=8)


def demonstration(seed: int) -> Demonstration:
    """Down, turn, scrape, with rests; all signals recorded and the true cut points known."""
    rng = np.random.default_rng(seed)
    ends = np.cumsum(rng.uniform(0.8, 1.2, size=5))  # rest, down, turn, scrape, rest
    time = DT * np.arange(round(ends[-1] / DT))
    down, turn, scrape = (minimum_jerk((time - ends[i]) / (ends[i + 1] - ends[i])) for i in range(3))
    position = np.column_stack([0.002 * scrape, 0.06 * scrape, -0.08 * down])
    return Demonstration(
        name=f"{seed:02d}",
        time=time,
        position=position + rng.normal(0.0, 0.001, 3),
        orientation=quaternion.from_rotation_vector(np.outer(turn, [0.1, 0.05, 0.0])),
        wrench=np.outer(down, [0.0, 0.0, -1.0, 0.0, 0.0, 0.0]),
        tactile=np.outer(down, [10.0, -20.0, 5.0]),
        true_segments=np.column_stack([ends[:3], ends[1:4]]),
        provenance={"origin": "simulated"},
    )


def noise_table(advantage_ms: float = 5.0) -> pd.DataFrame:
    """A sweep of three people at two levels in which `wls` is better than all others by a little."""
    rng = np.random.default_rng(0)
    rows = []
    for level, seed in product((0.0, 0.3), range(3)):
        person = rng.uniform(0.03, 0.05)
        for method in METHODS:
            error = person + (0.0 if method == "wls" else 1e-3 * (advantage_ms + rng.uniform(0, 0.2)))
            rows.append(("02", "down", method, error, -error, level, seed))
    rows.append(("03", np.nan, "left_out", np.nan, np.nan, 0.3, 0))
    columns = ["demonstration", "primitive", "method", "start_error_s", "end_error_s", "noise_mm", "seed"]
    return pd.DataFrame(rows, columns=columns)


def threshold_table(zvc_ms: float = 20.0, others_ms: float = 2.0) -> pd.DataFrame:
    """Errors of three people that grow with the threshold of the crossing, by so much per factor."""
    table = grid(factor=(0.5, 1.0, 2.0), seed=range(3), method=METHODS)
    rng = np.random.default_rng(1)
    slope = np.where(table["method"] == "zvc", zvc_ms, others_ms) + 0.1 * rng.random(len(table))
    error = 0.04 + 1e-3 * slope * table["factor"]
    return table.assign(demonstration="02", primitive="down", start_error_s=error, end_error_s=-error)


def work_table(power: float = 2.0, shift: float = 0.5, published: float = 0.6) -> pd.DataFrame:
    """What down-sampling does to three people: work falls with a power of g, cuts shift by coarse samples."""
    table = grid(seed=range(3), factor=(1, 2, 4))
    coarse = table["factor"] > 1
    change = 0.01 * np.random.default_rng(0).random(len(table)) * coarse
    return table.assign(
        work=table["factor"] ** -power * (1.0 + change),
        mean_shift_ms=1.0,
        max_shift_ms=2.0,
        shift_samples=(shift + change) * coarse,
        shift_samples_published=(published + change) * coarse,
    )


def cut_stages(demonstrations: list[Demonstration]) -> tuple[dict[str, object], dict[str, pd.DataFrame]]:
    """What the stages of segmentation and primitives would have written: fields and tables of `Stored`."""
    parameters = PARAMETERS.model_copy(update={"skip_failures": True})
    segmentation = cut(demonstrations, parameters)
    primitives = learn_sequence(demonstrations, segmentation.results, FIT)
    situation = committed(
        sequence.GeneraliseParameters,
        "generalise",
        start_offset_m=(0.01, 0.0, 0.0),
        goal_offset_m=(0.0, 0.01, 0.0),
        goal_turn_deg=5.0,
        duration_factor=1.5,
    )
    names = segmentation.primitives
    tables = {
        "noise": noise_table(),
        "thresholds": threshold_table(),
        "downsampling": downsampling_effect(demonstrations, parameters, (1, 2)),
        "downsampling_people": work_table(),
        "reproduction": cross_validation(demonstrations, segmentation.results, FIT),
        "nominal": sequence.sequence_table(sequence.unroll(primitives, DT), names),
        "generalised": sequence.sequence_table(sequence.generalised(primitives, DT, situation), names),
    }
    fields = {"demonstrations": demonstrations, "segmentation": segmentation, "primitives": primitives}
    return fields, tables
