"""Servo simulated fingers to random contacts in closed loop with all controllers (II.4.6)."""

from structlearn.ground.artefacts import publish, write_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings.source import SourceParameters
from structlearn.simulation.fingers import TouchParameters
from structlearn.simulation.touch import TouchFingerParameters
from structlearn.simulation.touch_demonstrator import ToucherParameters
from structlearn.tactile.latent_files import read_models
from structlearn.tactile.resting_servo import demonstrated_actions
from structlearn.tactile.touch_dataset import read_dataset
from structlearn.testbeds.servoing.protocol.servo_trials import Taught, compare
from structlearn.testbeds.servoing.protocol.servo_variants import ServoTrialParameters, variants


def main() -> None:
    parameters = stage_parameters("servo", ServoTrialParameters)
    models, units = read_models("data/servoing/models.safetensors")
    likely = demonstrated_actions(read_dataset("data/servoing/touch.safetensors"))
    with publish("data/servoing/servo") as folder:
        folder.mkdir()
        if stage_parameters("record_touch", SourceParameters).simulated:  # a recorded finger is another one
            finger = stage_parameters("touch_finger", TouchFingerParameters)
            electrodes = stage_parameters("testbed.touch", TouchParameters)
            comparison = compare(
                Taught(models, units, likely),
                stage_parameters("toucher", ToucherParameters),
                finger.with_electrodes_of(electrodes),
                parameters,
                variants(parameters.horizon),
            )
            for name, table in vars(comparison).items():
                write_table(table, folder / f"{name}.parquet")


if __name__ == "__main__":
    run(main)
