"""Learn primitives from a folder of bags and run them to goals elsewhere: the library alone, no pipeline.

make own-example                             # six bags of an invented task, data/example/pick
structlearn new pick --from data/example/pick
cd pick && python ../examples/learn_from_bags.py pick      # any entry of structlearn.yaml
"""

import argparse

import numpy as np

from structlearn.core.stage import run
from structlearn.primitives import cross_validation, learn_sequence, sequence
from structlearn.readers import read_demonstrations
from structlearn.segmentation import cut
from structlearn.tasks.task_entry import read_task

SHIFT_M = np.array([0.03, -0.02, 0.0])
RATE_HZ = 1000.0


def main(name: str) -> sequence.SequencePath:
    """Read, cut, learn, and unroll with all goals shifted; the path."""
    task = read_task(name)
    clock = task.clock.model_dump()
    demonstrations = read_demonstrations(task.source, task.topics, **clock, stamps=task.stamps)
    segmentation = cut(demonstrations, task.segment)
    primitives = learn_sequence(demonstrations, segmentation.results, task.fit)
    errors = cross_validation(demonstrations, segmentation.results, task.fit)
    for primitive in primitives:
        left_out = errors[errors["left_out"] & (errors["primitive"] == primitive.name)]
        print(
            f"{primitive.name}: {len(segmentation.result(primitive.name))} segments of "
            f"{primitive.duration:.2f} s on average; {left_out['mean_mm'].mean():.1f} mm from those left out"
        )
    goals = sequence.moved_goals(sequence.default_goals(primitives), SHIFT_M)
    path = sequence.unroll(primitives, 1.0 / RATE_HZ, goals=goals)
    missed = 1e3 * np.linalg.norm(
        path.position.position[path.switches[1:]] - [g.position for g in goals], axis=1
    )
    for primitive, distance in zip(primitives, missed, strict=True):
        print(f"goal of {primitive.name} shifted by {1e3 * SHIFT_M} mm: reached within {distance:.1f} mm")
    return path


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("name", help="a task of structlearn.yaml")
    name = parser.parse_args().name
    run(lambda: main(name), stage=False)
