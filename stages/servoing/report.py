"""Report of the servoing testbed: figures, tables, findings and their page."""

from dissertation.evidence.claims import quoted_claims
from dissertation.evidence.judged_page import publish_judged
from dissertation.evidence.results import read_results
from dissertation.evidence.studies import RESULTS, stored_study
from dissertation.servoing import files
from dissertation.servoing.page.figures import drawings
from dissertation.servoing.page.findings import PEOPLE_STUDY, findings
from dissertation.servoing.page.page import PUBLISHED, document
from dissertation.servoing.page.shown import Shown
from dissertation.servoing.protocol.servo_variants import OtherSkinsParameters, ServoTrialParameters
from dissertation.simulation.fingers import PinchParameters
from dissertation.simulation.touch import TouchFingerParameters
from dissertation.simulation.touch_demonstrator import ToucherParameters
from structlearn.core.artefacts import read_table
from structlearn.core.params import Population
from structlearn.core.stage import run, stage_parameters
from structlearn.tactile.latent_parameters import GeodesicParameters, LatentParameters
from structlearn.tactile.touch_dataset import TouchDataParameters, read_dataset

PARAMETERS = {
    "toucher": ToucherParameters,
    "touch_finger": TouchFingerParameters,
    "testbed.touch": PinchParameters,
    "touch_dataset": TouchDataParameters,
    "geodesics": GeodesicParameters,
    "train_latent": LatentParameters,
    "servo": ServoTrialParameters,
    "other_skins": OtherSkinsParameters,
    "servo_people": Population,
}


def main() -> None:
    shown = Shown(
        dataset=read_dataset(files.MADE_BY["touch"][0]),
        truth=read_table(files.MADE_BY["contacts"][0]),
        models=files.tables("models"),
        loops=files.tables("loops"),
        other_skins=files.tables("skins"),
        chosen={key: stage_parameters(key, model) for key, model in PARAMETERS.items()},
    )
    study = stored_study(RESULTS / PEOPLE_STUDY)
    find = findings(read_results("servoing"), study)
    page, drawn = document(shown, find, study), drawings(shown, PUBLISHED)
    publish_judged("reports/servoing", {"index": page}, drawn, page.tables, find, recorded=quoted_claims())


if __name__ == "__main__":
    run(main)
