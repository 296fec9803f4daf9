"""Which log of the UR10e is what, where those that the parameters name are not there."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from structlearn.ground.errors import MissingInputError
from structlearn.recordings.joint_log import DriveLog
from structlearn.testbeds.recorded.protocol.arm_parameters import RecordedUr10eParameters

LOAD = "(?<!un)(?<!no)(?<!no.)load"
"""Not `unload` nor `no_load`."""

CARRIES = re.compile(f"{LOAD}|mass", re.IGNORECASE)
"""In the name of a log with something at the flange."""

THE_LOAD = re.compile(f"{LOAD}$", re.IGNORECASE)
"""At the end of a name: it is the load that was weighed, of others the mass is not known."""


def moving_logs(logs: Mapping[str, DriveLog], parameters: RecordedUr10eParameters) -> dict[str, DriveLog]:
    """Logs in which every joint moves, by name: of one that rests, errors are of nothing."""
    fastest = {name: np.abs(log.velocities).max(axis=0).min() for name, log in logs.items()}
    return {name: log for name, log in logs.items() if fastest[name] > parameters.rest_rad_s}


def logs_that_are_there(
    logs: Mapping[str, DriveLog], parameters: RecordedUr10eParameters
) -> RecordedUr10eParameters:
    """Parameters that name logs which are there, and every pair of logs without and with the load.

    What is learned from is the longest motion without a load where the one that is named is missing, and what
    is asked about the longest of the others. A log with the load belongs to the one of its name without, or
    to the motion that is learned from. Where the arm never stands still, `rest` is None.

    Args:
        logs: by name.
        parameters: as they were chosen.

    Raises:
        MissingInputError: there are no two motions without a load.
    """
    moving = moving_logs(logs, parameters)
    empty = [name for name in moving if not CARRIES.search(name)]
    named = [name for name in (parameters.train, parameters.test) if name in empty]
    others = sorted(set(empty) - set(named), key=lambda name: (-moving[name].time[-1], name))
    if len(empty) < 2:
        raise MissingInputError(
            f"of {len(logs)} logs {len(empty)} are motions of all joints without a load, and two are needed: "
            "one to learn from and another one to ask about"
        )
    train = parameters.train if parameters.train in named else others.pop(0)
    test = parameters.test if parameters.test in named else others.pop(0)
    resting = [name for name, log in logs.items() if np.abs(log.velocities).max() <= parameters.rest_rad_s]
    rest = parameters.rest if parameters.rest in resting else next(iter(resting), None)
    pairs = [pair for pair in parameters.load_pairs if set(pair) <= set(moving)]
    loaded = [name for name in moving if THE_LOAD.search(name)]
    pairs += [
        (_without(name, empty, train), name) for name in loaded if name not in {pair[1] for pair in pairs}
    ]
    update = {"rest": rest, "train": train, "test": test, "load_pairs": tuple(pairs)}
    return parameters.model_copy(update=update)


def _without(loaded: str, empty: Sequence[str], train: str) -> str:
    """The log of the same motion without the load."""
    stem = THE_LOAD.sub("", loaded)
    return next((name for name in (stem, f"{stem}unload") if name in empty), train)
