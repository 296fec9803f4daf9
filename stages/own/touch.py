"""Learn a latent space of the skin of a task from touches (dissertation II.3.3).

What loads slowly is imported where it is needed: most tasks have no touches.
"""

from structlearn.ground.artefacts import publish, write_table
from structlearn.recordings import read_demonstrations
from structlearn.recordings.stamps import StampPolicy
from structlearn.recordings.touch_log import read_touch_table, touch_of, touch_tables
from structlearn.testbeds.own.files import TaskFiles, local_path, run_for_task
from structlearn.testbeds.own.protocol.own_touch_parameters import TouchParameters


def main(files: TaskFiles) -> None:
    from structlearn.tactile.latent_models import write_models
    from structlearn.testbeds.own.protocol.own_touch import learn_own_touch

    parameters = files.part("touch", TouchParameters)
    source = local_path(parameters.source)
    logs = [read_touch_table(path, parameters.channels) for path in touch_tables(source)]
    if not logs:
        clock = files.clock.model_dump() | {"stamps": files.part("stamps", StampPolicy)}
        logs = [touch_of(one) for one in read_demonstrations(source, parameters.topics, **clock)]
    learned, results = learn_own_touch(logs, parameters)
    with publish(files.folder / "touch") as folder:
        folder.mkdir()
        write_models(learned.models, learned.units, folder / "latent.safetensors")
        for name, table in vars(results).items():
            write_table(table, folder / f"{name}.parquet")


if __name__ == "__main__":
    run_for_task(main, "touch", "touch")
