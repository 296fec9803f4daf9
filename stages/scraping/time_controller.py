"""Time the runtime controller and a simulated run on this machine; no stage depends on the result."""

from structlearn.feedback.pmnn import read_networks
from structlearn.feedback.skill import ReactiveSkill
from structlearn.feedback.supervision import SupervisionParameters
from structlearn.feedback.training_parameters import POINTWISE
from structlearn.ground.artefacts import write_metrics
from structlearn.ground.stage import run, stage_parameters
from structlearn.primitives.primitive_files import read_primitives
from structlearn.testbeds.scraping.files import read_expected
from structlearn.testbeds.scraping.protocol.latency import TimingParameters, controller_latency, run_cost
from structlearn.testbeds.scraping.world.testbed import TestbedParameters

DATA = "data/feedback/scraping"


def main() -> None:
    parameters = stage_parameters("time_controller", TimingParameters)
    testbed = stage_parameters("testbed", TestbedParameters)
    axis = stage_parameters("coupling_dataset", SupervisionParameters).unit_axis
    networks = read_networks(f"{DATA}/models/{POINTWISE}.safetensors")
    primitives = read_primitives("data/primitives/scraping/primitives.safetensors")
    skill = ReactiveSkill(primitives, read_expected(f"{DATA}/expected"), networks, axis)
    times = controller_latency(skill, parameters) | run_cost(skill, testbed, parameters)
    write_metrics(times, "reports/scraping/timings.json")


if __name__ == "__main__":
    run(main)
