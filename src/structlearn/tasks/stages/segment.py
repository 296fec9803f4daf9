"""Cut the demonstrations of a task into primitives (dissertation IV.5)."""

from structlearn.core.artefacts import publish, write_metrics, write_table
from structlearn.readers.demonstration import POSE
from structlearn.segmentation.segments import write_segmentation
from structlearn.tasks.movement.movement_learning import cut_errors_between_rests, cut_metrics, segmented
from structlearn.tasks.movement.parameters import MovementEntry
from structlearn.tasks.task_files import TaskFiles, run_for_task


def main(files: TaskFiles) -> None:
    own = files.entry(MovementEntry)
    by_signals = own.segment is not None and any(one.until is not None for one in own.segment.primitives)
    runs = files.runs("demonstrations", None if by_signals else POSE)
    segmentation = segmented(runs, own.presegmented, own.segment)
    metrics = cut_metrics(runs, segmentation)
    with publish(files.segments) as folder:
        write_segmentation(segmentation, folder)
        write_metrics(metrics, folder / "metrics.json")
        if own.rests is not None and own.segment is not None:
            errors = cut_errors_between_rests(runs, own.segment, own.rests)
            write_table(errors, folder / "cut_errors.parquet")
    words = {"demonstrations": "demonstrations cut", "left_out": "left out", "warnings": "cut warnings"}
    print(*(f"{metrics[f'cuts_{key}']} {word}" for key, word in words.items()), sep=", ")


if __name__ == "__main__":
    run_for_task(main, out="segments")
