"""Regions of frequency responses, and the bias of a structure in them."""

from dataclasses import replace

import numpy as np
import pytest
from known_vehicles import CONTROLS, STATES, Vehicle

import identification as idn
from identification.judge.response_regions import StructureBias
from symheli.errors import InputError

OMEGA = [0.5, 3.0]


@pytest.fixture(scope="module")
def vehicle():
    return Vehicle(na=1, nb=1)


@pytest.fixture(scope="module")
def record(vehicle):
    return vehicle.record(500, seed=1, process=1e-3)


@pytest.fixture(scope="module")
def model(vehicle, record):
    return idn.fit(vehicle.kin, record)


def exact(vehicle, record, *points):
    own = vehicle.model(record)
    return {p: own.at(p, outputs=STATES, inputs=CONTROLS) for p in points}


def test_a_vehicle_of_the_structure_has_no_bias(vehicle, record, model):
    """Without noise least squares finds its coefficients but for rounding; the trim of the exact
    models is that of another flight, and is what is left.
    """
    there = exact(vehicle, vehicle.record(500, seed=1), 3.0, 7.0)
    off = idn.judge.structure_bias(model, record, vehicle.without_noise(seed=1), there)
    off = off.responses(OMEGA, STATES, CONTROLS)
    size = np.abs(np.stack([m.frequency_response(OMEGA) for m in there.values()])).max()
    assert np.abs(off).max() < 1e-6 * size


def test_what_a_method_bridges_is_there_in_the_flight_of_the_bias(vehicle, record):
    """A log without some of its rows, identified by a method that bridges them and by one that does
    not.
    """
    clean = vehicle.without_noise(seed=1).flown(record)

    class Source:
        def flown(self, record):
            return clean.rows(np.rint(record.time / record.dt).astype(int))

    still = idn.KinematicARX(
        CONTROLS, "airspeed_command", na=1, nb=1, basis=idn.Polynomial(0, 0, 10)
    )
    lost = record.rows((np.arange(len(record)) + 50) % 100 > 8)
    there = exact(vehicle, record, 1.0)
    for method, alike in ((idn.methods.FilterError(Source()), True), ("ls", False)):
        model = idn.fit(still, lost, method)
        own = [
            idn.judge.structure_bias(model, of, Source(), there).model.theta
            for of in (lost, record)
        ]
        assert np.allclose(*own, rtol=1e-9, atol=0) == alike


def test_a_structure_of_too_low_a_degree_has_one(record):
    """Coefficients that move with p, identified as constants."""
    vehicle = Vehicle(na=1, nb=1)
    still = idn.KinematicARX(
        CONTROLS, "airspeed_command", na=1, nb=1, basis=idn.Polynomial(0, 0, 10)
    )
    model = idn.fit(still, record)
    there = exact(vehicle, record, 1.0)
    off = idn.judge.structure_bias(model, record, vehicle.without_noise(seed=1), there)
    off = off.responses(OMEGA, ["p"], ["d_lat"])
    own = there[1.0].select(inputs=["d_lat"], outputs=["p"]).frequency_response(OMEGA)
    assert np.abs(off[0] / own).min() > 0.02


def test_bias_widens_regions_by_its_power_and_moves_no_centre(model):
    points = [2.0, 5.0, 8.0]
    plain = idn.judge.response_regions(model, points, OMEGA, ["p"], ["d_lat"], draws=20)
    there = {p: model.at(p, outputs=["p"], inputs=["d_lat"]) for p in points}
    off = StructureBias(model, {p: replace(one, D=one.D + 0.5) for p, one in there.items()})
    wide = idn.judge.response_regions(model, points, OMEGA, ["p"], ["d_lat"], bias=off, draws=20)
    assert np.array_equal(wide.centre, plain.centre)
    assert wide.width**2 == pytest.approx(plain.width**2 + 0.25)
    assert wide.contains(wide.centre + 0.4 + 0.3j).all()


def test_regions_hold_draws_as_often_as_they_say(vehicle, model):
    regions = idn.judge.response_regions(model, [5.0], OMEGA, ["p"], ["d_lat"], draws=400)
    values, vectors = np.linalg.eigh(model.covariance.reshape(2 * (model.theta.size,)))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    rng, held = np.random.default_rng(3), []
    for _ in range(200):
        moved = (root @ rng.normal(size=model.theta.size)).reshape(6, -1).T
        one = model.with_theta(model.theta + moved).at(5.0, outputs=["p"], inputs=["d_lat"])
        held.append(regions.contains(one.frequency_response(OMEGA)[None]).mean())
    assert 0.9 < np.mean(held) < 0.99  # 200 draws: three deviations of .95 are .046


def test_what_is_missing_is_said(vehicle, record, model):
    with pytest.raises(InputError, match="no covariance"):
        idn.judge.response_regions(model.with_theta(model.theta), [5.0], OMEGA)
    with pytest.raises(InputError, match="at least one value"):
        idn.judge.response_regions(model, [], OMEGA)
    own = model.at(3.0)
    with pytest.raises(InputError, match="bias: expected"):
        idn.judge.response_regions(model, [5.0], OMEGA, bias=StructureBias(model, {3.0: own}))
    with pytest.raises(InputError, match="sampled every"):
        StructureBias(model, {3.0: replace(own, dt=2 * own.dt)})
    with pytest.raises(InputError, match="source of flights"):
        idn.judge.structure_bias(model, record, record, {3.0: own})


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_the_bound_of_the_nu_gap_holds_where_the_covariance_alone_does_not(seed):
    """Coefficients that move with p, identified as constants; the simulator is another vehicle."""
    own, other = (Vehicle(na=1, nb=1, seed=k) for k in (0, 1))
    record = own.record(1500, seed=seed, process=1e-3)
    still = idn.KinematicARX(
        CONTROLS, "airspeed_command", na=1, nb=1, basis=idn.Polynomial(0, 0, 10)
    )
    model = idn.fit(still, record)
    points = 1.0, 5.0, 9.0
    there = exact(other, other.record(500, seed=1), *points)
    found = idn.fit_for_control(
        model,
        record,
        {("d_lat", "phi"): -0.5, ("d_lon", "theta"): -0.6},
        scales={**dict.fromkeys(STATES, 1.0), **dict.fromkeys(CONTROLS, 0.1)},
        covariance=model.covariance,
        bias=idn.judge.structure_bias(model, record, other.without_noise(seed=seed), there),
        truth=exact(own, record, *points),
        draws=40,
    )
    # noise and structure add as errors of correlation one half, which is no strict bound: of the
    # six points one is short of the truth, by 2 %
    assert np.all(found.bound >= 0.95 * found.true_gap)
    assert np.mean(found.bound >= found.true_gap) > 0.6
    assert not np.all(found.gap >= found.true_gap)
