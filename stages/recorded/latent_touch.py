"""Latent spaces of recorded touch, and what carries over between simulated and recorded touch (II.4)."""

from structlearn.core.artefacts import publish, write_table
from structlearn.core.errors import MissingInputError
from structlearn.core.stage import or_empty, run, stage_parameters
from structlearn.readers import synchronise
from structlearn.simulation.fingers import TouchParameters
from structlearn.simulation.touch import TouchFingerParameters
from structlearn.simulation.touch_demonstrator import ToucherParameters, demonstrate, recorded
from structlearn.tactile.electrodes import SKINS
from structlearn.tactile.touch_preparation import TouchDataParameters, prepare
from structlearn.tasks.public import PARAMETER_FILE
from structlearn.tasks.public.protocol.latent_touch import learn_touch
from structlearn.tasks.public.protocol.touch_sets import LatentTouchParameters, touch_sets
from structlearn.tasks.public.public_files import SLIDES, UNSCREWING, RecordedFiles


def main() -> None:
    parameters = stage_parameters("recorded_latent_touch", LatentTouchParameters, PARAMETER_FILE)
    samples = stage_parameters("touch_dataset", TouchDataParameters)
    skin = SKINS["biotac"]
    fewer = dict.fromkeys(("rotations", "translations"), parameters.simulated_repeats) | {"skin": skin.name}
    person = stage_parameters("toucher", ToucherParameters).model_copy(update=fewer)
    finger = stage_parameters("touch_finger", TouchFingerParameters)
    electrodes = stage_parameters("testbed.touch", TouchParameters)
    stored = RecordedFiles()
    slides, unscrewing = (
        [synchronise(one, samples.rate_hz) for one in stored.streams(name)] if stored.imported(name) else []
        for name in (SLIDES, UNSCREWING)
    )
    if max(len(slides), len(unscrewing)) < 2:
        raise MissingInputError("two slides or two logs of unscrewing are needed")
    runs = demonstrate(person, finger.with_electrodes_of(electrodes))
    touches = [synchronise(recorded(one, person), samples.rate_hz) for one in runs]
    simulated = prepare(touches, skin, samples)
    sets = touch_sets(
        slides, unscrewing, simulated, skin, samples.cutoff_hz, parameters.faulty, parameters.geodesics
    )
    results = learn_touch(sets, skin, parameters)
    with publish("data/recorded/latent_touch") as folder:
        folder.mkdir()
        for name, table in vars(results).items():
            write_table(table, folder / f"{name}.parquet")


if __name__ == "__main__":
    run(or_empty(main, "data/recorded/latent_touch"))
