"""Learning from a task's touches: a skin and its map, or expected traces of slides (II, IV.6)."""

from pathlib import Path

from structlearn.primitives.primitive_files import write_vector_primitive
from structlearn.readers.demonstration import read_streams
from structlearn.readers.user_tables import read_touch_logs
from structlearn.tactile.latent_models import write_latent_models
from structlearn.tasks.task_files import TaskFiles, write_tables
from structlearn.tasks.touch.parameters import TouchParameters
from structlearn.tasks.touch.skin_protocol import learn_touch
from structlearn.tasks.touch.surface_traces import learn_surfaces


def learn(files: TaskFiles, folder: Path) -> None:
    """Write tables, and models of the skin or the expected traces."""
    parameters = files.entry(TouchParameters)
    if parameters.surfaces is not None:
        streams = read_streams(files.recorded / "streams.parquet")
        expected, tables = learn_surfaces(streams, parameters.surfaces)
        write_vector_primitive(expected, folder / "expected.safetensors", "electrode counts without offset")
    else:
        skins, tables = learn_touch(read_touch_logs(files.recorded / "touches.parquet"), parameters)
        for name, one in skins.items():
            write_latent_models(*one, folder / ("models" if parameters.apart else "") / f"{name}.safetensors")
    write_tables(tables, folder)
