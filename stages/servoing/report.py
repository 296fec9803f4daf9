"""Report of the servoing testbed: figures, tables, findings and their page."""

from dissertation.evidence.claims import quoted_claims
from dissertation.evidence.judged_page import publish_judged
from dissertation.evidence.studies import read_study
from dissertation.servoing import files
from dissertation.servoing.page.figures import drawings
from dissertation.servoing.page.findings import PEOPLE_STUDY, ModelScores, ServoingResults, findings
from dissertation.servoing.page.page import document
from dissertation.servoing.protocol.servo_variants import OtherSkinsParameters, ServoTrialParameters
from dissertation.simulation.touch_demonstrator import ToucherParameters
from structlearn.core.artefacts import read_table
from structlearn.core.params import Population
from structlearn.core.stage import run, stage_parameters
from structlearn.tactile.latent_parameters import GeodesicParameters, LatentParameters
from structlearn.tactile.touch_dataset import TouchDataParameters, read_dataset

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
    loops = files.tables("loops")
    skin_tables = files.tables("skins") | {"trials": loops.pop("other_skins")}
    results = ServoingResults(
        dataset=read_dataset(files.MADE_BY["touch"][0]),
        truth=read_table(files.MADE_BY["contacts"][0]),
        models=ModelScores(**files.tables("models")),
        loops=loops,
        skin_tables=skin_tables,
        chosen=chosen,
        study=read_study(PEOPLE_STUDY),
    )
    find = findings(results)
    page, drawn = document(results, find), drawings(results)
    publish_judged("reports/servoing", {"index": page}, drawn, page.tables, find, recorded=quoted_claims())


if __name__ == "__main__":
    run(main)
