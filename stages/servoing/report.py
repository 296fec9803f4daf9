"""The report of the servoing testbed: figures, tables, metrics and the page that shows them."""

import pandas as pd

from structlearn.ground.artefacts import read_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings.source import SourceParameters
from structlearn.reporting.page import Link
from structlearn.reporting.publishing import publish_report
from structlearn.simulation.touch_demonstrator import ToucherParameters
from structlearn.tactile.geodesics import GeodesicParameters
from structlearn.tactile.latent_comparison import LatentParameters
from structlearn.tactile.touch_dataset import read_dataset
from structlearn.tactile.touch_preparation import TouchDataParameters
from structlearn.testbeds.servoing.page.servoing_loop import ServoLoop
from structlearn.testbeds.servoing.page.servoing_other_skins import OtherSkins
from structlearn.testbeds.servoing.page.servoing_page import servoing_page
from structlearn.testbeds.servoing.page.servoing_results import ServoingResults, metrics
from structlearn.testbeds.servoing.page.servoing_sections import pictures
from structlearn.testbeds.servoing.page.servoing_tables import tables
from structlearn.testbeds.servoing.protocol.other_skins import OtherSkinsParameters
from structlearn.testbeds.servoing.protocol.servo_trials import ServoTrialParameters

PARAMETERS = {
    "toucher": ToucherParameters,
    "touch_dataset": TouchDataParameters,
    "geodesics": GeodesicParameters,
    "train_latent": LatentParameters,
    "servo": ServoTrialParameters,
    "other_skins": OtherSkinsParameters,
}
RECORDINGS = {
    "demonstrations": "the finger on the handle, its electrodes, and the contact on the skin",
    "latent": "the latent map by electrode, and demonstrations on it and on the skin",
}
LOOPS = {"servo": "closed loops: the finger, the skin, the latent path and its target"}


def main() -> None:
    parameters = {key: stage_parameters(key, model) for key, model in PARAMETERS.items()}
    simulated = stage_parameters("record_touch", SourceParameters).simulated
    results = ServoingResults(
        dataset=read_dataset("data/servoing/touch.safetensors"),
        truth=read_table("data/servoing/true_contacts.parquet"),
        **tables_of("evaluation", "latent", "forward", "directions", "curve", "latent_map"),
        loop=ServoLoop(**tables_of("servo", "trials", "progress", "paths"), parameters=parameters["servo"])
        if simulated
        else None,
        other_skins=OtherSkins(
            **tables_of("other_skins", "latent", "directions", "trials"),
            parameters=parameters["other_skins"],
            servo=parameters["servo"],
        ),
        person=parameters["toucher"],
        preparation=parameters["touch_dataset"],
        geodesics=parameters["geodesics"],
        learned=parameters["train_latent"],
    )
    links = [
        Link(f"../recordings/servoing/{name}.rrd", f"{name}.rrd", note)
        for name, note in (RECORDINGS | LOOPS if simulated else RECORDINGS).items()
    ]
    publish_report(
        "reports/servoing",
        pictures(results),
        tables(results),
        metrics(results),
        lambda sizes: servoing_page(results, sizes, parameters, links),
    )


def tables_of(stage: str, *names: str) -> dict[str, pd.DataFrame]:
    """Tables that a stage wrote, by name."""
    return {name: read_table(f"data/servoing/{stage}/{name}.parquet") for name in names}


if __name__ == "__main__":
    run(main)
