"""Recording of closed loops: finger, electrodes, and the latent path to the target (figure II.6)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import rerun.blueprint as rrb

from dissertation.servoing.names import AS_PUBLISHED, FORM_COLOURS, FORM_NAMES, LATENT, OURS, TRUE
from dissertation.servoing.protocol.servo_variants import ServoVariant
from dissertation.servoing.recordings import servoing_scene as scene
from dissertation.simulation.touch import Handle
from structlearn.core import quaternion
from structlearn.core.metrics import matching
from structlearn.palette import GREY
from structlearn.tactile.electrodes import Skin
from structlearn.viewer.rrd import Recording, colour_words, entity, recording

TITLE = "Touch: closed loops"

SHOWN = {FORM_NAMES[variant.form]: variant for variant in (AS_PUBLISHED, OURS)}
"""Controllers shown side by side."""

PLOTS = {
    "distance": "true contact from its target (mm)",
    "pressure": "third latent number: pressure",
    "load": "true load (N)",
}


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


def write_servo_runs(
    path: str | Path, shown: Sequence[Mapping[str, ServoRun]], flat_skin: scene.FlatSkin, handle: Handle
) -> None:
    """Record closed loops (`shown_runs`): one tab per trial, one column per controller."""
    skin = flat_skin.skin
    scale = scene.full_scale([run.motion.signals for runs in shown for run in runs.values()])
    names = [
        f"{number + 1}, {next(iter(runs.values())).trial['motion']}" for number, runs in enumerate(shown)
    ]
    with recording(path, TITLE) as to:
        tabs = [_tab(name, runs, skin, handle) for name, runs in zip(names, shown, strict=True)]
        to.show(tabs)
        scene.send_handle(to, "handle", handle.centre, handle.axis, handle.radius)
        for name, runs in zip(names, shown, strict=True):
            for label, run in runs.items():
                motion, place = run.motion, entity(name, label)
                point, target = run.columns("{}_m"), run.of_trial("target_{}_m")
                contacts = [scene.Contact("contact", TRUE, motion.time, point, run.load > 0)]
                tiled, always = np.tile(target, (len(point), 1)), np.full(len(point), True)
                contacts.append(scene.Contact("target", LATENT, motion.time, tiled, always))
                scene.send_touch(to, place, skin, motion, contacts, scale)
                _send_ways(to, f"{place}/map", run, flat_skin)
                _send_curves(to, name, label, run)
            to.notes(_notes(runs), name)


def _send_ways(to: Recording, path: str, run: ServoRun, flat_skin: scene.FlatSkin) -> None:
    """Latent path on its map, true contact path on the skin, and rings at both targets."""
    time, touching = run.motion.time, run.load > 0
    scene.send_map_path(to, f"{path}/latent", time, flat_skin.latent(run.columns("latent_{}")), LATENT)
    if touching.any():
        on_skin = flat_skin.places(run.columns("{}_m")[touching])
        scene.send_map_path(to, f"{path}/contact", time[touching], on_skin, TRUE)
    angle = np.linspace(0.0, 2 * np.pi, 41)[:, None]
    ring = np.hstack([np.cos(angle), np.sin(angle)])  # 1 mm radius: the tolerance
    for name, place, colour in (
        ("latent target", flat_skin.latent(run.of_trial("target_latent_{}")), LATENT),
        ("target", flat_skin.places(run.of_trial("target_{}_m")), TRUE),
    ):
        to.lines(f"{path}/{entity(name)}", [place + ring], colour, -1.5, draw_order=scene.IN_FRONT)


def _send_curves(to: Recording, name: str, label: str, run: ServoRun) -> None:
    """Distance of the contact from its target, pressure and load; both controllers in one plot."""
    time, colour = run.motion.time, FORM_COLOURS[SHOWN[label].form]
    away = 1e3 * np.linalg.norm(run.columns("{}_m") - run.of_trial("target_{}_m"), axis=1)
    away[run.load <= 0] = np.nan
    curves = (away, run.columns("latent_{}")[:, 2], run.load)
    for group, values in zip(PLOTS, curves, strict=True):
        to.series(entity(name, group, label), time, values, label, colour)
    for group, column in (("pressure", "target_latent_z"), ("load", "target_load_n")):
        level = np.full(2, float(run.trial[column]))
        to.series(entity(name, group, "target"), time[[0, -1]], level, "target", GREY)


def _tab(name: str, runs: Mapping[str, ServoRun], skin: Skin, handle: Handle) -> rrb.Horizontal:
    columns = []
    for label, run in runs.items():
        path = entity(name, label)
        ahead = quaternion.rotate(run.motion.orientation[:1], np.array([1.0, 0.0, 0.0]))[0]
        centre = handle.centre + np.array([0.0, 0.0, handle.radius])
        view = scene.close_view(f"NJ, {label} (simulated)", [f"{path}/finger/**", "handle"], centre, ahead)
        heading = f"skin and latent path, {label} (mm)"
        columns.append(rrb.Vertical(view, scene.map_view(heading, [f"{path}/skin", f"{path}/map"], skin)))
    return scene.tab(name, columns, PLOTS, legends=True)


def _notes(runs: Mapping[str, ServoRun]) -> str:
    colours = {
        "orange electrodes": "counts fell: pressed",
        "light blue electrodes": "counts rose",
        "green": "true contact and, as a ring of 1 mm, its target",
        "light blue": "latent state, laid onto the skin, and its target",
        "ochre, blue curves": " and ".join(runs),
    }
    rows = ["| controller | reached | off | pressure |", "|---|---|---|---|"]
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
        f"\n\n{colour_words(colours)}\n\n" + "\n".join(rows) + "\n\nThe latent "
        "state is that of the low-passed electrodes, later than the contact; its position and the true "
        "contact differ by the error of estimated contact points.\n"
    )
