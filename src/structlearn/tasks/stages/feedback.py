"""Learn coupling terms from a task's corrections, from sensors or over phase alone (IV.6, IV.9.1)."""

from pathlib import Path

from structlearn.core.artefacts import publish, write_metrics
from structlearn.core.errors import MissingInputError
from structlearn.feedback.coupling_model import write_networks
from structlearn.tasks.movement import phase_corrections
from structlearn.tasks.movement.feedback_learning import feedback_metrics, learn_feedback, write_feedback
from structlearn.tasks.movement.parameters import MovementEntry
from structlearn.tasks.task_files import TaskFiles, leave_out, run_for_task, write_tables


def main(files: TaskFiles) -> None:
    own, reason = files.entry(MovementEntry), "The task has no corrections."
    with publish(files.folder / "feedback") as folder:
        folder.mkdir()
        if own.feedback is not None and own.segment is not None:
            settings = sorted(path.stem for path in (files.recorded / "corrections").glob("*.parquet"))
            corrections = {setting: files.runs(f"corrections/{setting}") for setting in settings}
            data = files.runs("executions"), corrections, files.primitives()
            learned = learn_feedback(*data, own.segment, own.feedback)
            write_feedback(learned, folder)
            write_metrics(feedback_metrics(learned), folder / "metrics.json")
        if own.corrections is not None:
            try:
                learn_over_phase(files, own.corrections, folder)
            except MissingInputError as missing:
                reason = str(missing)
        if not any(folder.iterdir()):
            leave_out(folder, reason)


def learn_over_phase(
    files: TaskFiles, parameters: phase_corrections.PhaseCorrectionParameters, folder: Path
) -> None:
    """Learn coupling over phase from corrected runs of a task with one primitive."""
    if not (files.recorded / "corrected.parquet").exists():
        raise MissingInputError("the corrected runs are not recorded here")
    nominal, runs = files.primitives()[0].position, files.runs("corrected")
    ends = phase_corrections.completeness(runs, nominal, parameters.incomplete_m)
    complete = phase_corrections.complete(runs, ends)
    corrected = phase_corrections.runs_with_coupling(complete, nominal, parameters.smoothing_hz)
    networks, tables = phase_corrections.learn_corrections(corrected, nominal.local, parameters)
    write_networks(networks, folder / "phase_networks.safetensors")
    write_tables(tables | {"completeness": ends}, folder)


if __name__ == "__main__":
    run_for_task(main, out="feedback")
