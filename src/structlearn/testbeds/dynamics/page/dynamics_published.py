"""Numbers on learned dynamics as the dissertation prints them (tables III.1 and III.2, section III.4.2.1)."""

from collections.abc import Mapping
from typing import NamedTuple

from structlearn.rigid_body.model_names import DEFAULT, GROUND_TRUTH


class Printed(NamedTuple):
    """A row of table III.1 or III.2: texts as printed, `mean ± std` where there is a spread."""

    epochs: str
    sine_position: str
    sine_velocity: str
    reach_position: str
    reach_velocity: str


_TRUTH = ("0.000", "0.000", "0.005 ± 0.006", "0.008 ± 0.010")

SIMULATION: Mapping[str, Printed] = {
    GROUND_TRUTH: Printed("", *_TRUTH),
    "mlp": Printed("23 ± 3", "0.000", "0.001", "0.256 ± 0.405", "5.542 ± 6.980"),
    "delan": Printed("58 ± 19", "0.000", "0.001", "0.016 ± 0.008", "0.254 ± 0.278"),
    "nostr": Printed("61 ± 53", "0.000", "0.005 ± 0.006", "0.005 ± 0.006", "0.037 ± 0.057"),
    "symm": Printed("8 ± 4", "0.000", "0.000", "0.005 ± 0.006", "0.011 ± 0.011"),
    "spd": Printed("2 ± 1", *_TRUTH),
    "tri": Printed("2 ± 1", *_TRUTH),
    "cov": Printed("2 ± 1", *_TRUTH),
}
"""Table III.1 by model, 5 seeds. The signs between means and stds are lost in the text at hand (`5819`)."""

ROBOT: Mapping[str, Printed] = {
    DEFAULT: Printed("", "0.001", "0.009", "0.000", "0.016"),
    "mlp": Printed("2", "0.000", "0.011", "0.003", "0.513"),
    "delan": Printed("4", "0.001", "0.013", "unstable", "unstable"),
    "symm": Printed("3", "0.001", "0.012", "0.000", "0.013"),
    "spd": Printed("3", "0.001", "0.013", "0.000", "0.014"),
    "tri": Printed("2", "0.001", "0.013", "0.000", "0.012"),
    "cov": Printed("2", "0.001", "0.012", "0.000", "0.015"),
}
"""Table III.2 by model, one run each on the real robot."""

ROBOT_NMSE: Mapping[str, str] = {
    DEFAULT: "0.74",
    "mlp": "< 0.1",
    "delan": "< 0.1",
    **dict.fromkeys(("symm", "spd", "tri", "cov"), "0.35"),
}
"""Training NMSE on the real robot, mean over the joints."""

DEFAULT_OVER_STRUCTURED = 0.74 / 0.35
"""By which factor structured models are better than the default one on the real robot's log."""

NETWORK_NMSE = 0.1
"""Below it MLP and DeLaN are on the real robot's log."""
