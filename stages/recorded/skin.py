"""A magnetic skin pressed at known places: its latent map, forces, and servoing in the map (chapter II)."""

from structlearn.ground.artefacts import filled, publish, write_table
from structlearn.ground.stage import or_empty, run, stage_parameters
from structlearn.recordings.eflesh import PRESSES, STROKES, read_imported
from structlearn.tactile.latent_models import write_models
from structlearn.testbeds.recorded import PARAMETER_FILE
from structlearn.testbeds.recorded.protocol.latent_touch_parameters import SkinParameters
from structlearn.testbeds.recorded.protocol.skin import learn_recorded_skin


def main() -> None:
    parameters = stage_parameters("recorded_skin", SkinParameters, PARAMETER_FILE)
    channels = parameters.description().channels
    raw = filled("data/raw/recorded/skin")
    presses, strokes = (read_imported(raw, kind, channels) for kind in (PRESSES, STROKES))
    skins, tables = learn_recorded_skin(presses, strokes, parameters)
    with publish("data/recorded/skin") as folder:
        folder.mkdir()
        for name, skin in skins.items():
            write_models(skin.models, skin.units, folder / "models" / f"{name}.safetensors")
        for name, table in tables.items():
            write_table(table, folder / f"{name}.parquet")


if __name__ == "__main__":
    run(or_empty(main, "data/recorded/skin"))
