"""The whole way from demonstrations to closed loops for fingers of another shape, with the same code.

The method is said not to assume the skin's geometry (II.5): distances on the skin come from the neighbours of
contact points, and these from electrodes. Less is trained here than for the BioTac; the protocol is the same.
"""

import pandas as pd

from structlearn.recordings.clock import synchronise
from structlearn.simulation.touch import FingerParameters
from structlearn.simulation.touch_demonstrator import ToucherParameters, demonstrate, recorded
from structlearn.tactile.electrodes import SKINS
from structlearn.tactile.geodesics import geodesics
from structlearn.tactile.latent_comparison import learn
from structlearn.tactile.latent_parameters import GeodesicParameters, LatentParameters
from structlearn.tactile.latent_variants import FORWARD_OF
from structlearn.tactile.resting_servo import demonstrated_actions
from structlearn.tactile.touch_preparation import TouchDataParameters, prepare
from structlearn.testbeds.servoing.protocol.other_skin_parameters import OtherSkinsParameters
from structlearn.testbeds.servoing.protocol.servo_trials import Taught, compare
from structlearn.testbeds.servoing.protocol.servo_variants import (
    PUBLISHED,
    RESTING,
    ServoTrialParameters,
    Variant,
)


def with_other_skin(
    name: str,
    other: OtherSkinsParameters,
    person: ToucherParameters,
    finger: FingerParameters,
    preparation: TouchDataParameters,
    distances: GeodesicParameters,
    latent: LatentParameters,
    servo: ServoTrialParameters,
) -> dict[str, pd.DataFrame]:
    """Demonstrate, learn and servo with another skin.

    Args:
        name: of the skin.
        other: what is different.
        person: who demonstrates.
        finger: that touches.
        preparation: from recordings to samples.
        distances: on the skin.
        latent: what is trained.
        servo: closed loops, by published and resting controllers with structure and the inverse models' loss.

    Returns:
        `latent` (see `tactile.latent_evaluation.latent_errors`), `directions` (see
        `tactile.latent_evaluation.direction_errors`) and `trials` (see `servo_variants.Comparison`), each
        with the column `skin`.
    """
    person = person.model_copy(update={"skin": name} | other.skins[name].model_dump())
    recordings = [recorded(run, person) for run in demonstrate(person, finger)]
    demonstrations = [synchronise(one, preparation.rate_hz) for one in recordings]
    dataset = prepare(demonstrations, SKINS[name], preparation)
    measured = geodesics(dataset.contact_point, distances.model_copy(update={"bins": other.bins}))
    training = latent.training.model_copy(update={"steps": other.steps, "evaluate_every": other.steps})
    learned = learn(dataset, measured, latent.model_copy(update={"seeds": other.seeds, "training": training}))
    chosen = [Variant(form, inverse) for form in (PUBLISHED, RESTING) for inverse in FORWARD_OF]
    taught = Taught(learned.models, learned.units, demonstrated_actions(dataset))
    trials = compare(taught, person, finger, servo, chosen).trials
    tables = {"latent": learned.latent, "directions": learned.directions, "trials": trials}
    for table in tables.values():
        table.insert(0, "skin", name)
    return tables
