"""What an arm learns online of its payload, as plots over time: mass, first moment, errors."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
import rerun as rr
import rerun.blueprint as rrb

from structlearn.palette import AXIS_COLOURS
from structlearn.viewer.rrd import entity, plot, send_series, time_column


def send_followed(
    stream: rr.RecordingStream,
    learned: pd.DataFrame,
    time: np.ndarray,
    carried_kg: np.ndarray,
    colours: tuple[str, str, str],
) -> None:
    """Log the lines.

    `learned`: as `online_learning.follow_payload` gives it, its `time_s` on the recording's time line; `time`
    (T,) s; `carried_kg` (T,) what is really carried; `colours`: of what is carried, of what is learned, and
    of the empty arm's model.
    """
    reference, found, empty = colours
    times = [time_column(learned["time_s"].to_numpy(float))]
    path = entity("mass", "carried")
    send_series(stream, path, [time_column(time)], carried_kg[:, None], ["carried"], [reference], width=3.0)
    mass = learned["mass_kg"].to_numpy(float)[:, None]
    send_series(stream, entity("mass", "learned"), times, mass, ["learned"], [found])
    moments = learned[[f"moment_{axis}_kg_m" for axis in "xyz"]].to_numpy(float)
    send_series(stream, "moment", times, moments, ["x", "y", "z"], AXIS_COLOURS)
    for name, label, colour in (("fixed", "empty arm", empty), ("learned", "learned online", found)):
        error = np.log10(learned[f"nmse_{name}"].to_numpy(float))[:, None]
        send_series(stream, entity("error", name), times, error, [label], [colour])


def followed_plots() -> Sequence[rrb.TimeSeriesView]:
    """Views of what `send_followed` logs."""
    return (
        plot("mass in the hand (kg)", ["/mass/**"], legend=False),
        plot("its first moment (kg m)", ["/moment"], legend=False),
        plot("log10 of the NMSE of each batch before it is learned", ["/error/**"], legend=False),
    )
