"""Where the servoing testbed departs from the dissertation, and why."""

import pandas as pd

from structlearn.testbeds.servoing.page.servoing_prose import spaced
from structlearn.testbeds.servoing.page.servoing_published import ITERATIONS
from structlearn.testbeds.servoing.page.servoing_results import ServoingResults


def departures(results: ServoingResults) -> pd.DataFrame:
    """Columns `dissertation`, `here`, `why`; without what concerns simulation where nothing was simulated."""
    learned, training = results.learned, results.learned.training
    weights = training.weights
    prepared = results.preparation
    demonstrator = (
        "A person guides a robot with a BioTac over a drawer handle",
        "A simulated person, a simulated sensor and a round handle",
        "The recordings are not public.",
    )
    rows = [
        *([demonstrator] if results.simulated else []),
        (
            "Off-contact samples are left out below a pressure that is not given",
            f"Samples from {prepared.touched_counts:g} counts on, pairs from {prepared.pressed_counts:g}",
            "Picked with the text's counts of samples and pairs in view.",
        ),
        (
            "85 | 7.5 | 7.5 % of the data; of what is not said",
            "Whole contacts, from touching to lifting, are in one split",
            "Neighbouring samples are nearly equal: a split of samples would test on what was learned.",
        ),
        (
            "Raw counts; losses are evened out by weights up to 10⁸",
            f"Signals and pressure are standardised, the map is in units of {100 * learned.map_unit_m:g} "
            f"cm, actions are in their root mean squares; weights {weights.reconstruction:g}, "
            f"{weights.distances:g} and {weights.pressure:g} of the latent space, {weights.forward:g} and "
            f"{weights.inverse:g} of forward and inverse loss, β = {training.action_penalty:g}",
            "The published weights belong to the sensor's counts and the robot's velocities. How the forward "
            "loss's weight and β were settled is told with the inverse models.",
        ),
        (
            "RMSProp; nothing is said of a schedule",
            "RMSProp whose learning rate falls to 0 along half a cosine",
            "Else the last steps are as large as the first, and errors depend on the step one stops at.",
        ),
        (
            "Batch normalisation “in our model”",
            "In the autoencoder only",
            "In which layers is not said.",
        ),
        (
            f"{spaced(ITERATIONS)} steps",
            f"{spaced(training.steps)} steps",
            "More change little: see the learning curve.",
        ),
        (
            "One training, as it seems",
            f"{learned.seeds} seeds, which change initial weights and batches",
            "Intervals cover this chance alone: demonstrations, sensor and splits are the same for all "
            "seeds.",
        ),
    ]
    if results.loop is not None:
        published, resting = results.loop.parameters.published, results.loop.parameters.resting
        rows.append(
            (
                "Servoing on a robot, shown in photographs; nothing is said of the low-pass then",
                "Closed loops in simulation, counted; the low-pass is causal, at the data's "
                f"{published.loop.cutoff_hz:g} Hz as published and at {resting.loop.cutoff_hz:g} Hz for the "
                "resting form",
                "The training data's low-pass looks ahead, which a loop cannot.",
            )
        )
    return pd.DataFrame(rows, columns=["dissertation", "here", "why"])
