"""Learn feedback from the corrections of a task (dissertation IV.6, IV.9.1)."""

from structlearn.segmentation.parameters import SegmentParameters
from structlearn.tasks.own.protocol.own_feedback import learn_own_feedback, write_own_feedback
from structlearn.tasks.task_entry import OwnFeedbackParameters
from structlearn.tasks.task_files import TaskFiles, run_for_task


def main(files: TaskFiles) -> None:
    learned = learn_own_feedback(
        files.runs("executions"),
        {setting: files.runs("corrections", setting) for setting in files.settings()},
        files.primitives(),
        files.part("segment", SegmentParameters),
        files.part("feedback", OwnFeedbackParameters),
    )
    write_own_feedback(learned, files.folder / "feedback")


if __name__ == "__main__":
    run_for_task(main, "feedback", "feedback")
