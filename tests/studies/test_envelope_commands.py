"""symheli envelope, derivatives, vehicles, and trim at an altitude, as a user types them."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

import symheli


@pytest.mark.slow
def test_envelope_shows_the_map_and_writes_table_and_figure(run, tmp_path, ideal):
    grid = ("--airspeeds", 0, 10, 3, "--climb-rates", -10, 10, 5, "--out", tmp_path / "deep")
    status, out, _ = run("envelope", *grid)
    assert status == 0
    assert "least power at climb rate 0 m/s" in out
    assert "vortex ring" in out
    rows = list(csv.reader((tmp_path / "deep" / "trim_map.csv").read_text().splitlines()))
    assert len(rows) == 2 + 9  # 1 hovering, 3 at 5 m/s, 5 at 10 m/s
    assert (tmp_path / "deep" / "trim_map.svg").read_text().startswith("<?xml")
    data = json.loads(run("envelope", *grid, "--json")[1])
    found = symheli.trim_map(ideal, data["airspeeds"], data["climb_rates"])
    assert data["vortex_ring"] == found.vortex_ring.tolist()
    assert data["values"]["power"][1][2] == pytest.approx(found["power"][1, 2], rel=1e-9)
    assert data["values"]["power"][0][0] == "nan"  # impossible: JSON has no NaN
    assert data["units"]["power"] == "W"


@pytest.mark.slow
def test_derivatives_prints_the_table_and_writes_it(run, tmp_path, ideal):
    status, out, _ = run("derivatives", "--airspeeds", 0, 8, 3, "--out", tmp_path)
    assert status == 0
    assert {"X_u", "L_b1", "N_ped"} <= {line.split(" ")[0] for line in out.splitlines()}
    assert (tmp_path / "derivatives.svg").is_file()
    data = json.loads(run("derivatives", "--airspeeds", 0, 8, 3, "--json")[1])
    table = symheli.derivatives(symheli.sweep(ideal, [0.0, 4.0, 8.0]))
    np.testing.assert_allclose(data["derivatives"]["M_q"], table["M_q"], atol=1e-12)
    assert data["units"]["M_q"] == "1/s"
    header, units = (tmp_path / "derivatives.csv").read_text().splitlines()[:2]
    assert header.split(",")[1] == "X_u"
    assert units.split(",")[1] == "1/s"


def test_wrong_ranges_are_wrong_usage(run):
    for wrong in (("5", "1", "3"), ("0", "5", "2.5"), ("0", "5", "0"), ("0", "nan", "3")):
        assert run("envelope", "--airspeeds", *wrong)[0] == 2
    status, _, err = run("envelope", "--airspeeds", "0", "1", "2", "--climb-rates", "5", "6", "2")
    assert status == 1
    assert "exceeds the largest airspeed" in err


def test_vehicles_say_how_much_is_assumed(run):
    out = run("vehicles")[1]
    assert "12 assumed: drivetrain.inertia" in out
    data = json.loads(run("vehicles", "--json")[1])
    assumed = {
        entry["name"]: len(entry["assumed"])
        for entry in data["vehicles"] + data["identified_models"]
    }
    assert assumed["xcell60"] == 0
    assert assumed["xcell_kahn_hudson"] == 12
    assert assumed["yamaha_r50"] == 43
    assert assumed["r50_hover"] == 4


def test_trim_takes_an_altitude(run, ideal):
    data = json.loads(run("trim", "--airspeed", "6", "--altitude", "2000", "--json")[1])
    assert data["inputs"]["d_col"]["value"] == pytest.approx(
        symheli.trim(ideal, 6.0, altitude=2000.0).u["d_col"], rel=1e-9
    )
    assert run("trim", "--altitude", "90000")[0] == 1


@pytest.mark.filterwarnings("ignore::symheli.errors.ValidityWarning")
def test_figures_draw_on_the_axes_they_are_given(ideal):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    found = symheli.trim_map(ideal, [0.0, 5.0, 28.0], [-5.0, 0.0, 5.0])
    assert not found.attainable[2].all()
    figure, (left, right) = plt.subplots(1, 2)
    assert found.plot(left, "theta") is left
    table = symheli.derivatives(symheli.sweep(ideal, [2.0, 5.0]))
    assert table.plot(right, ["M_q"]) is right
    assert "control at or beyond its stop" in [
        text.get_text() for text in left.get_legend().get_texts()
    ]
    plt.close(figure)
