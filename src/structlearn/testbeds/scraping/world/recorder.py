"""What the devices of the testbed record of a run: streams, each with the clock of its device."""

import numpy as np
from pydantic import Field

import structlearn
from structlearn.ground import quaternion
from structlearn.ground.params import Parameters
from structlearn.recordings.recording import Recording, Stream
from structlearn.testbeds.scraping.world.execution import RunLog

RECORDED_EVERY = 3  # Control ticks per message of the joints and of motion capture: 100 Hz at 300 Hz
FINGERS = ("left", "right")


class RecorderParameters(Parameters):
    """The devices. Fields: `params.yaml`, `testbed.recorder`."""

    motion_capture_deg: float = Field(ge=0)
    stamp_jitter_s: float = Field(ge=0)


def recorded(
    name: str,
    start: int,
    log: RunLog,
    segments: np.ndarray,
    origin: dict[str, str],
    dt: float,
    parameters: RecorderParameters,
    rng: np.random.Generator,
) -> Recording:
    """A run as it is recorded: pose and wrench at the controller's rate, all else slower.

    `start`: stamp of the first tick in ns. `segments`: (P, 2) s, start and end of the primitives. `origin`:
    see `provenance`. `dt`: s per control tick. Returns streams of pose, joints, wrench, two fingers and
    motion capture.
    """
    ticks = np.arange(len(log.position))
    slow = ticks[::RECORDED_EVERY]
    robot = start + np.round(ticks * dt * 1e9).astype(np.int64)

    def device(sampled: np.ndarray) -> np.ndarray:
        """Stamps of a device that samples at these ticks and has a clock of its own."""
        jitter = np.clip(parameters.stamp_jitter_s * rng.standard_normal(len(sampled)), -dt, dt)
        jitter[[0, -1]] = 0.0
        return robot[sampled] + np.round(jitter * 1e9).astype(np.int64)

    noise = np.radians(parameters.motion_capture_deg) * rng.standard_normal((len(slow), 3))
    seen = quaternion.product(quaternion.from_rotation_vector(noise), log.tool_to_board[slow])
    streams = [
        Stream("/hand/pose", "pose", robot, np.hstack([log.position, log.orientation])),
        Stream("/joints/positions", "joint_positions", robot[slow], log.joint_positions[slow]),
        Stream("/joints/velocities", "joint_velocities", robot[slow], log.joint_velocities[slow]),
        Stream("/joints/torques", "joint_torques", robot[slow], log.joint_torques[slow]),
        Stream("/wrist/wrench", "wrench", robot, log.wrench),
    ]
    streams += [
        Stream(f"/fingers/{finger}", "tactile", device(log.count_ticks), counts)
        for finger, counts in zip(FINGERS, np.hsplit(log.counts, len(FINGERS)), strict=True)
    ]
    streams.append(Stream("/motion_capture/tool_to_board", "tool_to_board", device(slow), seen))
    return Recording(name, tuple(streams), segments, origin)


def provenance(what: str, setting_deg: float, seed: str) -> dict[str, str]:
    """Provenance of a simulated run: what it was, on a board of which roll in degrees, from which seed."""
    return {
        "origin": "simulated",
        "generator": "structlearn.testbeds.scraping.protocol.executions",
        "version": structlearn.__version__,
        "seed": seed,
        "setting": f"board roll {setting_deg:g} degrees",
        "what": what,
    }
