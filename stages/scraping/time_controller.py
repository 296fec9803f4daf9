"""Time the runtime controller and a simulated run on this machine; no other stage uses the result."""

from dissertation.scraping.protocol.executions import TimingParameters, controller_latency, run_cost
from dissertation.scraping.world.testbed import TestbedParameters
from structlearn.core.artefacts import write_metrics
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.skill_file import read_skill


def main() -> None:
    parameters = stage_parameters("time_controller", TimingParameters)
    testbed = stage_parameters("testbed", TestbedParameters)
    skill = read_skill("data/feedback/scraping/skill.safetensors")
    times = controller_latency(skill, parameters) | run_cost(skill, testbed, parameters)
    write_metrics(times, "reports/scraping/timings.json")


if __name__ == "__main__":
    run(main)
