"""The people of the testbed: what each of them demonstrates, as what is learned from it.

Runs of one of them are kept, to be shown. The others are simulated where they are needed: as many runs of
each would say nothing more.
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
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.runs import read_runs
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

    `recorded`: folder with the runs of `person`; `person`: who is recorded; others differ by their
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
        return [read_runs(recorded / f"{name}.parquet") for name in names]
    other = person.model_copy(update={"seed": seed})
    return [demonstrations(place, scene, other) for place in places]
