"""Touch samples from the recordings: low-pass, offsets, contacts, contact points and splits (II.4.1.1)."""

from dissertation.simulation.touch_demonstrator import ToucherParameters
from structlearn.core.stage import run, stage_parameters
from structlearn.readers.demonstration import read_runs
from structlearn.tactile.electrodes import SKINS
from structlearn.tactile.touch_dataset import TouchDataParameters, prepare, write_dataset


def main() -> None:
    parameters = stage_parameters("touch_dataset", TouchDataParameters)
    skin = SKINS[stage_parameters("toucher", ToucherParameters).skin]
    demonstrations = read_runs("data/runs/servoing.parquet")
    write_dataset(prepare(demonstrations, skin, parameters), "data/servoing/touch.safetensors")


if __name__ == "__main__":
    run(main)
