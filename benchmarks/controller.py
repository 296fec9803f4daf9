"""Latency of the runtime controller: a tick with feedback at 1 kHz, the network of the text in the loop.

    python benchmarks/controller.py [--ticks N]

Every tick gets a new sensor sample of 38 channels, ten times as often as the sensor would send one. The
maximum says more about the machine (other processes, interrupts) than about the controller.
"""

import argparse
import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1", NUMBA_NUM_THREADS="1")

import numpy as np
from primitive_inputs import DT, NETWORK, SEED, demonstrations, orientation_demonstration

from structlearn.feedback.pmnn import PhaseModulatedNetwork
from structlearn.feedback.runtime import Controller, tick_latency
from structlearn.feedback.skill import ReactiveSkill
from structlearn.primitives.orientation import fit_quaternion
from structlearn.primitives.position import fit_position
from structlearn.primitives.sensor_traces import fit_expected_traces
from structlearn.primitives.sequence import PosePrimitive

RATE_HZ, TICKS = 1000.0, 100_000


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ticks", type=int, default=TICKS, help="number of ticks")
    ticks = parser.parse_args().ticks
    controller = Controller(skill(), RATE_HZ)
    tick_latency(controller, 1000)  # what is used first is slow
    print(summary(tick_latency(controller, ticks)))


def summary(seconds: np.ndarray) -> str:
    """One line about the durations (T,) of ticks in s."""
    median, percentile, largest = 1e6 * np.percentile(seconds, [50.0, 99.0, 100.0])
    size = "-".join(map(str, NETWORK))
    return (
        f"{len(seconds)} ticks at {RATE_HZ:.0f} Hz with {size} networks: "
        f"median {median:.1f} us, 99 % within {percentile:.1f} us, maximum {largest:.0f} us"
    )


def skill() -> ReactiveSkill:
    """Three primitives with networks of the text's size; what they do does not matter here."""
    rng = np.random.default_rng(SEED)
    names = ("first", "second", "third")
    point, turn = fit_position(demonstrations(1)), fit_quaternion([orientation_demonstration(1.0)])
    return ReactiveSkill(
        primitives=[PosePrimitive(name, point, turn) for name in names],
        expected={name: fit_expected_traces([_trace(rng)], DT, 25.0) for name in names},
        networks={name: _network(rng) for name in names},
    )


def _trace(rng: np.random.Generator) -> np.ndarray:
    """Smooth counts of all channels over a second, (1000, E)."""
    return 30.0 * np.sin(np.linspace(0.0, 3.0, 1000)[:, None] * rng.uniform(0.5, 2.0, NETWORK[0]))


def _network(rng: np.random.Generator) -> PhaseModulatedNetwork:
    inputs, hidden, kernel_count, _ = NETWORK
    return PhaseModulatedNetwork(
        input_mean=np.zeros(inputs),
        input_scale=np.full(inputs, 10.0),
        hidden=((rng.normal(0.0, inputs**-0.5, (hidden, inputs)), np.zeros(hidden)),),
        phase_weights=rng.normal(0.0, hidden**-0.5, (kernel_count, hidden)),
        phase_biases=np.zeros(kernel_count),
        output_weights=rng.normal(size=kernel_count),
    )


if __name__ == "__main__":
    main()
