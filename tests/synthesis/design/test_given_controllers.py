"""Controllers that were made elsewhere, as the object that every design returns."""

import numpy as np
import pytest

import symheli
import synthesis
from symheli import LinearModel
from symheli.errors import InputError, UnknownNameError


def roll(measurements=("phi", "p")):
    """phi'' = -8 phi' + 120 d_lat + gust, both measured."""
    model = LinearModel(
        [[-8.0, 0.0], [1.0, 0.0]],
        [[120.0, 1.0], [0.0, 0.0]],
        np.eye(2),
        np.zeros((2, 2)),
        ("p", "phi"),
        ("d_lat", "gust"),
        ("p", "phi"),
    )
    return synthesis.Plant(model, ["gust"], ["phi", "d_lat"], ["d_lat"], measurements)


def test_pd_by_stated_gains_places_the_poles_of_its_closed_form():
    """d_lat = -kp phi - kd p: s^2 + (8 + 120 kd) s + 120 kp; with the derivative filtered at c and
    phi alone measured, (s^2 + 8 s)(s + c) + 120 (kp (s + c) + kd c s).
    """
    kp, kd, c = 0.1, 0.01, 60.0
    plain = synthesis.Controller.of(roll(), {("d_lat", "phi"): -kp, ("d_lat", "p"): -kd}, "PD")
    np.testing.assert_allclose(
        sorted(plain.closed().at(0.0).poles()), sorted(np.roots([1, 8 + 120 * kd, 120 * kp]))
    )
    plant = roll(["phi"])
    pd = synthesis.structures.TunableController.pid(plant, {("d_lat", "phi"): "PD"}, corner=c)
    gains = dict(zip([g.name for g in pd.gains], (-kp, -kd), strict=True))
    assert list(gains) == ["d_lat_phi_P", "d_lat_phi_D"]
    made = synthesis.Controller.of(plant, pd.controller(gains, plant.parameters), "PD")
    wanted = np.roots(
        np.polyadd(np.polymul([1, 8, 0], [1, c]), 120 * np.array([kp + kd * c, kp * c]))
    )
    np.testing.assert_allclose(
        np.sort_complex(made.closed().at(0.0).poles()), np.sort_complex(wanted)
    )
    proof = made.certify(search=None)
    assert proof.verified
    assert proof.gamma == pytest.approx(synthesis.frozen_gain(made.closed()).gain, rel=1e-2)
    hover = symheli.AirspeedSchedule((2.0,), (1.0,), (0.0,), lead=0.2)
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    assert np.abs(symheli.fly(heli, hover, controller=made.discretize(0.02))["phi"]).max() < 0.2


def test_a_point_design_flies_and_is_certified_as_a_schedule_is():
    plant = roll().with_noise({"phi": 0.01, "p": 0.05})
    best = synthesis.hinf(plant.model.at(0.0), plant.controls, plant.measurements)
    made = synthesis.Controller.of(plant, best.controller, "H-infinity")
    assert made.certify(search=None).gamma == pytest.approx(best.hinf_norm, rel=1e-2)


def test_what_is_no_controller_of_the_plant_is_refused():
    with pytest.raises(UnknownNameError, match="unknown output"):
        synthesis.Controller.of(roll(["phi"]), {("d_lat", "p"): 1.0})
    with pytest.raises(InputError, match="expected"):
        synthesis.Controller.of(roll(), "PD")
