"""Demonstrate and learn with fingers of other shapes: the method assumes no geometry (II.5)."""

from functools import partial

from dissertation.servoing.protocol.servo_trials import learn_other_skin
from dissertation.servoing.protocol.servo_variants import OtherSkinsParameters
from dissertation.simulation.fingers import PinchParameters
from dissertation.simulation.touch import TouchFingerParameters
from dissertation.simulation.touch_demonstrator import ToucherParameters, person_with_sensor
from structlearn.core.artefacts import publish, write_table
from structlearn.core.parallel import parallel_map
from structlearn.core.stage import run, stage_parameters
from structlearn.tactile.latent_models import write_latent_models
from structlearn.tactile.latent_parameters import GeodesicParameters, LatentParameters
from structlearn.tactile.touch_dataset import TouchDataParameters

import pandas as pd

SHARED = {
    "touch_dataset": TouchDataParameters,
    "geodesics": GeodesicParameters,
    "train_latent": LatentParameters,
}


def main() -> None:
    other = stage_parameters("other_skins", OtherSkinsParameters)
    people = stage_parameters("toucher", ToucherParameters)
    fingers = stage_parameters("touch_finger", TouchFingerParameters)
    electrodes = stage_parameters("testbed.touch", PinchParameters)
    learning = [stage_parameters(key, model) for key, model in SHARED.items()]
    person, finger = person_with_sensor(people, fingers.with_electrodes_of(electrodes))
    learned = partial(learn_other_skin, other, person, finger, *learning)
    found = dict(zip(other.skins, parallel_map(learned, other.skins, "other skins", local=True), strict=True))
    with publish("data/servoing/other_skins") as folder:
        folder.mkdir()
        for name, one in found.items():
            write_latent_models(one.models, one.units, folder / f"{name}.safetensors")
        for table in ("latent", "directions"):
            parts = [one.tables[table].assign(skin=name) for name, one in found.items()]
            write_table(pd.concat(parts, ignore_index=True), folder / f"{table}.parquet")


if __name__ == "__main__":
    run(main)
