"""Rerun views: demonstrations of touch, the latent map, and closed-loop servoing (chapter II)."""

from dissertation.servoing import files
from dissertation.servoing.recordings import demonstrated_touches as touches
from dissertation.servoing.recordings import servo_runs
from dissertation.servoing.recordings.servoing_scene import FlatSkin, ServoingViewParameters
from dissertation.servoing.world.servo_loop import handle_of
from dissertation.simulation.touch_demonstrator import ToucherParameters
from structlearn.core.artefacts import read_table
from structlearn.core.stage import run, stage_parameters
from structlearn.readers.demonstration import read_runs
from structlearn.tactile.electrodes import SKINS
from structlearn.tactile.latent_parameters import LatentParameters
from structlearn.tactile.touch_dataset import TouchDataParameters, read_dataset
from structlearn.viewer.recording import publish_recordings


def main() -> None:
    chosen = stage_parameters("inspect_servoing", ServoingViewParameters)
    prepared = stage_parameters("touch_dataset", TouchDataParameters)
    person = stage_parameters("toucher", ToucherParameters)
    map_unit = stage_parameters("train_latent", LatentParameters).map_unit_m
    skin, dataset = SKINS[person.skin], read_dataset(files.MADE_BY["touch"][0])
    runs, truth = read_runs(files.RUNS), read_table(files.MADE_BY["contacts"][0])
    latent_map, points = files.tables("models")["latent_map"], dataset.contact_point
    selected = (chosen.demonstrations, prepared.air_s)
    shown = touches.shown_touches(runs, dataset, latent_map, truth, *selected)
    laid = FlatSkin.fitted(skin, points, latent_map[["x", "y"]].to_numpy(float), map_unit)
    loops = files.tables("loops")
    trials = servo_runs.shown_runs(loops["trials"], loops["paths"], chosen.trials)
    recordings = {
        "demonstrations": touches.demonstrations(shown, skin, 1e-3 * person.handle_radius_mm),
        "latent": touches.latent_maps(shown, laid, latent_map, points, chosen.map_points),
        "servo": servo_runs.servo_runs(trials, laid, handle_of(person)),
    }
    publish_recordings("reports/rerun/servoing", recordings)


if __name__ == "__main__":
    run(main)
