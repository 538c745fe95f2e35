"""A model written to a file comes back to the last bit, and nothing else passes for one."""

import json
from dataclasses import replace

import numpy as np
import pytest
from known_systems import Truth, moving, moving_box, structure
from scipy.io import loadmat

import identification as idn
from identification.model import saved_model
from symheli import lpv
from symheli.errors import InputError, SymheliError
from symheli.values import plain_file

OWN = lpv.UserFunctions((np.ones_like, np.cos), 0.0, 13.0, ("1", "cos p"))
CASES = {
    "one output": dict(),
    "orders by signal": dict(
        outputs=("a", "b"),
        inputs=("u", "v"),
        na={"a": {"a": 1, "b": 0}, "b": 2},
        nb={"u": 1, "v": 2},
        offset=True,
    ),
    "b-spline": dict(
        basis=lpv.BSpline(2, (0.0, 5.0, 13.0)), offset=True, offset_rate=True, scheduling_at="now"
    ),
    "spline": dict(basis=lpv.CubicSpline((0.0, 3.0, 8.0, 13.0))),
    "hats": dict(basis=lpv.PiecewiseLinear((0.0, 8.0, 13.0)), inputs=(), nb=0, offset=True),
    "brought along": dict(basis=OWN),
    "two parameters": dict(
        scheduling=("p", "q"),
        basis=lpv.Product((idn.Polynomial(1, 0.0, 13.0), idn.Polynomial(1, 0.9, 1.3)), 1),
        offset_rate=True,
    ),
}


def fitted(case, method="ls"):
    truth = Truth(structure(**CASES[case]))
    p = moving_box(400) if len(truth.arx.parameters) > 1 else moving(400)
    record = truth.record(p, noise=0.1, noise_seed=9)
    return idn.fit(truth.arx, record, method=method), record


@pytest.mark.parametrize("case", CASES)
def test_a_model_comes_back_to_the_last_bit(case, tmp_path):
    model, record = fitted(case)
    path = model.save(tmp_path / "folder" / "model.json")
    back = idn.model.LPVARXModel.load(path, basis=OWN if case == "brought along" else None)
    assert back.structure == model.structure
    assert (back.outputs, back.inputs, back.parameters) == (
        model.outputs,
        model.inputs,
        model.parameters,
    )
    for name in ("theta", "residual_covariance", "covariance"):
        np.testing.assert_array_equal(getattr(back, name), getattr(model, name))
    assert (back.dt, back.method, back.rows_used, back.rows_dropped) == (
        model.dt,
        model.method,
        model.rows_used,
        model.rows_dropped,
    )
    np.testing.assert_array_equal(back.simulate(record), model.simulate(record))


def test_units_details_and_covariance_travel_along(tmp_path):
    model, record = fitted("one output", "ridge")
    n = model.structure.n_regressors
    carried = replace(model, covariance=np.arange(n * n, dtype=float).reshape(1, n, 1, n) / 7)
    back = idn.model.LPVARXModel.load(carried.save(tmp_path / "b.json"))
    np.testing.assert_array_equal(back.covariance, carried.covariance)
    assert back.details == model.details
    in_knots = type(record).from_arrays(
        record.time, {"y": "deg", "u": "1", "p": "kt"}, y=record["y"], u=record["u"], p=record["p"]
    )
    with_units = idn.fit(structure(basis=idn.Polynomial(1, 0.0, 7.0)), in_knots)
    back = idn.model.LPVARXModel.load(with_units.save(tmp_path / "c.json"))
    assert (back.outputs[0].unit, back.parameters[0].unit) == ("rad", "m/s")


def test_an_earlier_covariance_an_equation_at_a_time_is_read_where_it_is_all(tmp_path):
    """With several outputs what was not kept between equations is unknown, and not zero."""
    for case in ("one output", "orders by signal"):
        model, record = fitted(case)
        path = model.save(tmp_path / "m.json")
        content = plain_file.read(path, saved_model.SCHEMA)
        content["covariance"] = np.einsum("yiyj->yij", model.covariance).tolist()
        plain_file.write(path, saved_model.SCHEMA, content)
        back = idn.model.LPVARXModel.load(path)
        if model.structure.ny == 1:
            np.testing.assert_array_equal(back.covariance, model.covariance)
        else:
            assert back.covariance is None
        np.testing.assert_array_equal(back.simulate(record), model.simulate(record))


def test_damaged_foreign_and_newer_files_are_refused_in_words(tmp_path):
    model, _ = fitted("one output")
    path = model.save(tmp_path / "model.json")
    whole = path.read_text()

    def refused(text, message, **options):
        path.write_text(text)
        with pytest.raises(InputError, match=message):
            idn.model.LPVARXModel.load(path, **options)

    refused(whole[: len(whole) // 2], "not a whole file.*take an older copy")
    content = json.loads(whole)
    refused(json.dumps({**content, "dt": 0.2}), "does not match its digest")
    refused(
        json.dumps({**content, "version": 99}), "version 99 of the format, this program reads 1"
    )
    refused(json.dumps({"theta": [1.0]}), "expected a file of 'symheli LPV-ARX model', got None")
    refused("[1, 2]", "got 'list'")
    refused(whole, "has another basis", basis=idn.Polynomial(1, 0.0, 13.0))
    with pytest.raises(InputError, match="No such file"):
        idn.model.LPVARXModel.load(tmp_path / "nothing.json")
    own, _ = fitted("brought along")
    with pytest.raises(
        InputError, match="the functions 1, cos p are not in the file; give the basis"
    ):
        idn.model.LPVARXModel.load(own.save(tmp_path / "own.json"))


def test_a_file_that_cannot_be_written_leaves_the_old_one(tmp_path):
    model, _ = fitted("one output")
    path = model.save(tmp_path / "model.json")
    before = path.read_bytes()
    unwritable = replace(model, details={"function": print})
    with pytest.raises(InputError, match="plain finite numbers"):
        unwritable.save(path)
    assert path.read_bytes() == before
    (tmp_path / "file").write_text("")
    with pytest.raises(SymheliError, match="cannot be written"):
        model.save(tmp_path / "file" / "model.json")


def test_the_matlab_file_predicts_what_the_model_predicts(tmp_path):
    """The formula of its readme, evaluated from nothing but the file."""
    model, record = fitted("orders by signal")
    file = loadmat(model.save_mat(tmp_path / "model.mat"), simplify_cells=True)
    assert list(file["outputs"]) == ["a", "b"]
    assert "y(k) = -sum_i A_i(p) y(k-i)" in file["readme"]
    y, u, p, k = record.columns(model.outputs), record.columns(model.inputs), record["p"], 50

    def at(M, lag):
        return M @ np.power(p[k - lag], file["powers"])

    expected = -sum(at(file["A"][:, :, :, i - 1], i) @ y[k - i] for i in file["output_lags"]) + at(
        file["c"], 1
    )
    expected = expected + sum(
        at(file["B"][:, :, :, j], lag) @ u[k - lag] for j, lag in enumerate(file["input_lags"])
    )
    np.testing.assert_allclose(model.predict(record, 1)[k], expected, atol=1e-11)


def test_a_model_is_reduced_through_its_exact_realization():
    model, _ = fitted("orders by signal")
    found = model.truncate(3)
    assert len(found.model.states) == 3
    assert found.model.dt == model.dt
    assert 0 < found.nu_gap.max() <= 1
