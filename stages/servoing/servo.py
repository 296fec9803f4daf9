"""Servo simulated fingers to random contacts in closed loop with every controller (II.4.6)."""

from dissertation.servoing.protocol.servo_trials import compare_controllers
from dissertation.servoing.protocol.servo_variants import (
    OtherSkinsParameters,
    ServoTrialParameters,
    variants,
    variants_of_other_skins,
)
from dissertation.simulation.fingers import PinchParameters
from dissertation.simulation.touch import TouchFingerParameters
from dissertation.simulation.touch_demonstrator import ToucherParameters, person_with_sensor
from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters
from structlearn.tactile.latent_models import read_latent_models

import pandas as pd


def main() -> None:
    parameters = stage_parameters("servo", ServoTrialParameters)
    people = stage_parameters("toucher", ToucherParameters)
    other = stage_parameters("other_skins", OtherSkinsParameters)
    fingers = stage_parameters("touch_finger", TouchFingerParameters)
    electrodes = stage_parameters("testbed.touch", PinchParameters)
    person, finger = person_with_sensor(people, fingers.with_electrodes_of(electrodes))
    with publish("data/servoing/servo") as folder:
        folder.mkdir()
        trained = read_latent_models("data/servoing/models.safetensors")
        comparison = compare_controllers(trained, person, finger, parameters, variants(parameters.horizon))
        for name, table in comparison.items():
            write_table(table, folder / f"{name}.parquet")
        trials = []
        for name in other.skins:
            trained = read_latent_models(f"data/servoing/other_skins/{name}.safetensors")
            its_person, chosen = other.person_with(name, person), variants_of_other_skins()
            found = compare_controllers(trained, its_person, finger, parameters, chosen)["trials"]
            trials.append(found.assign(skin=name))
        write_table(pd.concat(trials, ignore_index=True), folder / "other_skins.parquet")


if __name__ == "__main__":
    run(main)
