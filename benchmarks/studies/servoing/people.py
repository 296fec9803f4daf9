"""Of a cell of the study `servoing/people`, what can be run again in 20 s: all until models are learned.

Touch is demonstrated, its samples are prepared, and their geodesic distances found. Reads `params.yaml` of
the working folder, which holds the person's seeds; writes `numbers.json` there: mean and spread of every
array.
"""

from structlearn.core.artefacts import Metrics, write_metrics
from structlearn.core.stage import run, stage_parameters
from structlearn.readers import synchronise
from structlearn.simulation.fingers import TouchParameters
from structlearn.simulation.touch import TouchFingerParameters
from structlearn.simulation.touch_demonstrator import ToucherParameters, demonstrate, recorded
from structlearn.tactile.electrodes import SKINS
from structlearn.tactile.geodesics import geodesics
from structlearn.tactile.latent_parameters import GeodesicParameters
from structlearn.tactile.touch_dataset import TouchDataParameters, prepare


def main() -> None:
    """Run the cell as far as it is cheap, and write its numbers."""
    person = stage_parameters("toucher", ToucherParameters)
    finger = stage_parameters("touch_finger", TouchFingerParameters).with_electrodes_of(
        stage_parameters("testbed.touch", TouchParameters)
    )
    preparation = stage_parameters("touch_dataset", TouchDataParameters)
    recordings = [recorded(one, person) for one in demonstrate(person, finger)]
    demonstrations = [synchronise(one, preparation.rate_hz) for one in recordings]
    dataset = prepare(demonstrations, SKINS[person.skin], preparation)
    distances = geodesics(dataset.contact_point, stage_parameters("geodesics", GeodesicParameters))
    found: Metrics = {"samples": len(dataset)}
    for name, array in (vars(dataset) | {"geodesic_m": distances.distance}).items():
        found |= {f"{name}_mean": array.mean(dtype=float), f"{name}_std": array.std(dtype=float)}
    write_metrics(found, "numbers.json")


if __name__ == "__main__":
    run(main)
