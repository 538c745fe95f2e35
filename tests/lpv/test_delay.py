"""A delay as a linear model."""

from math import factorial

import numpy as np
import pytest

from symheli.errors import InputError
from symheli.lpv.tools import pade_delay


@pytest.mark.parametrize("order", [1, 2, 4, 7])
def test_a_delay_passes_every_amplitude_and_lags_by_omega_t(order):
    T = 0.02
    omega = np.linspace(0.1, 0.5 * order, 20) / T
    response = pade_delay("d_lat", T, order).frequency_response(omega)[:, 0, 0]
    np.testing.assert_allclose(np.abs(response), 1.0, rtol=1e-9)  # all-pass
    # the first neglected term of the phase: (n!)^2 (omega T)^(2n+1) / ((2n)! (2n+1)!) (Baker and
    # Graves-Morris, Pade Approximants)
    bound = (
        factorial(order) ** 2
        * (omega * T) ** (2 * order + 1)
        / (factorial(2 * order) * factorial(2 * order + 1))
    )
    assert np.all(np.abs(np.angle(response * np.exp(1j * omega * T))) < 1.5 * bound + 1e-10)


def test_names_follow_the_input_and_nonsense_is_refused():
    model = pade_delay("d_lat", 0.02)
    assert (model.inputs, model.outputs) == (("d_lat_command",), ("d_lat",))
    assert model.outputs[0].unit == "rad"
    with pytest.raises(InputError, match="delay > 0 s"):
        pade_delay("d_lat", 0.0)
