"""Joint torques of the recorded slides beside the arm's URDF: their sign, and what the arm carries."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from structlearn.core.errors import InputError
from structlearn.readers.demonstration import Demonstration
from structlearn.rigid_body.motion import measured_motion
from structlearn.rigid_body.regressor import SYMMETRIC_COLUMNS, link_parameters, torque_regressor
from structlearn.rigid_body.tree import Robot

ARM = "kuka_iiwa/model.urdf"
"""The arm that the slides were recorded with, a file of pybullet_data."""

RATE_HZ = 10.0
"""Of the clock: the robot's streams drop out too often for more, and the motion is slow."""

CUTOFF_HZ = 4.0
"""Of the low-pass on all signals, below half that rate."""

PAYLOAD_COLUMNS = 4
"""Mass and first moment of the last link; the slides are too slow for rotational inertia."""


def torque_check(
    robot: Robot, demonstrations: Sequence[Demonstration], cutoff_hz: float
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Compare measured torques with the URDF's, under both signs, without and with a payload.

    The payload is fitted by least squares to all slides together. Contact forces (a few newtons) are left
    out.

    Returns:
        `sign` (1: as recorded, -1: turned round), `payload` (whether one was fitted), `joint` (from 1),
        `measured_n_m` and `model_n_m` (means; the measured one with its sign), `left_n_m` (root mean square
        of the difference). And per sign the payload: `mass_kg`, `centre_{x,y,z}_m` in the last joint's frame.

    Raises:
        InputError: a slide has no joint torques.
    """
    columns, torques = [], []
    for one in demonstrations:
        if one.joint_positions is None or one.joint_velocities is None or one.joint_torques is None:
            raise InputError(f"{one.name}: has no joint positions, velocities and torques")
        motion = measured_motion(
            one.name,
            one.time,
            one.joint_positions,
            one.joint_velocities,
            one.joint_torques,
            cutoff_hz=cutoff_hz,
        )
        columns.append(torque_regressor(robot.tree, motion.q, motion.qd, motion.qdd))
        torques.append(motion.torque)
    regressor, measured = np.concatenate(columns), np.concatenate(torques)
    model = regressor @ link_parameters(robot.inertias.tensors()).numpy()
    start = regressor.shape[-1] - SYMMETRIC_COLUMNS
    carried = regressor[..., start : start + PAYLOAD_COLUMNS]
    tables, payloads = [], []
    for sign in (1, -1):
        left = sign * measured - model
        payload, *_ = np.linalg.lstsq(carried.reshape(-1, PAYLOAD_COLUMNS), left.ravel(), rcond=None)
        mass, centre = payload[0], payload[1:] / payload[0]
        payloads.append((sign, mass, *centre))
        for fitted, torque in ((False, model), (True, model + carried @ payload)):
            tables.append(
                pd.DataFrame(
                    {
                        "sign": sign,
                        "payload": fitted,
                        "joint": np.arange(1, measured.shape[1] + 1),
                        "measured_n_m": sign * measured.mean(axis=0),
                        "model_n_m": torque.mean(axis=0),
                        "left_n_m": np.sqrt(((sign * measured - torque) ** 2).mean(axis=0)),
                    }
                )
            )
    names = ["sign", "mass_kg", "centre_x_m", "centre_y_m", "centre_z_m"]
    return pd.concat(tables, ignore_index=True), pd.DataFrame(payloads, columns=names)
