"""Flights of `evidence.flown`: what its trial counts, which disturbances its designs expect, and
its search.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

from evidence.flown import campaign, designs, tuning
from evidence.flown.__main__ import fly, ratios
from studies.controllers.designs import LQR, Design, lqr_schedule
from studies.controllers.flown import WINDS, measures, plan
from studies.controllers.plant import baseline
from symheli import Helicopter


@pytest.fixture(scope="module")
def ideal():
    return Helicopter.load(designs.VEHICLE, governor="ideal")


@pytest.fixture(scope="module")
def lqr(ideal):
    return lqr_schedule(ideal)


@pytest.fixture(scope="module")
def row(lqr):
    """Two flights of the LQR."""
    return campaign.trial_of({LQR: lqr}).run(controller=LQR, flights=2)


def test_a_case_flies_what_the_study_flies(row, lqr):
    heli = Helicopter.load(designs.VEHICLE, governor="pi")
    first = campaign.SEEDS_FROM
    found = measures(heli, [plan(lqr, WINDS[0])], [first, first + 1])
    assert row["energy ratio, median"] == np.median([m.ratio for m in found])
    assert row["speed error, worst"] == max(m.speed for m in found)


def test_a_flight_that_meets_every_entry_meets_each(row):
    met = [value for name, value in row.items() if name.endswith(", met")]
    assert len(met) == len(campaign.flown_entries(campaign.of_the_vehicle()))
    assert row["every entry met"] <= min(met)
    assert all(value in (0.0, 0.5, 1.0) for value in met)


def test_a_controller_of_the_wrong_sign_is_lost_and_meets_nothing(lqr):
    wrong = replace(lqr, D=-lqr.D)
    row = campaign.trial_of({"wrong": wrong}).run(controller="wrong", flights=1)
    assert row["lost"] == 1.0
    assert row["every entry met"] == 0.0
    assert "energy ratio, median" not in row


@pytest.mark.slow
def test_a_finished_campaign_flies_nothing_again(lqr, tmp_path, monkeypatch):
    """And a lost flight is no best energy ratio."""
    made = {name: Design(name=name, controller=lqr) for name in (LQR,)}
    for name, winds in (("WINDS", WINDS[:1]), ("BEYOND", (0.0,)), ("SIZES_OF_GUSTS", WINDS[:1])):
        monkeypatch.setattr(f"evidence.flown.__main__.{name}", winds)
    cases = fly(made, tmp_path / "c.zarr", 1)
    monkeypatch.setattr(campaign, "of_flights", None)
    again = fly(made, tmp_path / "c.zarr", 1)
    assert again.of(LQR, WINDS[0]) == cases.of(LQR, WINDS[0])
    assert f"**{cases.of(LQR, WINDS[0])['energy ratio, median']:.2f}**" in ratios(cases, [LQR])


def test_a_slow_disturbance_has_its_size_in_root_mean_square():
    one = designs.slow("u_w", 1.5, 8.0)
    variance = one.C @ solve_continuous_lyapunov(one.A, -one.B @ one.B.T) @ one.C.T
    assert variance[0, 0] == pytest.approx(1.5**2, rel=1e-12)


def test_a_plant_is_told_of_every_disturbance_once(ideal):
    model = baseline(ideal).with_trim_drift()
    plant = designs.plant_for_slow(model)
    own = {*designs.GUSTS, designs.DRIFT, *(f"{u}_disturbance" for u in designs.CONTROLS)}
    noise = {f"{y}_noise" for y in designs.MEASUREMENTS}
    assert {str(w) for w in plant.disturbances} == own | noise


def test_the_drift_of_airspeed_alone_is_that_of_u(ideal):
    """Of the trim, that moves otherwise by little."""
    base = baseline(ideal)
    exact, alone = base.with_trim_drift(), designs.with_drift_of_airspeed(base)
    for V in (0.0, 6.5, 13.0):
        u = exact.states.index("u")
        assert alone.at(V).B[u, -1] == pytest.approx(exact.at(V).B[u, -1], rel=0.04)


def test_a_search_begins_unchanged_and_keeps_the_best(ideal):
    heli = Helicopter.load(designs.VEHICLE, governor="pi")
    found = tuning.searched(
        lambda powers: designs.retuned(ideal, powers), heli, 2, [tuning.SEEDS[0]], WINDS[:1]
    )
    assert found[0].powers == (0.0,) * len(designs.LQR_GROUPS)
    assert found[0].objective == pytest.approx(np.log(found[0].ratios[0]))
    assert tuning.best(found).objective == min(e.objective for e in found)


def test_seeds_of_tuning_and_of_judging_are_apart():
    judging = range(campaign.SEEDS_FROM, campaign.SEEDS_FROM + campaign.FLIGHTS)
    assert not set(tuning.SEEDS) & set(judging)
