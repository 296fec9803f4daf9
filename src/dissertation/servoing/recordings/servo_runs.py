"""Recording of closed loops: finger, electrodes, and the latent path to the target (figure II.6)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from dissertation.servoing.names import AS_PUBLISHED, FORM_COLOURS, FORM_NAMES, LATENT, OURS, TRUE
from dissertation.servoing.protocol.servo_variants import ServoVariant
from dissertation.servoing.recordings import servoing_scene as scene
from dissertation.simulation.touch import Handle
from structlearn.core import quaternion
from structlearn.core.metrics import matching
from structlearn.palette import GREY
from structlearn.viewer import items, views
from structlearn.viewer.items import Item, entity, series
from structlearn.viewer.recording import Recording

TITLE = "Touch: closed loops"

SHOWN = {FORM_NAMES[variant.form]: variant for variant in (AS_PUBLISHED, OURS)}
"""Controllers shown side by side."""

PLOTS = ("true contact from its target (mm)", "third latent number: pressure", "true load (N)")


@dataclass(frozen=True)
class ServoRun:
    """One closed-loop trial over N points in time: rows of the table `paths`, and the row of `trials`."""

    path: pd.DataFrame
    trial: pd.Series

    @property
    def motion(self) -> scene.FingerMotion:
        """Finger motion and electrode signals."""
        signals = self.path.filter(like="electrode_").to_numpy(float)
        pose = self.columns("finger_{}_m"), self.columns("finger_q{}", "wxyz")
        return scene.FingerMotion(self.path["time_s"].to_numpy(float), *pose, signals)

    @property
    def load(self) -> np.ndarray:
        """(N,) N; zero in the air."""
        return self.path["load_n"].to_numpy(float)

    def columns(self, names: str, axes: str = "xyz") -> np.ndarray:
        """Path columns (N, D) whose names fit a pattern with the axis as placeholder, e.g. `finger_{}_m`."""
        return self.path[[names.format(axis) for axis in axes]].to_numpy(float)

    def of_trial(self, names: str) -> np.ndarray:
        """Trial columns (3,) whose names fit such a pattern."""
        return self.trial[[names.format(axis) for axis in "xyz"]].to_numpy(float)


def shown_runs(trials: pd.DataFrame, paths: pd.DataFrame, count: int) -> list[dict[str, ServoRun]]:
    """First trials of the first model, keyed by `SHOWN`, of `servo_trials.compare_controllers`."""

    def run(number: int, variant: ServoVariant) -> ServoRun:
        path, trial = (
            matching(table, trial=number, seed=table["seed"].iloc[0], **vars(variant))
            for table in (paths, trials)
        )
        return ServoRun(path, trial.iloc[0])

    numbers = sorted(paths["trial"].unique())[:count]
    return [{name: run(number, variant) for name, variant in SHOWN.items()} for number in numbers]


def servo_runs(
    shown: Sequence[Mapping[str, ServoRun]], flat_skin: scene.FlatSkin, handle: Handle
) -> Recording:
    """Closed loops (`shown_runs`): one tab per trial, one column per controller."""
    scale = scene.full_scale([run.motion.signals for runs in shown for run in runs.values()])
    body = scene.handle("handle", handle.centre, handle.axis, handle.radius)
    above, tabs = handle.centre + np.array([0.0, 0.0, handle.radius]), []
    for number, runs in enumerate(shown, 1):
        name, columns = f"{number}, {next(iter(runs.values())).trial['motion']}", []
        for label, run in runs.items():
            finger, drawn = _touch(entity(name, label), run, flat_skin, scale)
            ahead = quaternion.rotate(run.motion.orientation[:1], np.array([1.0, 0.0, 0.0]))[0]
            view = scene.close_view(f"NJ, {label} (simulated)", [*finger, body], above, ahead)
            heading = f"skin and latent path, {label} (mm)"
            columns.append(views.column(view, scene.map_view(heading, drawn, flat_skin.skin)))
        tabs.append(scene.tab(name, columns, views.plots(_curves(name, runs)), _notes(runs)))
    return Recording(TITLE, views.tabs(*tabs))


def _touch(
    path: str, run: ServoRun, flat_skin: scene.FlatSkin, scale: float
) -> tuple[list[Item], list[Item]]:
    """The finger, and its skin with latent path, true contact path, and rings at both targets."""
    time, touching, point = run.motion.time, run.load > 0, run.columns("{}_m")
    target, target_latent = run.of_trial("target_{}_m"), run.of_trial("target_latent_{}")
    at_target = np.tile(target, (len(point), 1)), np.full(len(point), True)
    contacts = [
        scene.Contact("contact", TRUE, time, point, touching),
        scene.Contact("target", LATENT, time, *at_target),
    ]
    finger, drawn = scene.touch(path, flat_skin.skin, run.motion, contacts, scale)
    latent = flat_skin.latent(run.columns("latent_{}"))
    drawn += scene.map_path(f"{path}/map/latent", time, latent, LATENT)
    if touching.any():
        on_skin = flat_skin.places(point[touching])
        drawn += scene.map_path(f"{path}/map/contact", time[touching], on_skin, TRUE)
    angle = np.linspace(0.0, 2 * np.pi, 41)[:, None]
    ring = np.hstack([np.cos(angle), np.sin(angle)])  # 1 mm radius: the tolerance
    for name, place, colour in (
        ("latent target", flat_skin.latent(target_latent), LATENT),
        ("target", flat_skin.places(target), TRUE),
    ):
        name = f"{path}/map{entity(name)}"
        drawn.append(items.lines(name, [place + ring], colour, -1.5, draw_order=scene.IN_FRONT))
    return finger, drawn


def _curves(name: str, runs: Mapping[str, ServoRun]) -> dict[str, list[Item]]:
    """Distance of the contact from its target, pressure and load; both controllers in one plot."""
    distance, pressure, load = curves = list[Item](), list[Item](), list[Item]()
    for label, run in runs.items():
        time, look = run.motion.time, (label, FORM_COLOURS[SHOWN[label].form])
        away = 1e3 * np.linalg.norm(run.columns("{}_m") - run.of_trial("target_{}_m"), axis=1)
        away[run.load <= 0] = np.nan
        latent = run.columns("latent_{}")[:, 2]
        distance.append(series(entity(name, "distance", label), time, away, *look))
        pressure.append(series(entity(name, "pressure", label), time, latent, *look))
        load.append(series(entity(name, "load", label), time, run.load, *look))
    times = np.concatenate([run.motion.time for run in runs.values()])
    ends = np.array([times.min(), times.max()])
    for group, its, column in (("pressure", pressure, "target_latent_z"), ("load", load, "target_load_n")):
        level = np.full(2, float(run.trial[column]))
        its.append(series(entity(name, group, "target"), ends, level, "target", GREY))
    return dict(zip(PLOTS, curves, strict=True))


def _notes(runs: Mapping[str, ServoRun]) -> str:
    colours = {
        "counts fell: pressed": "orange electrodes",
        "counts rose": "light blue electrodes",
        "true contact and, as a ring of 1 mm, its target": "green",
        "latent state, laid onto the skin, and its target": "light blue",
        " and ".join(runs): "ochre, blue curves",
    }
    rows = []
    for label, run in runs.items():
        its, short = run.trial, label.removesuffix(" controller")
        errors = f"{its['position_error_mm']:.2f} mm | {100 * its['pressure_error']:.0f} %"
        rows.append(f"| {short} | {'yes' if its['success'] else 'no'} | {errors} |")
    first = next(iter(runs.values())).trial
    return (
        f"# {TITLE}\n\nA simulated finger moves a contact to another position and load ({first['motion']}, "
        f"{first['geodesic_mm']:.1f} mm along the skin). It knows only the target readings. "
        "Left the published controller, right the adaptive controller, this project's own; both with "
        "the network's Jacobian (NJ) of the same trained model."
        f"\n\n{views.legend(colours)}\n\n"
        + views.table("| controller | reached | off | pressure |", rows)
        + "\n\nThe latent "
        "state is that of the low-passed electrodes, later than the contact; its position and the true "
        "contact differ by the error of estimated contact points.\n"
    )
