"""Learn from the touches of a task: a skin and its map, expected traces, or what carries over (II, IV.6).

What loads slowly is imported where it is needed.
"""

from pathlib import Path

from structlearn.core.artefacts import publish
from structlearn.core.stage import stage_parameters
from structlearn.readers.demonstration import read_streams
from structlearn.readers.user_tables import read_touch_logs
from structlearn.tasks.task_files import TaskFiles, run_for_task, write_tables
from structlearn.tasks.touch.touch_parameters import SurfaceParameters, TouchParameters


def main(files: TaskFiles) -> None:
    parameters = files.entry(TouchParameters)
    with publish(files.folder / "touch") as folder:
        folder.mkdir()
        if parameters.surfaces is not None:
            surfaces(files, parameters.surfaces, folder)
        elif parameters.transfer is not None:
            transfer(files, parameters, folder)
        else:
            from structlearn.tasks.touch.skin_protocol import learn_touch

            learn_touch(read_touch_logs(files.recorded / "touches.parquet"), parameters, folder)


def surfaces(files: TaskFiles, parameters: SurfaceParameters, folder: Path) -> None:
    from structlearn.tasks.touch.surface_traces import learn_surfaces

    learn_surfaces(read_streams(files.recorded / "streams.parquet"), parameters, folder)


def transfer(files: TaskFiles, parameters: TouchParameters, folder: Path) -> None:
    from structlearn.simulation import fingers
    from structlearn.simulation.touch import TouchFingerParameters
    from structlearn.simulation.touch_demonstrator import ToucherParameters
    from structlearn.tactile.touch_dataset import TouchDataParameters
    from structlearn.tasks.touch.touch_transfer import compare_sets

    electrodes = stage_parameters("testbed.touch", fingers.TouchParameters)
    tables = compare_sets(
        read_streams(files.recorded / "streams.parquet"),
        parameters,
        stage_parameters("toucher", ToucherParameters),
        stage_parameters("touch_finger", TouchFingerParameters).with_electrodes_of(electrodes),
        stage_parameters("touch_dataset", TouchDataParameters),
    )
    write_tables(tables, folder)


if __name__ == "__main__":
    run_for_task(main, out="touch")
