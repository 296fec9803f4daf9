"""Learn a latent space of the skin of a task from touches (dissertation II.3.3).

What loads slowly is imported where it is needed: most tasks have no touches.
"""

from structlearn.core.artefacts import publish
from structlearn.readers import read_demonstrations
from structlearn.readers.touch_log import read_touch_logs, touch_of
from structlearn.tasks.task_entry import TouchEntry
from structlearn.tasks.task_files import TaskFiles, local_path, run_for_task


def main(files: TaskFiles) -> None:
    from structlearn.tasks.touch.skin_touches import learn_touch

    parameters = files.entry(TouchEntry)
    source = local_path(parameters.source)
    logs = read_touch_logs(source, parameters.channels)
    if not logs:
        clock = parameters.clock.model_dump() | {"stamps": parameters.stamps}
        logs = [touch_of(one) for one in read_demonstrations(source, parameters.topics, **clock)]
    with publish(files.folder / "touch") as folder:
        folder.mkdir()
        learn_touch(logs, parameters, folder)


if __name__ == "__main__":
    run_for_task(main, out="touch")
