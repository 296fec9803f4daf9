"""The way from demonstrations to learned models for fingers of another shape, with the same code.

The method is said not to assume the skin's geometry (II.5): distances on the skin come from the neighbours of
contact points, and these from electrodes. All but the number of models is as for the BioTac.
"""

from structlearn.readers.clock import synchronise
from structlearn.simulation.touch import FingerParameters
from structlearn.simulation.touch_demonstrator import ToucherParameters, demonstrate, recorded
from structlearn.tactile.electrodes import SKINS
from structlearn.tactile.geodesics import geodesics
from structlearn.tactile.latent_comparison import LatentComparison, learn
from structlearn.tactile.latent_parameters import GeodesicParameters, LatentParameters
from structlearn.tactile.touch_preparation import TouchDataParameters, prepare
from structlearn.testbeds.servoing.protocol.servo_variants import OtherSkinsParameters, SkinName


def learn_other_skin(
    other: OtherSkinsParameters,
    person: ToucherParameters,
    finger: FingerParameters,
    preparation: TouchDataParameters,
    distances: GeodesicParameters,
    latent: LatentParameters,
    name: SkinName,
) -> LatentComparison:
    """Demonstrate and learn with another skin."""
    person = other.person_with(name, person)
    recordings = [recorded(run, person) for run in demonstrate(person, finger)]
    demonstrations = [synchronise(one, preparation.rate_hz) for one in recordings]
    dataset = prepare(demonstrations, SKINS[name], preparation)
    measured = geodesics(dataset.contact_point, distances)
    training = latent.training.model_copy(update={"evaluate_every": latent.training.steps})
    fewer = {"seeds": other.seeds, "stacks": 1, "training": training}
    return learn(dataset, measured, latent.model_copy(update=fewer))
