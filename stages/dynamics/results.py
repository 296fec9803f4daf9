"""Reduce what the evaluating stages wrote to one table of results (tables III.1, III.2, figure III.2)."""

from dissertation.dynamics.files import read_tables
from dissertation.dynamics.protocol.forms import EpochLimits
from dissertation.dynamics.protocol.results import dynamics_results
from dissertation.dynamics.world.arm_motion import ArmMotionParameters
from dissertation.dynamics.world.joint_logs import PerturbedRobotParameters, RecordMotionParameters
from dissertation.evidence.results import FOLDER
from structlearn.core.artefacts import write_table
from structlearn.core.stage import run, stage_parameters


def main() -> None:
    limits = stage_parameters("train_dynamics.epochs", EpochLimits)
    payload = stage_parameters("record_motion", RecordMotionParameters).payload
    log_s = stage_parameters("perturbed_robot", PerturbedRobotParameters).log_s
    motion = stage_parameters("arm_motion", ArmMotionParameters).used.cut(log_s)
    results = dynamics_results(read_tables(), limits, payload.mass_kg, payload.pick_up_s(motion.duration_s))
    write_table(results, FOLDER / "dynamics.parquet")


if __name__ == "__main__":
    run(main)
