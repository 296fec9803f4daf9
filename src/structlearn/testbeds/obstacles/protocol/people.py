"""The people of the testbed: what each of them demonstrates, as what is learned from it.

One of them is recorded into bags, and read from there as anyone's recordings would be. The others are
simulated where they are needed: as many bags of each would say nothing more.
"""

from pathlib import Path

import pandas as pd

from structlearn.avoidance.avoidance_dataset import (
    AvoidanceDataParameters,
    avoidance_dataset,
    fit_baseline,
    to_table,
)
from structlearn.primitives.position import PositionPrimitive
from structlearn.recordings import read_demonstrations
from structlearn.recordings.demonstration import Demonstration
from structlearn.testbeds.obstacles.files import BASELINE
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import demonstration_scores
from structlearn.testbeds.obstacles.world.reaching_person import AvoiderParameters, demonstrations
from structlearn.testbeds.obstacles.world.scenarios import Scenario, SceneParameters, scenarios


def taught(
    seed: int,
    recorded: str | Path,
    scene: SceneParameters,
    person: AvoiderParameters,
    parameters: AvoidanceDataParameters,
) -> tuple[PositionPrimitive, pd.DataFrame, pd.DataFrame]:
    """What one person teaches.

    `recorded`: folder with the demonstrations of `person`; `person`: who is recorded; others differ by their
    seed. Returns the unhindered reach; the samples, see `avoidance_dataset.to_table`; scores of the
    demonstrations, see `avoidance_protocols.demonstration_scores`; the tables with a column `person`.
    """
    places = scenarios(scene)
    unhindered, *sets = _demonstrated(seed, [None, *places], Path(recorded), scene, person)
    baseline = fit_baseline(unhindered, parameters)
    pairs = zip((place.obstacle for place in places), sets, strict=True)
    samples = to_table(avoidance_dataset(pairs, baseline, parameters))
    scores = demonstration_scores(sets, places, baseline, parameters.cloud_count)
    return baseline, samples.assign(person=seed), scores.assign(person=seed)


def _demonstrated(
    seed: int,
    places: list[Scenario | None],
    recorded: Path,
    scene: SceneParameters,
    person: AvoiderParameters,
) -> list[list[Demonstration]]:
    """Demonstrations by scenario, None without obstacle: read where they are recorded, else simulated."""
    if seed == person.seed:
        names = [BASELINE if place is None else place.name for place in places]
        return [read_demonstrations(recorded / name) for name in names]
    return demonstrations(places, scene, person.model_copy(update={"seed": seed}))
