"""A model with known kinematics comes back to the last bit, and MATLAB can step it."""

import json
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from known_vehicles import CONTROLS, STATES, Vehicle
from scipy.io import loadmat

import identification as idn
from identification.model import saved_kinematic_model
from symheli import lpv
from symheli.errors import InputError
from symheli.values import plain_file

OWN = lpv.UserFunctions((np.ones_like, np.cos), 0.0, 10.0, ("1", "cos p"))


@pytest.fixture(scope="module")
def vehicle():
    return Vehicle(degree=2, na={"p": 2}, nb={"d_lon": 1, "d_lat": 2, "d_col": 1, "d_ped": 3})


@pytest.fixture(scope="module")
def flight(vehicle):
    return vehicle.record(500, sensors=np.full(8, 1e-3))


@pytest.fixture(scope="module")
def model(vehicle, flight):
    return idn.fit(vehicle.kin, flight)


@pytest.mark.slow
def test_it_comes_back_to_the_last_bit(model, flight, tmp_path):
    n = model.structure.n_regressors
    covariance = np.arange(36.0 * n * n).reshape(6, n, 6, n) / 7
    model = replace(model, aerodynamics=replace(model.aerodynamics, covariance=covariance))
    back = idn.model.KinematicModel.load(model.save(tmp_path / "folder" / "m.json"))
    assert back.structure == model.structure
    for name in ("theta", "trim", "covariance"):
        np.testing.assert_array_equal(getattr(back, name), getattr(model, name))
    assert (back.inputs, back.parameters, back.dt, back.method) == (
        model.inputs,
        model.parameters,
        model.dt,
        model.method,
    )
    np.testing.assert_array_equal(back.simulate(flight), model.simulate(flight))


@pytest.mark.slow
def test_a_covariance_under_its_name_of_before_is_read(model, tmp_path):
    path = model.save(tmp_path / "m.json")
    content = plain_file.read(path, saved_kinematic_model.SCHEMA)
    content["coefficient_covariance"], content["covariance"] = content["covariance"], None
    plain_file.write(path, saved_kinematic_model.SCHEMA, content)
    np.testing.assert_array_equal(idn.model.KinematicModel.load(path).covariance, model.covariance)
    content["coefficient_covariance"] = None
    plain_file.write(path, saved_kinematic_model.SCHEMA, content)
    assert idn.model.KinematicModel.load(path).covariance is None


def test_functions_brought_along_must_be_brought_again(flight, tmp_path):
    kin = idn.KinematicARX(CONTROLS, "airspeed_command", basis=OWN)
    path = idn.fit(kin, flight).save(tmp_path / "m.json")
    with pytest.raises(InputError, match="give the basis"):
        idn.model.KinematicModel.load(path)
    assert idn.model.KinematicModel.load(path, basis=OWN).structure.basis == OWN


@pytest.mark.slow
def test_another_kind_of_file_is_refused(model, flight, tmp_path):
    path = model.save(tmp_path / "m.json")
    with pytest.raises(InputError, match="expected a file of 'symheli LPV-ARX model'"):
        idn.model.LPVARXModel.load(path)
    with pytest.raises(InputError, match="expected a file of 'symheli model with known"):
        idn.model.KinematicModel.load(model.aerodynamics.save(tmp_path / "a.json"))
    content = json.loads(path.read_text())
    content["trim"][0][0] += 1.0
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match="does not match its digest"):
        idn.model.KinematicModel.load(path)


def test_the_matlab_file_steps_as_the_model_does(model, flight, tmp_path):
    """The formula of its readme, from nothing but the file: the equation of one step holds."""
    file = loadmat(model.save_mat(tmp_path / "m.mat"), simplify_cells=True)
    assert list(file["outputs"]) == list(STATES)
    assert list(file["inputs_units"]) == ["rad"] * 4
    y, u, p, k = flight.columns(STATES), flight.columns(CONTROLS), flight["airspeed_command"], 50
    np.testing.assert_allclose(
        file["trim"] @ p[k] ** file["powers"],
        model.structure.basis(p[k : k + 1])[0] @ model.trim,
        rtol=1e-12,
    )
    f = p[k] ** file["powers"]
    added = file["c"] @ f + file["d"] @ f * (p[k] - p[k - 1])
    for i in range(1, 4):
        added = added + file["A"][..., i - 1] @ f @ y[k - i, :6] if i < 3 else added
        added = added + file["B"][..., i - 1] @ f @ u[k - i]
    expected = model.aerodynamics.predict(model.structure.aerodynamics.prepared(flight), 1)[k]
    np.testing.assert_allclose(added, expected, atol=1e-12)


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="no Octave")
def test_octave_reads_the_file(model, tmp_path):
    model.save_mat(tmp_path / "m.mat")
    (tmp_path / "check.m").write_text(
        'm = load("m.mat"); assert(size(m.A, 1) == 6); assert(size(m.trim, 1) == 8);'
        f' assert(abs(m.dt - {model.dt}) < eps); assert(strcmp(m.outputs{{1}}, "u")); disp("ok")'
    )
    done = subprocess.run(
        ["octave-cli", "--norc", "check.m"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.stdout.strip() == "ok", done.stderr
