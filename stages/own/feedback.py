"""Learn feedback from the corrections of a task (dissertation IV.6, IV.9.1)."""

from structlearn.segmentation.parameters import SegmentParameters
from structlearn.testbeds.own.files import TaskFiles, run_for_task
from structlearn.testbeds.own.protocol.own_feedback import learn_own_feedback, write_own_feedback
from structlearn.testbeds.own.task import OwnFeedbackParameters


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
