"""Cut the demonstrations of a task into primitives (dissertation IV.5)."""

from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import cut, write_segmentation
from structlearn.tasks.task_files import TaskFiles, run_for_task


def main(files: TaskFiles) -> None:
    parameters = files.part("segment", SegmentParameters)
    write_segmentation(cut(files.runs("demonstrations"), parameters), files.segments)


if __name__ == "__main__":
    run_for_task(main, out="segments")
