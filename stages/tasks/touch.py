"""Learn from a task's touches: a skin and its map, expected traces, or transfer between sets (II, IV.6).

Slow imports are inside the functions that need them.
"""

from pathlib import Path

import pandas as pd

from structlearn.core.artefacts import publish
from structlearn.core.stage import stage_parameters
from structlearn.primitives.primitive_files import write_vector_primitive
from structlearn.readers.demonstration import read_streams
from structlearn.readers.user_tables import read_touch_logs
from structlearn.tasks.task_files import TaskFiles, run_for_task, write_tables
from structlearn.tasks.touch.touch_parameters import SurfaceParameters, TouchParameters


def main(files: TaskFiles) -> None:
    parameters = files.entry(TouchParameters)
    with publish(files.folder / "touch") as folder:
        folder.mkdir()
        if parameters.surfaces is not None:
            tables = surfaces(files, parameters.surfaces, folder)
        elif parameters.transfer is not None:
            tables = transfer(files, parameters)
        else:
            tables = skin(files, parameters, folder)
        write_tables(tables, folder)


def skin(files: TaskFiles, parameters: TouchParameters, folder: Path) -> dict[str, pd.DataFrame]:
    from structlearn.tactile.latent_models import write_models
    from structlearn.tasks.touch.skin_protocol import learn_touch

    skins, tables = learn_touch(read_touch_logs(files.recorded / "touches.parquet"), parameters)
    for name, one in skins.items():
        write_models(*one, folder / ("models" if parameters.apart else "") / f"{name}.safetensors")
    return tables


def surfaces(files: TaskFiles, parameters: SurfaceParameters, folder: Path) -> dict[str, pd.DataFrame]:
    from structlearn.tasks.touch.surface_traces import learn_surfaces

    expected, tables = learn_surfaces(read_streams(files.recorded / "streams.parquet"), parameters)
    write_vector_primitive(expected, folder / "expected.safetensors", "electrode counts without offset")
    return tables


def transfer(files: TaskFiles, parameters: TouchParameters) -> dict[str, pd.DataFrame]:
    from dissertation.recorded.touch_transfer import compare_sets
    from dissertation.simulation import fingers
    from dissertation.simulation.touch import TouchFingerParameters
    from dissertation.simulation.touch_demonstrator import ToucherParameters
    from structlearn.tactile.touch_dataset import TouchDataParameters

    electrodes = stage_parameters("testbed.touch", fingers.TouchParameters)
    return compare_sets(
        read_streams(files.recorded / "streams.parquet"),
        parameters,
        stage_parameters("toucher", ToucherParameters),
        stage_parameters("touch_finger", TouchFingerParameters).with_electrodes_of(electrodes),
        stage_parameters("touch_dataset", TouchDataParameters),
    )


if __name__ == "__main__":
    run_for_task(main, out="touch")
