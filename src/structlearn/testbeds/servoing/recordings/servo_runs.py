"""Recording of closed loops: finger, skin, electrodes, and the latent path to its target (figure II.6)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import rerun as rr
import rerun.blueprint as rrb

from structlearn.ground import quaternion
from structlearn.palette import BLUE, GREY, ORANGE
from structlearn.tactile.electrodes import Skin
from structlearn.tactile.flat_maps import MapLaying
from structlearn.testbeds.servoing.protocol.servo_trials import PUBLISHED, RESTING, Variant
from structlearn.testbeds.servoing.recordings.servoing_scene import (
    IN_FRONT,
    TARGET,
    TRUE,
    close_view,
    flat,
    full_scale,
    map_view,
    send_contact,
    send_finger,
    send_handle,
    send_map_path,
    send_signals,
    send_skin_map,
)
from structlearn.testbeds.servoing.world.servo_loop import Scene
from structlearn.viewer.notes import colour_words, notes_view, send_notes
from structlearn.viewer.rrd import entity, layout, plot, recording, send_curve

SHOWN = {"as published": Variant(PUBLISHED, "NJ"), "resting": Variant(RESTING, "NJ")}
"""Controllers that are shown beside each other."""

COLOURS = {"as published": ORANGE, "resting": BLUE}

HANDLE_M = 0.03
"""Length of the handle that is drawn."""


@dataclass(frozen=True)
class ServoRun:
    """A closed loop of N points in time.

    Attributes:
        path: rows of `simulation.servo_trials.Comparison.paths`.
        trial: its row of `simulation.servo_trials.Comparison.trials`.
    """

    path: pd.DataFrame
    trial: pd.Series

    @property
    def time(self) -> np.ndarray:
        """Times (N,) in s."""
        return self.path["time_s"].to_numpy(float)

    @property
    def signals(self) -> np.ndarray:
        """Counts less their offset (N, E)."""
        return self.path.filter(like="electrode_").to_numpy(float)

    def columns(self, names: str) -> np.ndarray:
        """Columns (N, D) of the path by a pattern with the axes in it, e.g. `finger_{}_m`."""
        axes = "wxyz" if "_q" in names else "xyz"
        return self.path[[names.format(axis) for axis in axes]].to_numpy(float)

    def of_trial(self, names: str) -> np.ndarray:
        """Columns (3,) of the trial by such a pattern."""
        return self.trial[[names.format(axis) for axis in "xyz"]].to_numpy(float)


def shown_runs(trials: pd.DataFrame, paths: pd.DataFrame, count: int) -> list[dict[str, ServoRun]]:
    """The first trials of the first model, by the names of `SHOWN`.

    Args:
        trials: see `simulation.servo_trials.Comparison`.
        paths: likewise.
        count: trials, as far as their paths are kept.
    """
    found = []
    for number in sorted(paths["trial"].unique())[:count]:
        found.append(
            {
                name: ServoRun(_rows(paths, variant, number), _rows(trials, variant, number).iloc[0])
                for name, variant in SHOWN.items()
            }
        )
    return found


def write_servo_runs(
    path: str | Path,
    shown: Sequence[Mapping[str, ServoRun]],
    scene: Scene,
    laying: MapLaying,
    map_unit: float,
    title: str,
) -> None:
    """Write closed loops as a recording: a tab per trial, in it a column per controller.

    Args:
        path: of the .rrd file.
        shown: see `shown_runs`.
        scene: of the trials.
        laying: of the latent map onto the flat skin, in mm.
        map_unit: m on the skin per unit of the map.
        title: heading, different for every recording.
    """
    skin = scene.finger.skin
    scale = full_scale([run.signals for runs in shown for run in runs.values()])
    with recording(path, title) as stream:
        tabs = [_tab(_name(number, runs), runs, scene) for number, runs in enumerate(shown)]
        stream.send_blueprint(layout(rrb.Tabs(*tabs, active_tab=0)))
        handle = (scene.handle.centre, scene.handle.axis, scene.handle.radius, HANDLE_M)
        send_handle(stream, "handle", *handle)
        for number, runs in enumerate(shown):
            name = _name(number, runs)
            for label, run in runs.items():
                _send_scene(stream, entity(name, label), run, skin, scale)
                _send_latent(stream, entity(name, label, "map"), run, skin, laying, map_unit)
                _send_curves(stream, name, label, run)
            send_notes(stream, _notes(title, runs), name)


def _rows(table: pd.DataFrame, variant: Variant, trial: int) -> pd.DataFrame:
    """Rows of a controller and trial, of the first model."""
    mask = np.logical_and.reduce([table[name] == value for name, value in vars(variant).items()])
    return table[mask & (table["trial"] == trial) & (table["seed"] == table["seed"].iloc[0])]


def _name(number: int, runs: Mapping[str, ServoRun]) -> str:
    return f"{number + 1}, {next(iter(runs.values())).trial['motion']}"


def _send_scene(stream: rr.RecordingStream, path: str, run: ServoRun, skin: Skin, scale: float) -> None:
    finger, flat_skin = f"{path}/finger", f"{path}/skin"
    send_finger(stream, finger, skin, run.time, run.columns("finger_{}_m"), run.columns("finger_q{}"))
    send_skin_map(stream, flat_skin, skin)
    electrodes = {f"{finger}/electrodes": rr.Points3D, f"{flat_skin}/electrodes": rr.Points2D}
    send_signals(stream, electrodes, run.time, run.signals, scale)
    touching = run.path["load_n"].to_numpy() > 0
    contact = (run.columns("{}_m"), touching, TRUE)
    send_contact(stream, (f"{finger}/contact", f"{flat_skin}/contact"), skin, run.time, *contact)
    goal = (np.tile(run.of_trial("target_{}_m"), (len(run.time), 1)), np.full(len(run.time), True), TARGET)
    send_contact(stream, (f"{finger}/target", f"{flat_skin}/target"), skin, run.time, *goal)


def _send_latent(
    stream: rr.RecordingStream, path: str, run: ServoRun, skin: Skin, laying: MapLaying, map_unit: float
) -> None:
    """The way on the latent map, its target, and the way of the true contact on the skin."""
    send_map_path(
        stream, f"{path}/latent", run.time, laying(1e3 * map_unit * run.columns("latent_{}")[:, :2]), TARGET
    )
    touching = run.path["load_n"].to_numpy() > 0
    if touching.any():
        on_skin = flat(skin, run.columns("{}_m")[touching])
        send_map_path(stream, f"{path}/contact", run.time[touching], on_skin, TRUE)
    for name, place, shade in (
        ("latent target", laying(1e3 * map_unit * run.of_trial("target_latent_{}")[:2]), TARGET),
        ("target", flat(skin, run.of_trial("target_{}_m")), TRUE),
    ):
        ring = _ring(place)
        stream.log(
            f"{path}/{entity(name)}",
            rr.LineStrips2D([ring], colors=int(f"{shade[1:]}ff", 16), radii=-1.5, draw_order=IN_FRONT),
            static=True,
        )


def _ring(place: np.ndarray) -> np.ndarray:
    """A circle of 1 mm about a place (2,) of a flat picture: what counts as reached."""
    angle = np.linspace(0.0, 2 * np.pi, 41)[:, None]
    return place + np.hstack([np.cos(angle), np.sin(angle)])


def _send_curves(stream: rr.RecordingStream, name: str, label: str, run: ServoRun) -> None:
    """Distance of the contact from its target, pressure and load; of both controllers in one plot."""
    colour = COLOURS[label]
    away = 1e3 * np.linalg.norm(run.columns("{}_m") - run.of_trial("target_{}_m"), axis=1)
    away[run.path["load_n"].to_numpy() <= 0] = np.nan
    curves = {
        "distance": away,
        "pressure": run.columns("latent_{}")[:, 2],
        "load": run.path["load_n"].to_numpy(float),
    }
    for group, values in curves.items():
        send_curve(stream, entity(name, group, label), run.time, values, label, colour)
    wanted = {"pressure": run.trial["target_latent_z"], "load": run.trial["target_load_n"]}
    for group, value in wanted.items():
        ends, level = run.time[[0, -1]], np.full(2, float(value))
        send_curve(stream, entity(name, group, "target"), ends, level, "target", GREY)


def _tab(name: str, runs: Mapping[str, ServoRun], scene: Scene) -> rrb.Horizontal:
    skin = scene.finger.skin
    columns = []
    for label, run in runs.items():
        path = entity(name, label)
        ahead = quaternion.rotate(run.columns("finger_q{}")[:1], np.array([1.0, 0.0, 0.0]))[0]
        centre = scene.handle.centre + np.array([0.0, 0.0, scene.handle.radius])
        view = close_view(f"NJ {label} (simulated)", [f"{path}/finger/**", "handle"], centre, ahead)
        heading = f"skin and latent path, {label} (mm)"
        columns.append(
            rrb.Vertical(
                view, map_view(heading, [f"{path}/skin/**", f"{path}/map/**"], skin), row_shares=[1, 1]
            )
        )
    headings = {
        "distance": "true contact from its target (mm)",
        "pressure": "third latent number: pressure",
        "load": "true load (N)",
    }
    plots = [plot(heading, [f"{entity(name, group)}/**"]) for group, heading in headings.items()]
    return rrb.Horizontal(
        *columns, rrb.Vertical(*plots), notes_view(name), column_shares=[3, 3, 3, 2], name=name
    )


def _notes(title: str, runs: Mapping[str, ServoRun]) -> str:
    colours = {
        "orange, blue electrodes": "counts fell: pressed; counts rose",
        "green": "true contact and, as a ring of 1 mm, its target",
        "light blue": "latent state, laid onto the skin, and its target",
    }
    rows = [
        f"| {label} | {'yes' if run.trial['success'] else 'no'} | {run.trial['position_error_mm']:.2f} mm | "
        f"{100 * run.trial['pressure_error']:.0f} % |"
        for label, run in runs.items()
    ]
    first = next(iter(runs.values())).trial
    return (
        f"# {title}\n\nA simulated finger is to be touched at another place and load "
        f"({first['motion']}, {first['geodesic_mm']:.1f} mm along the skin). It knows only what that feels "
        "like. Left the controller as published, right the one that acts more cautiously; the same trained "
        f"model.\n\n{colour_words(colours)}\n\n| NJ | reached | off | pressure off |\n|---|---|---|---|\n"
        + "\n".join(rows)
        + "\n\nThe latent state is that of the low-passed electrodes, later than the contact; its place and "
        "the true contact differ by the error of estimated contact points.\n"
    )
