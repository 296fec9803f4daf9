"""The sines that are scored, for tests of the dynamics testbed."""

from typing import Any

from committed import committed

from structlearn.testbeds.dynamics.world.arm_motion import ArmMotionParameters, SineParameters


def committed_motion(**changes: Any) -> SineParameters:
    """They as they stand in `params.yaml`, with changes."""
    return committed(ArmMotionParameters, "arm_motion", test=changes).used
