"""Situations on the board that runs differ by: another start, other goals, a knock on the hand."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import count

import numpy as np

from dissertation.scraping.protocol.executions import Bench, Run, execute_run
from dissertation.scraping.world import operational_space, scraping_robot, scraping_world
from dissertation.scraping.world.execution import Advance, Engine
from dissertation.scraping.world.operational_space import ArmModel
from dissertation.scraping.world.scraping_world import World
from structlearn.feedback.skill import ReactiveSkill
from structlearn.readers.clock import synchronise
from structlearn.readers.demonstration import Demonstration

Sense = Callable[[int, World, ArmModel], None]
"""Sees the world at a control tick before it moves on, and the arm as observed then."""


@dataclass(frozen=True)
class Situation:
    """What differs in a run from the primitives' own start and goals; base frame."""

    name: str = "as demonstrated"
    start: tuple[float, ...] = (0.0, 0.0, 0.0)  # m, shift of the start
    goal: tuple[float, ...] = (0.0, 0.0, 0.0)  # m, shift of all goals
    knock_n: tuple[float, ...] = (0.0, 0.0, 0.0)  # N on the hand
    knock_s: tuple[float, float] = (0.0, 0.0)  # s since the start of the run, from and to


UNMOVED = Situation()


def moved(skill: ReactiveSkill, situation: Situation) -> ReactiveSkill:
    """The skill with another start and goals; only reaches between them generalise, not what was fitted."""
    primitives = []
    for place, one in enumerate(skill.primitives):
        start = one.position.start + (situation.goal if place else situation.start)
        position = replace(one.position, start=start, goal=one.position.goal + situation.goal)
        primitives.append(replace(one, position=position))
    return replace(skill, primitives=primitives)


def execute_skill(run: Run, skill: ReactiveSkill, bench: Bench, situation: Situation) -> Demonstration:
    """One execution of the primitives, corrected or with feedback if the run says so.

    Raises FloatingPointError: the robot has diverged.
    """
    knocked = situation.knock_s[0] < situation.knock_s[1]
    engine = tick_by_tick(situation, bench.testbed.world.dt) if knocked else None
    recording = execute_run(run, 0, moved(skill, situation), bench.testbed, engine)
    return synchronise(recording, **bench.clock.model_dump())


def tick_by_tick(situation: Situation, dt: float, sense: Sense = lambda *_: None) -> Engine:
    """The compiled loop's motion, tick by tick of `dt` s, with the situation's knock on the hand."""

    @contextmanager
    def engine(world: World) -> Iterator[Advance]:
        arm = operational_space.controlled(scraping_robot.arm(), world.q[: scraping_robot.ARM_JOINTS])
        ticks = count()

        def advance(torques: np.ndarray) -> None:
            tick = next(ticks)
            operational_space.observe(arm, world.q, world.v)
            sense(tick, world, arm)
            if situation.knock_s[0] <= dt * tick < situation.knock_s[1]:
                torques = torques + arm.jacobian[:3].T @ situation.knock_n
            scraping_world.advance(world, torques)

        yield advance

    return engine
