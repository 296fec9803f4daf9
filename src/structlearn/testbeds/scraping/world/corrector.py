"""A simulated person who turns the robot's hand until the tool lies flat on the tilted board (IV.9.1.3, iii).

The robot executes the nominal movement and gives way about roll; the person sees the gap between edge and
board, holds the hand and turns it. People do not track such an error continuously: they see it late, decide,
and add short overlapping submovements of minimum jerk until it looks flat (Woodworth 1899; Craik 1947; Meyer
et al. 1988; for knobs turned by hand Novak, Miller & Houk 2002). The model is that loop:

    at most every `refractory_s`: the error seen `visual_delay_s` ago, less what submovements under way and
    the robot's own nominal movement, which the person knows, will do about it; if that is larger than
    `threshold_deg`: a submovement of (gain x error)(1 + noise), of duration `movement_s`

The person goes along with the nominal movement and adds the submovements to it. The hand is held through the
passive stiffness of a wrist, so what the board does to the tool counts too. Constants are published figures
of people, named below, and times of the recorded corrected demonstrations; none was chosen by how well
feedback models do.
"""

from dataclasses import dataclass

import numpy as np
from pydantic import Field

from structlearn.ground import minimum_jerk
from structlearn.ground.params import Parameters
from structlearn.simulation.hand_noise import hand_noise


class CorrectorParameters(Parameters):
    """The person; units in the names.

    Attributes:
        reaction_s: from the start of the second primitive to the first submovement; in the recorded
            corrected demonstrations (public data `clmc`, scraping setting 2, mean of 15) the hand begins to
            turn at 0.45 s. A simple visual reaction takes 0.2 s, deciding about 0.1 s more.
        reaction_spread_s: its std between trials; reaction times vary by a fifth to a quarter.
        visual_delay_s: of the error in later submovements (visual corrections take 0.10-0.20 s: Saunders &
            Knill 2003).
        refractory_s: shortest time between two submovements (psychological refractory period, Vince 1948).
        refractory_spread_s: std of what is added to it, one-sided.
        threshold_deg: error that is let be; at 0.8 degrees one end of the 11 mm edge is 0.15 mm off.
        bias_deg: std between trials of what looks flat; recorded: 0.45 degrees at the end of the primitive.
        gain: mean share of the error that a submovement aims at; the first falls short as a rule (Meyer et
            al. 1988).
        gain_spread: its std between submovements: with the noise below one in six overshoots.
        noise: std of a submovement's amplitude, relative (van Beers, Haggard & Wolpert 2004: 5-10 %).
        movement_s: mean duration of a submovement; the recorded correction takes 0.8 s (knobs that are
            turned alone take 0.3-0.6 s: Novak, Miller & Houk 2002).
        movement_spread_s: its std.
        stiffness_n_m_rad: of the wrist that holds the hand (Formica et al. 2012: 0.7-1.7 N m/rad passive).
        damping_n_m_s_rad: its damping, about 0.1 s times the stiffness.
        noise_mm: sway, motor noise and tremor of the hand; a tenth of a free hand's, for it rests on a robot
            that gives way slowly: in the recorded execution of the same setting the hand's orientation stays
            within 0.02 degrees (std over 2 s) once it is corrected.
    """

    reaction_s: float = Field(ge=0)
    reaction_spread_s: float = Field(ge=0)
    visual_delay_s: float = Field(ge=0)
    refractory_s: float = Field(ge=0.05)
    refractory_spread_s: float = Field(ge=0)
    threshold_deg: float = Field(ge=0)
    bias_deg: float = Field(ge=0)
    gain: float = Field(gt=0)
    gain_spread: float = Field(ge=0)
    noise: float = Field(ge=0)
    movement_s: float = Field(gt=0)
    movement_spread_s: float = Field(ge=0)
    stiffness_n_m_rad: float = Field(gt=0)
    damping_n_m_s_rad: float = Field(ge=0)
    noise_mm: float = Field(ge=0)


@dataclass
class _Submovement:
    onset: float  # s
    duration: float  # s
    amplitude: float  # rad


class Corrector:
    """One trial of the person; asked once per control tick."""

    def __init__(
        self, parameters: CorrectorParameters, ticks: int, dt: float, rng: np.random.Generator
    ) -> None:
        """Draw the trial.

        Args:
            parameters: see there.
            ticks: of the whole run.
            dt: s per tick.
            rng: of this trial.
        """
        self._own, self._dt, self._rng = parameters, dt, rng
        self._bias = np.radians(parameters.bias_deg) * rng.standard_normal()
        self._reaction = max(
            parameters.reaction_s + parameters.reaction_spread_s * rng.standard_normal(), 0.1
        )
        slow = np.full((ticks, 3), 0.01)  # m/s; the hand hardly travels, motor noise stays what it is
        noise = hand_noise(slow, np.zeros(ticks), parameters.noise_mm, 1.0 / dt, rng)[1]
        self._noise = noise[:, 1]  # rad about the scraping direction
        self._remaining = np.zeros(ticks)  # rad, what is left for the person, as seen at every tick so far
        self._next: float | None = None  # s, time of the next decision
        self._submovements: list[_Submovement] = []
        self._first: int | None = None

    def torque(
        self, tick: int, error: float, nominal: tuple[float, float], hand: tuple[float, float]
    ) -> float:
        """Torque of the person on the hand about roll.

        Args:
            tick: number of the control tick; correction begins with the first call.
            error: rad, roll that the tool lacks to lie flat.
            nominal: roll in rad and its rate in rad/s that the nominal movement has at this tick; in the end
                its roll is 0.
            hand: roll of the hand in rad and its rate in rad/s.

        Returns:
            N m.
        """
        now = tick * self._dt
        self._remaining[tick] = error + self._bias + nominal[0]  # the robot itself will do -nominal
        if self._first is None:
            self._first, self._next = tick, now + self._reaction
        if now >= self._next:
            self._decide(tick, now)
        intended, rate = self._intended(now)
        target = nominal[0] + intended + self._noise[tick] - self._noise[self._first]
        stretch, pull = target - hand[0], nominal[1] + rate - hand[1]
        return self._own.stiffness_n_m_rad * stretch + self._own.damping_n_m_s_rad * pull

    def _decide(self, tick: int, now: float) -> None:
        """Start a submovement if what was seen, less what is under way, is worth it."""
        own, rng = self._own, self._rng
        seen_tick = max(tick - round(own.visual_delay_s / self._dt), self._first)
        under_way = self._intended(np.inf)[0] - self._intended(seen_tick * self._dt)[0]
        error = self._remaining[seen_tick] - under_way
        if abs(error) > np.radians(own.threshold_deg):
            gain = own.gain + own.gain_spread * rng.standard_normal()
            amplitude = gain * error * (1.0 + own.noise * rng.standard_normal())
            duration = max(own.movement_s + own.movement_spread_s * rng.standard_normal(), 0.2)
            self._submovements.append(_Submovement(now, duration, amplitude))
        self._next = now + own.refractory_s + abs(own.refractory_spread_s * rng.standard_normal())

    def _intended(self, now: float) -> tuple[float, float]:
        """Sum of the submovements at a time in s: roll of the hand in rad, and its rate."""
        roll = rate = 0.0
        for movement in self._submovements:
            s = min(max((now - movement.onset) / movement.duration, 0.0), 1.0)
            roll += movement.amplitude * minimum_jerk.progress(s)
            rate += movement.amplitude * minimum_jerk.rate(s) / movement.duration
        return roll, rate
