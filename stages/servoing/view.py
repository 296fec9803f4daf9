"""Recordings to look at: demonstrations of touch, the latent map, and closed loops (chapter II)."""

from structlearn.ground.artefacts import publish, read_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings import read_demonstrations
from structlearn.recordings.source import SourceParameters
from structlearn.simulation.touch import FingerParameters
from structlearn.simulation.touch_demonstrator import ToucherParameters
from structlearn.tactile.electrodes import SKINS
from structlearn.tactile.latent_comparison import LatentParameters
from structlearn.tactile.touch_dataset import read_dataset
from structlearn.tactile.touch_preparation import TouchDataParameters
from structlearn.testbeds.servoing.protocol.servo_trials import ServoTrialParameters, make_scene
from structlearn.testbeds.servoing.recordings.demonstrated_touches import write_touch_demonstrations
from structlearn.testbeds.servoing.recordings.latent_maps import skin_laying, write_latent_maps
from structlearn.testbeds.servoing.recordings.servo_runs import shown_runs, write_servo_runs
from structlearn.testbeds.servoing.recordings.shown_touches import ServoingViewParameters, shown_touches


def main() -> None:
    chosen = stage_parameters("inspect_servoing", ServoingViewParameters)
    prepared = stage_parameters("touch_dataset", TouchDataParameters)
    person = stage_parameters("toucher", ToucherParameters)
    map_unit = stage_parameters("train_latent", LatentParameters).map_unit_m
    skin = SKINS[person.skin]
    dataset = read_dataset("data/servoing/touch.safetensors")
    latent_map = read_table("data/servoing/evaluation/latent_map.parquet")
    shown = shown_touches(
        read_demonstrations("data/raw/servoing", rate_hz=prepared.rate_hz),
        dataset,
        latent_map,
        read_table("data/servoing/true_contacts.parquet"),
        chosen.demonstrations,
        prepared.air_s,
    )
    with publish("reports/recordings/servoing") as folder:
        folder.mkdir()
        write_touch_demonstrations(
            folder / "demonstrations.rrd",
            shown,
            skin,
            1e-3 * person.handle_radius_mm,
            "Touch: demonstrations",
        )
        write_latent_maps(
            folder / "latent.rrd",
            shown,
            latent_map,
            dataset.contact_point,
            skin,
            map_unit,
            chosen.map_points,
            "Touch: latent map",
        )
        if stage_parameters("record_touch", SourceParameters).simulated:
            trials, paths = (
                read_table(f"data/servoing/servo/{name}.parquet") for name in ("trials", "paths")
            )
            write_servo_runs(
                folder / "servo.rrd",
                shown_runs(trials, paths, chosen.trials),
                make_scene(
                    person,
                    stage_parameters("touch_finger", FingerParameters),
                    stage_parameters("servo", ServoTrialParameters),
                ),
                skin_laying(latent_map, dataset.contact_point, skin, map_unit),
                map_unit,
                "Touch: closed loops",
            )


if __name__ == "__main__":
    run(main)
