"""Forms of training and their limits: what evaluations need to know without the training itself."""

from typing import Literal, get_args

from pydantic import Field

from structlearn.core.params import Parameters

Form = Literal["chosen", "plain"]
FORMS: tuple[Form, ...] = get_args(Form)
CHOSEN, PLAIN = FORMS

PART = "part"
"""Motion of the first part of `IDEAL`'s, to learn from less data."""


class EpochLimits(Parameters):
    """Largest number of epochs, for all kinds and forms."""

    simulation: int = Field(ge=1)
    robot: int = Field(ge=1)
