"""Recordings of executions on the tilted board: with and without feedback, before and after refinement.

The first run of each kind is shown in every setting.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pybullet_data

from dissertation.scraping.files import CLOSED_LOOP, CORRECTIONS, REFINED, ScrapingFiles, read_datasets
from dissertation.scraping.names import CORRECTED, RUNS
from dissertation.scraping.protocol.execution_scores import (
    AFTER,
    BEFORE,
    NOMINAL,
    nominal_orientation,
    orientation_cost,
)
from dissertation.scraping.protocol.feedback_models import POINTWISE
from dissertation.scraping.recordings.scraping_scene import (
    Execution,
    close_view,
    electrode_map,
    full_scale,
    scene,
    signal_plots,
)
from dissertation.scraping.recordings.search_recording import search_tab, searches
from dissertation.scraping.world.layout import CONTACT_M
from structlearn.feedback.coupling_dataset import to_table
from structlearn.palette import primitive_colour
from structlearn.primitives.primitive_files import read_primitives
from structlearn.primitives.transformation import ALPHA, BETA
from structlearn.viewer import items, views
from structlearn.viewer.arms import meshes
from structlearn.viewer.items import entity
from structlearn.viewer.recording import Recording
from structlearn.viewer.views import Panel

FEEDBACK_NOTE = f"""### Scraping with feedback

The same three movements on a tilted board: as learned on the level board, corrected by a person who holds
the tool flat on the board, and corrected by the feedback model that was trained on such corrections
(dissertation IV.9.3). A tab per tilt, largest first; the first run of each kind.

The coupling term is what the model adds to the rotation of the movement; for the corrected run it is
the training target. The primitive's spring divides it by {ALPHA * BETA:.0f}: in the end,
{ALPHA * BETA * np.radians(10.0):.0f} rad turn the hand by 10 degrees.
"""

REFINEMENT_NOTE = """### Refinement by trial

A feedback model without corrections at the steepest tilt, refined there by trial (dissertation IV.9.4):
executions without feedback, and with feedback before and after refinement. Pale in the right
scene: before. A tab per tilt, with the first run of each kind, so costs are of single runs; then a tab per
refined movement with its search, which steps on the time line `iteration`.
"""

ROBOT_NOTE = """### The whole arm

One run with feedback: the arm, the motion of its hand on the board, the readings of its fingers, and the
resulting feedback (dissertation IV.9.3).
"""

FINGERS = """**In 3-D**: the line is the path of the tool's edge.

**Fingers**: every electrode's reading relative to that of runs without feedback on the level board;
orange is above, light blue below, grey as expected."""

URDF = Path(pybullet_data.getDataPath()) / "kuka_iiwa" / "model.urdf"
"""The arm with its meshes, in PyBullet's data folder."""

JOINTS = tuple(f"lbr_iiwa_joint_{number}" for number in range(1, 8))  # in order of joint-position columns
PALE = (RUNS[BEFORE].name, RUNS[AFTER].name)
"""A run drawn pale in the scene of another: before refinement in that of after, as in figure IV.21."""


def executions(
    settings: Mapping[float, Sequence[Execution]], refinement: tuple[pd.DataFrame, pd.DataFrame] | None = None
) -> Recording:
    """Executions: one tab per setting with its runs in 3-D, electrodes and signals.

    `settings`: executions of different kinds by roll of the board in degrees; the first tab is opened.
    `refinement`: history and samples as for `search_recording.searches`, for a tab per refined primitive.
    """
    every = [one for group in settings.values() for one in group]
    scale = full_scale(every)  # electrode colours are comparable across settings
    notes = _notes(FEEDBACK_NOTE if refinement is None else REFINEMENT_NOTE, next(iter(settings.values())))
    tabs = [_setting(f"{setting:g} degrees", group, scale, notes) for setting, group in settings.items()]
    if refinement is not None:
        origin = views.origin_label([one.run for one in every])
        tabs += [search_tab(search, origin) for search in searches(*refinement)]
    kind, speed = ("feedback", None) if refinement is None else ("refinement", 1.0)
    return Recording(f"Scraping: {kind}", views.tabs(*tabs), steps_per_s=speed)


def robot(one: Execution) -> Recording:
    """An execution with the whole robot.

    Raises ValueError: the run has no joint positions, or not as many as the arm has joints.
    """
    angles = one.run.joint_positions
    if angles is None or angles.shape[1] != len(JOINTS):
        raise ValueError(f"{one.run.name}: needs the positions of {len(JOINTS)} joints")
    times, scale = one.run.time[one.kept], full_scale([one])
    hand, numbers = scene("run", one, scale), range(len(JOINTS))
    names, colours = [f"joint {number + 1}" for number in numbers], [primitive_colour(one) for one in numbers]
    moved = items.series("joints", times, np.degrees(angles[one.kept] - angles[0]), names, colours)

    # view the arm from the side that the tool turns away from
    target, offset = np.array([0.7 * CONTACT_M[0], 0.0, 0.3]), 0.95 * np.array([0.45, -0.85, 0.3])
    arm = meshes("arm", URDF, JOINTS, times, angles[one.kept])
    title = "Scraping: robot with feedback"
    whole = views.eye(f"{title}{views.origin_label([one.run])}", [*arm, *hand], target, offset)
    beside = views.column(electrode_map("electrodes", one, scale), _notes(ROBOT_NOTE, [one]), shares=[2, 3])
    details = views.row(close_view(f"board at {one.board_deg:g} degrees", hand), beside)
    moving = views.plot("joints since the start (degrees)", [moved], legend=False)
    plots = views.column(*signal_plots("signals", [one]), moving)
    return Recording(title, views.row(views.column(whole, details, shares=[5, 6]), plots, shares=[3, 2]))


def _notes(text: str, executions: Sequence[Execution]) -> Panel:
    """Notes panel: contents, origin, colours of the runs, and how to read the rest."""
    colours = views.legend(dict(one.look for one in executions))
    origin = views.origin_sentence([one.run for one in executions])
    return views.notes(f"{text}\n{colours}\n\n**{origin}**\n\n{FINGERS}")


def _setting(tab: str, group: Sequence[Execution], scale: float, notes: Panel) -> Panel:
    """Tab of the executions of one setting."""
    names, origin = [one.look.name for one in group], views.origin_label([group[0].run])
    pale, over = PALE if set(PALE) <= set(names) else ("", "")
    paths = (entity(tab, "runs", name) for name in names)
    shown = {
        one.look.name: scene(path, one, scale, one.look.name == pale)
        for path, one in zip(paths, group, strict=True)
    }
    scenes = [
        close_view(f"{name} (pale: {pale}){origin}", [*shown[name], *shown[pale]])
        if name == over
        else close_view(f"{name}{origin}", shown[name])
        for name in names
        if name != pale
    ]
    maps = [electrode_map(entity(tab, "electrodes", one.look.name), one, scale) for one in group]
    left = views.column(views.row(*scenes), views.row(*maps), notes, shares=[10, 5, 7])
    segments = group[0].run.signal("true_segments")  # the same in every setting
    running = items.lane("primitive", np.append(segments[:, 0], segments[-1, 1]), group[0].primitives)
    right = views.column(*signal_plots(tab, group), views.lanes([running]))
    return views.row(left, right, shares=[3, 2], name=tab)


NEEDED = ("orientation", "joint_positions", "wrench", "tool_to_board", "true_segments")
"""Signals that a run needs to be shown."""

FEEDBACK_RUNS = {
    NOMINAL: (CLOSED_LOOP, NOMINAL),
    CORRECTED: (CORRECTIONS, ""),
    POINTWISE: (CLOSED_LOOP, POINTWISE),  # trained as in the dissertation
}
REFINED_RUNS = {model: (REFINED, model) for model in (NOMINAL, BEFORE, AFTER)}
"""Folder and model of each kind of run that a recording compares, for `ScrapingFiles.runs_at`."""


def read_feedback_runs(files: ScrapingFiles) -> dict[float, list[Execution]]:
    """First nominal, corrected and closed-loop run of every setting that has all three.

    Keyed by roll of the board in degrees, the largest first; empty if nothing was executed. Raises
    InputError: a file is not readable.
    """
    traces = files.table("traces")
    if traces.empty:
        return {}
    datasets = read_datasets(files.data / "feedback/scraping/dataset")
    corrected = [to_table(dataset).assign(primitive=name) for name, dataset in datasets.items()]
    targets = pd.concat(corrected).query("demonstration == 0").rename(columns={"target": "coupling"})
    return _read(files, FEEDBACK_RUNS, pd.concat([_first_runs(traces), targets.assign(model=CORRECTED)]))


def read_refined_runs(files: ScrapingFiles) -> dict[float, list[Execution]]:
    """As `read_feedback_runs`, but nominal, before and after refinement by trial, with costs."""
    traces = files.table("refined_traces")
    if traces.empty:
        return {}
    return _read(files, REFINED_RUNS, _first_runs(traces), nominal_orientation(files.runs("unrolls")))


def _first_runs(traces: pd.DataFrame) -> pd.DataFrame:
    return traces[traces["run"] == traces["run"].min()]


def _read(
    files: ScrapingFiles,
    places: Mapping[str, tuple[str, str]],
    traces: pd.DataFrame,
    nominal: np.ndarray | None = None,
) -> dict[float, list[Execution]]:
    """Executions of the settings that have a complete run of every kind, with cost if `nominal` is given."""
    path = files.data / "primitives/scraping/primitives.safetensors"
    primitives = [primitive.name for primitive in read_primitives(path)]
    shown = {}
    for setting in sorted(traces["setting_deg"].unique(), reverse=True):
        found = {
            kind: run
            for kind, (folder, model) in places.items()
            for run in files.runs_at(setting, folder, model)[:1]
            if all(getattr(run, name) is not None for name in NEEDED)
        }
        if len(found) == len(places):
            felt = dict(iter(traces[traces["setting_deg"] == setting].groupby("model")))
            shown[float(setting)] = [
                Execution(
                    *(RUNS[kind], run, float(setting), primitives, felt[kind]),
                    cost=None if nominal is None else orientation_cost(run, nominal),
                )
                for kind, run in found.items()
            ]
    return shown
