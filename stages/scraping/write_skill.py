"""Write the skill file for a robot: primitives, feedback, bounds, workspace and provenance."""

from pathlib import Path

from dissertation.scraping.files import read_datasets, read_expected
from dissertation.scraping.protocol.feedback_models import POINTWISE, FinalModelParameters
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.coupling_model import read_networks
from structlearn.feedback.coupling_targets import SupervisionParameters, sensor_channels
from structlearn.feedback.skill import ReactiveSkill, demonstrated_limits, demonstrated_workspace, on_axis
from structlearn.feedback.skill_file import SkillParameters, skill_provenance, write_skill
from structlearn.primitives.fitting import FitParameters
from structlearn.primitives.primitive_files import read_primitives
from structlearn.readers.demonstration import read_runs
from structlearn.readers.source import ClockParameters
from structlearn.segmentation.parameters import SegmentParameters

RAW, DATA = Path("data/raw/scraping"), "data/feedback/scraping"

MODELS = {
    "clock": ClockParameters,
    "segment": SegmentParameters,
    "fit_primitives": FitParameters,
    "coupling_dataset": SupervisionParameters,
    "train_feedback": FinalModelParameters,
    "write_skill": SkillParameters,
}


def main() -> None:
    parameters = {key: stage_parameters(key, model) for key, model in MODELS.items()}
    own, axis = parameters["write_skill"], parameters["coupling_dataset"].axis
    demonstrations = read_runs("data/runs/scraping/nominal.parquet")
    expected, datasets = read_expected(f"{DATA}/expected"), read_datasets(f"{DATA}/dataset")
    networks = read_networks(f"{DATA}/models/{POINTWISE}.safetensors")
    skill = ReactiveSkill(
        primitives=read_primitives("data/primitives/scraping/primitives.safetensors"),
        expected=expected,
        networks=on_axis(networks, axis),
        limits=demonstrated_limits({axis: [one.target for one in datasets.values()]}, own),
        workspace=demonstrated_workspace([one.position for one in demonstrations], own.workspace_margin_m),
        sensors=sensor_channels(parameters["coupling_dataset"].sensors, expected),
    )
    used = {key: model.model_dump(mode="json") for key, model in parameters.items()}
    bags = [RAW / name for name in ("nominal", "unrolls", "corrections")]
    write_skill(skill, f"{DATA}/skill.safetensors", skill_provenance(bags, used))


if __name__ == "__main__":
    run(main)
