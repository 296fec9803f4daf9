"""Colours can be seen: on white, on the recordings' ground, and as a dark page shows them."""

import numpy as np
import pytest
from committed import ROOT

from structlearn.palette import BAD, BLACK, COLOUR_NAMES, GOOD, OURS, PUBLISHED, WHITE, WITHOUT
from structlearn.viewer import views

STYLE = (ROOT / "src/structlearn/reporting/templates/style.css").read_text()
DARK = STYLE[STYLE.index("prefers-color-scheme: dark") :]
HUES_TURNED = np.array([[-0.574, 1.43, 0.144], [0.426, 0.43, 0.144], [0.426, 1.43, -0.856]])
"""`hue-rotate(180deg)` on sRGB values, as the standard of CSS filters defines it."""


def parts(code):
    return np.array([int(code[place : place + 2], 16) for place in (1, 3, 5)]) / 255.0


def luminance(colour):
    """Luminance above that of flare, as WCAG computes it."""
    linear = np.where(colour <= 0.03928, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    return linear @ [0.2126, 0.7152, 0.0722] + 0.05


@pytest.mark.parametrize("colour", COLOUR_NAMES, ids=COLOUR_NAMES.get)
def test_every_colour_can_be_seen(colour):
    """White is for the dark ground of recordings alone."""
    if colour != WHITE:
        assert luminance(np.ones(3)) / luminance(parts(colour)) >= 3.0
    assert luminance(parts(colour)) / luminance(parts("#" + bytes(views.GROUND).hex())) >= 3.0


@pytest.mark.parametrize("colour", [*(one for one in COLOUR_NAMES if one != WHITE), BLACK])
def test_a_dark_page_inverts_what_is_drawn_and_keeps_its_hues(colour):
    paper = parts(DARK.partition("--paper: ")[2][:7])
    turned = np.clip(HUES_TURNED @ (1.0 - parts(colour)), 0.0, 1.0)
    shown = 1.0 - (1.0 - turned) * (1.0 - paper)  # `mix-blend-mode: screen`
    assert "filter: invert(1) hue-rotate(180deg); mix-blend-mode: screen" in STYLE
    assert luminance(shown) / luminance(paper) >= 3.0
    if np.ptp(parts(colour)) > 0.1:  # not of greys
        assert np.argmax(shown) == np.argmax(parts(colour))


def test_every_meaning_has_a_colour_of_its_own():
    assert len({GOOD, BAD, WITHOUT, PUBLISHED, OURS}) == 5
