"""Design of a trajectory for identifying an arm, within the limits of its URDF: `structlearn excite`.

The robot executes it before there are any logs, so this needs a URDF but no recordings. Writes to
`reports/excitation/NAME`: `trajectory.csv`, and a page with the check against the URDF and the gain over
random trajectories. Obstacles around the robot are not considered.
"""

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.core.artefacts import write_csv
from structlearn.core.errors import InputError
from structlearn.core.stage import stage_parameters
from structlearn.readers.urdf_file import urdf_path
from structlearn.reporting.document import Document, Source
from structlearn.reporting.figure_style import Drawing
from structlearn.reporting.findings import Findings
from structlearn.reporting.publishing import publish_report
from structlearn.rigid_body.arm_kinematics import Arm, LinkShapes, link_distances, read_collision_shapes
from structlearn.rigid_body.excitation import (
    DesignProblem,
    ExcitationParameters,
    design,
    design_problem,
    limited_motion,
    parameter_errors,
    random_series,
)
from structlearn.rigid_body.friction import FRICTIONS
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.robot import Robot, read_urdf
from structlearn.rigid_body.urdf import require_velocities
from structlearn.tasks import project
from structlearn.tasks.motion.motion_figures import gain_panel, share_panels
from structlearn.tasks.motion.parameters import MotionParameters
from structlearn.tasks.section import shown
from structlearn.tasks.task_entry import read_task
from structlearn.tasks.task_files import local_path

REPORTS = Path("reports/excitation")
SHRINKS = 0.93 ** np.arange(40)  # factors on ranges and amplitudes, tried until links are far enough apart
ALL_BUT = 1.0 - 1e-9  # largest amplitude, as a fraction of the feasible one, with a finite free parameter
NEAR_M = 0.1  # distance of hulls below which link meshes are compared
LOOKED_AT_HZ = 20.0  # sampling rate for link distances


class ExciteParameters(ExcitationParameters):
    """Design and comparison of trajectories."""

    clearance_m: float = Field(gt=0)
    compared: int = Field(ge=5)
    noise_share: float = Field(gt=0)
    draws: int = Field(ge=10)


def design_trajectory(task: str | None, urdf: str, locked: Sequence[str]) -> None:
    """Design and publish a trajectory for a task's robot, or a URDF with joints to lock; print a summary."""
    parameters = stage_parameters("excite", ExciteParameters, project.DEFAULTS)
    if task:
        urdf, locked = task_urdf(task)
    name = task or re.sub(r"[^a-z0-9_-]", "_", Path(urdf).stem.lower())
    path = urdf_path(str(local_path(urdf)))
    robot = read_urdf(path, locked)
    require_velocities(path, robot.tree)
    problem, shapes, links = space(robot, path, locked, parameters)
    optima = design(problem, parameters.starts, parameters.iterations, parameters.seed)
    times, motion = limited_motion(problem, clear(problem, optima[0], shapes, parameters), parameters.rate_hz)
    joints, gains = (
        joint_table(robot, problem, motion),
        gain_table(problem, shapes, times, motion, parameters),
    )
    facts = {"urdf": urdf, "name": name, "seconds": times[-1], "links": links, "samples": len(times)}
    facts["noise"] = 100 * parameters.noise_share
    words = ["--task", task] if task else ["--urdf", urdf, *(("--lock", *locked) if locked else ())]
    facts["command"] = shlex.join(["structlearn", "excite", *words])
    publish_excitation(REPORTS / name, facts, joints, gains, (times, motion), parameters)
    write_csv(trajectory_table(robot, times, motion), REPORTS / name / "trajectory.csv")
    gain, kept = gains["gain"].median(), " ".join(joints["kept"])
    print(f"{times[-1]:.1f} s, {len(times)} samples; limits kept by joints: {kept}; links: {links}")
    print(f"errors of base parameters are {gain:.2f} times smaller than after random trajectories")
    print(f"{REPORTS / name}/trajectory.csv, {REPORTS / name}/index.html")


def task_urdf(task: str) -> tuple[str, Sequence[str]]:
    """URDF and locked joints of a task's robot; its recordings need not exist."""
    entry = read_task(task)
    robot = entry if isinstance(entry, MotionParameters) else getattr(entry, "robot", None)
    if robot is None or robot.urdf is None:
        raise InputError(f"{project.ENTRIES}: {task}: names no robot")
    return robot.urdf, robot.locked_joints


def space(
    robot: Robot, urdf: Path, locked: Sequence[str], parameters: ExciteParameters
) -> tuple[DesignProblem, LinkShapes | None, str]:
    """Feasible motion: the largest part of the joints' ranges in which random motion keeps links apart.

    Returns the limits, shapes of the links if the URDF has any, and collision information as text.
    """
    problem = design_problem(robot, parameters, FRICTIONS["offset"])
    lower, upper = (np.clip(bound, -np.pi, np.pi) for bound in (robot.tree.lower, robot.tree.upper))
    try:
        shapes = read_collision_shapes(Arm(urdf, robot.tree, robot.model, 0), locked, 0.5 * (lower + upper))
    except InputError as error:
        return problem, None, f"not checked for collisions ({error})"
    for shrink in SHRINKS:
        smaller = replace(problem, reach=shrink * problem.reach)
        tried = random_series(smaller, parameters.compared, parameters.seed)
        if all(least_distance(smaller, free, shapes) >= parameters.clearance_m for free in tried):
            blind = f"; not watched: {', '.join(shapes.touching)}" if shapes.touching else ""
            words = f"{1e3 * parameters.clearance_m:g} mm apart or more, in {smaller.reach:.0%} of the ranges"
            return smaller, shapes, words + blind
    closer = f"links are closer than {parameters.clearance_m:g} m"
    raise InputError(f"{urdf}: {closer} where the joints' ranges end")


def clear(
    problem: DesignProblem, free: np.ndarray, shapes: LinkShapes | None, parameters: ExciteParameters
) -> np.ndarray:
    """Reduce amplitudes of the free parameters until all links keep their distance."""
    if shapes is None:
        return free
    smaller = free.copy()
    for shrink in SHRINKS:
        size = np.minimum(shrink / (1.0 + np.exp(-free[:, -1])), ALL_BUT)
        smaller[:, -1] = np.log(size / (1.0 - size))
        if least_distance(problem, smaller, shapes) >= parameters.clearance_m:
            return smaller
    raise InputError(f"links are closer than {parameters.clearance_m:g} m where the joints hardly move")


def least_distance(problem: DesignProblem, free: np.ndarray, shapes: LinkShapes) -> float:
    """Least distance between two links in m, exact below `NEAR_M`."""
    _, motion = limited_motion(problem, free, LOOKED_AT_HZ)
    return float(link_distances(shapes, motion.q, NEAR_M).min())


def joint_table(robot: Robot, problem: DesignProblem, motion: Motion) -> pd.DataFrame:
    """Used range, velocity and torque of every joint beside its limits, and whether all are kept."""
    tree, torque = robot.tree, np.abs(motion.torque).max(axis=0)
    least, most, fastest = motion.q.min(axis=0), motion.q.max(axis=0), np.abs(motion.qd).max(axis=0)
    kept = (
        (tree.lower <= least) & (most <= tree.upper) & (fastest <= tree.velocity) & (torque <= problem.effort)
    )
    columns = {"joint": tree.names, "lower": tree.lower, "least": least, "most": most, "upper": tree.upper}
    columns |= {"fastest": fastest, "velocity_limit": tree.velocity, "largest_torque_n_m": torque}
    columns |= {"torque_limit_n_m": problem.effort, "kept": np.where(kept, "yes", "no")}
    return pd.DataFrame(columns)


def gain_table(
    problem: DesignProblem,
    shapes: LinkShapes | None,
    times: np.ndarray,
    motion: Motion,
    parameters: ExciteParameters,
) -> pd.DataFrame:
    """Factors by which errors of base parameters are larger after random trajectories than after this one.

    Geometric means over the parameters, for logs of equal length with noise on the torques.
    """
    spread = np.where(np.isfinite(problem.effort), problem.effort, motion.torque.std(axis=0))
    draw = parameters.noise_share * spread, parameters.draws, parameters.seed
    own = parameter_errors(problem, motion, *draw) * np.sqrt(len(times))
    gains = []
    for free in random_series(problem, parameters.compared, parameters.seed + 1):
        others, other = limited_motion(problem, clear(problem, free, shapes, parameters), parameters.rate_hz)
        ratio = parameter_errors(problem, other, *draw) * np.sqrt(len(others)) / own
        gains.append(np.exp(np.log(ratio[: len(problem.theta)]).mean()))
    return pd.DataFrame({"random_trajectory": np.arange(1, len(gains) + 1), "gain": gains})


def trajectory_table(robot: Robot, times: np.ndarray, motion: Motion) -> pd.DataFrame:
    """`time_s`, then positions, velocities and accelerations of all joints, in rad (m if prismatic)."""
    columns = {"time_s": times}
    for name, values in (("position", motion.q), ("velocity", motion.qd), ("acceleration", motion.qdd)):
        columns |= {f"{name}_{joint}": values[:, place] for place, joint in enumerate(robot.tree.names)}
    return pd.DataFrame(columns)


def publish_excitation(
    folder: Path,
    facts: Mapping[str, object],
    joints: pd.DataFrame,
    gains: pd.DataFrame,
    moved: tuple[np.ndarray, Motion],
    parameters: ExciteParameters,
) -> None:
    """Publish the page with its figures and tables."""
    find, count = Findings("random trajectories"), len(gains)
    find.exact("gain_median", gains["gain"].median(), count, headline=True)
    find.exact("gain_least", gains["gain"].min(), count, headline=True)
    kept = int((joints["kept"] == "yes").sum())
    find.among("joints").exact("limits_kept", kept, len(joints), headline=True)
    page = Document(
        template="excite.html.jinja",
        package="structlearn.tasks.motion",
        facts={**facts, **find.numbers(), "compared": count},
        tables={"joints": shown(joints), "gains": shown(gains)},
        sources={"trajectory": Source(f"{folder}/trajectory.csv", "")},
        command=str(facts["command"]),
        parameters={"excite": parameters},
        simulated=True,
    )
    drawn: dict[str, Drawing | Sequence[Drawing]] = {
        "trajectory": share_panels(joints, *moved),
        "gains": gain_panel(gains),
    }
    publish_report(folder, {"index": page}, drawn, page.tables, find)
