"""The report of the servoing testbed: figures, tables, findings and the page that shows them."""

from structlearn.core.params import Population
from structlearn.core.stage import run, stage_parameters
from structlearn.reporting.claims import quoted_claims
from structlearn.reporting.publishing import publish_report
from structlearn.reporting.studies import read_study
from structlearn.simulation.touch_demonstrator import ToucherParameters
from structlearn.tactile.latent_parameters import GeodesicParameters, LatentParameters
from structlearn.tactile.touch_preparation import TouchDataParameters
from structlearn.testbeds.servoing import files
from structlearn.testbeds.servoing.page.figures import drawings
from structlearn.testbeds.servoing.page.findings import findings
from structlearn.testbeds.servoing.page.page import document
from structlearn.testbeds.servoing.page.results import STUDIES, ServoingResults
from structlearn.testbeds.servoing.page.tables import tables
from structlearn.testbeds.servoing.protocol.servo_variants import OtherSkinsParameters, ServoTrialParameters
from structlearn.testbeds.servoing.world.scene_still import scene_still

PARAMETERS = {
    "toucher": ToucherParameters,
    "touch_dataset": TouchDataParameters,
    "geodesics": GeodesicParameters,
    "train_latent": LatentParameters,
    "servo": ServoTrialParameters,
    "other_skins": OtherSkinsParameters,
    "servo_people": Population,
}


def main() -> None:
    chosen = {key: stage_parameters(key, model) for key, model in PARAMETERS.items()}
    results = ServoingResults(
        dataset=files.touch(),
        truth=files.true_contacts(),
        models=files.model_scores(),
        comparison=files.closed_loops(),
        skin_tables=files.other_skins(),
        chosen=chosen,
        studies={name: read_study(f"servoing/{name}") for name in STUDIES},
    )
    find, shown = findings(results), tables(results)
    publish_report(
        files.REPORT,
        {"index": document(results, find, shown)},
        drawings(results, scene_still(results.skin, 1e-3 * chosen["toucher"].handle_radius_mm)),
        shown,
        find,
        recorded=quoted_claims(),
    )


if __name__ == "__main__":
    run(main)
