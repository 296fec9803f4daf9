"""Learn the primitives of a task, and unroll them as a sequence (dissertation IV.3, IV.5.4)."""

from structlearn.core.artefacts import publish, write_metrics
from structlearn.primitives import sequence
from structlearn.primitives.fitting import learn_sequence
from structlearn.primitives.primitive_files import write_primitives, write_vector_primitive
from structlearn.readers.demonstration import OUTPUTS, POSE, joint_names
from structlearn.tasks.movement import movement_learning as learning
from structlearn.tasks.movement.parameters import PARTS, MovementEntry
from structlearn.tasks.task_files import TaskFiles, run_for_task, write_tables

# The page also shows the sequence elsewhere, slower, and turned about the vertical
NEW_SITUATION = sequence.GeneraliseParameters(
    start_offset_m=(0.02, -0.02, 0.01),
    goal_offset_m=(-0.02, 0.03, 0.01),
    goal_turn_deg=10.0,
    duration_factor=1.5,
)


def main(files: TaskFiles) -> None:
    own = files.entry(MovementEntry)
    signals = (*POSE, *OUTPUTS, *(() if own.traces_hz is None else ("tactile",)))
    runs = files.runs("demonstrations", signals)
    cuts = learning.learned_cuts(files.segmentation(), own.keep_flagged)
    primitives, dt = learn_sequence(runs, cuts, own.fit), runs[0].dt
    paths = {
        "nominal": sequence.unroll(primitives, dt),
        "generalised": sequence.generalised(primitives, dt, NEW_SITUATION),
    }
    errors = learning.reproduction(runs, cuts, own.fit, own.fold)
    named = joint_names(runs[0]), runs[0].output_names, runs[0].digital_names
    tables = {name: sequence.sequence_table(path, list(cuts), *named) for name, path in paths.items()}
    tables |= {"reproduction": errors}
    if own.stiffness is not None:
        tables["spread"] = learning.spreads(runs, cuts, primitives, own.fit)
    if runs[0].outputs is not None:
        tables["outputs"] = learning.output_errors(runs, cuts, own.fit, own.fold)
    if runs[0].digital is not None:
        tables["digital"] = learning.edge_times(runs, cuts, primitives)
    if own.turns:
        tables["turns"] = learning.turn_errors(runs, primitives[0], own.fit)
    if own.presegmented == PARTS:
        tables["execution"] = learning.execution_errors(runs, paths["nominal"])
    with publish(files.folder / "primitives") as folder:
        folder.mkdir()
        write_primitives(primitives, folder / "primitives.safetensors")
        fit = learning.fit_metrics(errors, own.fit)
        write_metrics(fit, folder / "metrics.json")
        if own.traces_hz is not None:
            traces, tables["trace_scores"], tables["traces"] = learning.learn_traces(runs, own.traces_hz)
            for name, primitive in traces.items():
                path = folder / f"traces/{name}.safetensors"
                write_vector_primitive(primitive, path, "electrode counts without offset")
        write_tables(tables, folder)
    words = (f"{key.removeprefix('primitives_')} {value:.3g}" for key, value in fit.items())
    print("mean distance from demonstrations:", ", ".join(words))


if __name__ == "__main__":
    run_for_task(main, out="primitives")
