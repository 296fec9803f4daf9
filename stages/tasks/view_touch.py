"""Recordings of a task's touches to look at: a skin and its map, or slides and how they deviate."""

from structlearn.core.artefacts import publish, read_table
from structlearn.primitives.primitive_files import read_vector_primitive
from structlearn.readers.runs import read_streams
from structlearn.tasks.task_files import TaskFiles, leave_out, run_for_task
from structlearn.tasks.touch.surface_traces import on_one_clock
from structlearn.tasks.touch.touch_parameters import TouchParameters
from structlearn.tasks.touch.touch_view import write_skin, write_slides


def main(files: TaskFiles) -> None:
    parameters, touch = files.entry(TouchParameters), files.folder / "touch"
    with publish(files.report / "rerun") as folder:
        if files.absent or parameters.transfer is not None:
            leave_out(folder, files.absent or "Sets of touches have no recording; each is in its own task.")
            return
        folder.mkdir()
        if parameters.surfaces is not None:
            trials = on_one_clock(read_streams(files.recorded / "streams.parquet"), parameters.surfaces)
            expected = read_vector_primitive(touch / "expected.safetensors")
            write_slides(folder / "slides.rrd", trials, expected, parameters.surfaces)
        else:
            tables = {path.stem: read_table(path) for path in touch.glob("*.parquet")}
            write_skin(folder / "skin.rrd", tables, parameters.tuned_on)


if __name__ == "__main__":
    run_for_task(main)
