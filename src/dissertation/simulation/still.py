"""Still images of simulated scenes by PyBullet's software renderer, deterministic on one machine."""

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

SIZE = (1000, 620)  # pixels of the image
OVERSAMPLING = 2  # for smooth edges
FIELD_OF_VIEW_DEG = 32.0


@dataclass(frozen=True)
class Solid:
    """A solid in the scene."""

    kind: str  # `box`, `sphere` or `cylinder`
    size_m: Sequence[float] | np.ndarray  # half extents (3,); radius (1,); radius and length (2,)
    position: Sequence[float] | np.ndarray  # (3,) m
    orientation: Sequence[float] | np.ndarray = (1.0, 0.0, 0.0, 0.0)  # (4,) w, x, y, z
    colour: Sequence[float] = (0.7, 0.7, 0.72, 1.0)  # red, green, blue, opacity from 0 to 1


@dataclass(frozen=True)
class Sheet:
    """A curved surface in the scene, visible from outside only."""

    points: np.ndarray  # (A, B, 3) m, on a grid; seen from outside, B points to the left of A
    normals: np.ndarray  # (A, B, 3) unit, outwards
    colour: Sequence[float]  # red, green, blue, opacity from 0 to 1


@dataclass(frozen=True)
class View:
    """Camera: target point (m), distance (m), yaw and pitch in degrees."""

    target: Sequence[float]
    distance: float
    yaw_deg: float
    pitch_deg: float


def still(
    view: View,
    solids: Sequence[Solid] = (),
    urdf: str = "",
    angles: Sequence[float] = (),
    sheets: Sequence[Sheet] = (),
    size: tuple[int, int] = SIZE,
) -> np.ndarray:
    """Render a scene as an image (H, W, 3) uint8.

    `urdf`: of a robot, a path or a file of pybullet_data, or empty; `angles` (J,): of its movable joints in
    rad, in URDF order; `size`: (W, H) pixels.
    """
    with _muted():  # PyBullet prints its build time and arguments
        import pybullet
        import pybullet_data
        from pybullet_utils.bullet_client import BulletClient

        client = BulletClient(pybullet.DIRECT)
    try:
        client.setAdditionalSearchPath(pybullet_data.getDataPath())
        for solid in solids:
            _add(client, solid)
        for sheet in sheets:
            _add_sheet(client, sheet)
        if urdf:
            robot = client.loadURDF(urdf, useFixedBase=True)
            kinds = [client.getJointInfo(robot, one)[2] for one in range(client.getNumJoints(robot))]
            movable = [joint for joint, kind in enumerate(kinds) if kind != client.JOINT_FIXED]
            for joint, angle in zip(movable, angles, strict=False):
                client.resetJointState(robot, joint, float(angle))
        return _drawn(client, view, size)
    finally:
        client.disconnect()


@contextmanager
def _muted() -> Iterator[None]:
    """Suppress output of C code."""
    sys.stdout.flush()
    nowhere, kept = os.open(os.devnull, os.O_WRONLY), {stream: os.dup(stream) for stream in (1, 2)}
    for stream in kept:
        os.dup2(nowhere, stream)
    try:
        yield
    finally:
        for stream, copy in kept.items():
            os.dup2(copy, stream)
            os.close(copy)
        os.close(nowhere)


def _add(client: Any, solid: Solid) -> None:
    size = list(map(float, solid.size_m))
    sizes = {
        "box": {"shapeType": client.GEOM_BOX, "halfExtents": size},
        "sphere": {"shapeType": client.GEOM_SPHERE, "radius": size[0]},
        "cylinder": {"shapeType": client.GEOM_CYLINDER, "radius": size[0], "length": size[-1]},
    }
    shape = client.createVisualShape(**sizes[solid.kind], rgbaColor=list(solid.colour))
    w, *vector = map(float, solid.orientation)
    client.createMultiBody(
        baseVisualShapeIndex=shape,
        basePosition=list(map(float, solid.position)),
        baseOrientation=[*vector, w],  # PyBullet's quaternions are scalar-last
    )


def _add_sheet(client: Any, sheet: Sheet) -> None:
    number = np.arange(sheet.points[..., 0].size).reshape(sheet.points.shape[:2])
    corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    triangles = np.stack([corners[place] for place in (0, 1, 2, 0, 2, 3)], axis=-1)
    shape = client.createVisualShape(
        client.GEOM_MESH,
        vertices=sheet.points.reshape(-1, 3).tolist(),
        indices=triangles.ravel().tolist(),
        normals=sheet.normals.reshape(-1, 3).tolist(),
        rgbaColor=list(sheet.colour),
    )
    client.createMultiBody(baseVisualShapeIndex=shape)


def _drawn(client: Any, view: View, size: tuple[int, int]) -> np.ndarray:
    width, height = (OVERSAMPLING * pixels for pixels in size)
    camera = client.computeViewMatrixFromYawPitchRoll(
        list(view.target), view.distance, view.yaw_deg, view.pitch_deg, 0.0, 2
    )
    lens = client.computeProjectionMatrixFOV(FIELD_OF_VIEW_DEG, width / height, 0.05, 10.0)
    light = {"lightDirection": [1.0, -1.5, 3.0], "shadow": 1, "renderer": client.ER_TINY_RENDERER}
    _, _, colours, *_ = client.getCameraImage(width, height, camera, lens, **light)
    pixels = np.reshape(colours, (size[1], OVERSAMPLING, size[0], OVERSAMPLING, 4))[..., :3]
    return np.round(pixels.astype(float).mean(axis=(1, 3))).astype(np.uint8)
