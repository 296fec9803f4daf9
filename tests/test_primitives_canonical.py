import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from primitives_movements import quick
from scipy.integrate import solve_ivp

from structlearn.primitives.canonical import ALPHA_U, phase, time_constant


@given(st.floats(0.05, 50.0))
@quick
def test_the_closed_form_solves_the_text_equations(duration):
    tau = time_constant(duration)

    def rates(_, state):
        p, u = state
        return [u / tau, ALPHA_U * (ALPHA_U / 4 * (0 - p) - u) / tau]  # eq. IV.4, IV.5

    times = np.linspace(0.0, 2 * duration, 40)
    solution = solve_ivp(rates, (0, times[-1]), [1.0, 0.0], "DOP853", times, rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(np.stack(phase(times, tau)), solution.y, atol=1e-9)


def test_the_phase_is_spent_when_the_movement_ends():
    p, u = phase(np.array([0.0, 3.0, 300.0]), time_constant(3.0))
    assert (p[0], u[0]) == (1.0, 0.0)
    assert p[1] == pytest.approx(0.0140, abs=5e-5)
    assert u[1] == pytest.approx(-0.151, abs=5e-4)
    assert p[2] == pytest.approx(0.0, abs=1e-100)
    assert u[2] == pytest.approx(0.0, abs=1e-100)


@given(st.floats(0.05, 50.0))
@quick
def test_only_the_fraction_of_the_movement_matters(duration):
    fraction = np.linspace(0.0, 3.0, 30)
    np.testing.assert_allclose(
        phase(fraction * duration, time_constant(duration)), phase(fraction, time_constant(1.0)), rtol=1e-12
    )


@pytest.mark.parametrize("duration", [0.0, -1.0, float("nan")])
def test_a_movement_needs_a_positive_duration(duration):
    with pytest.raises(ValueError, match=f"^duration must be positive, is {duration}$"):
        time_constant(duration)
