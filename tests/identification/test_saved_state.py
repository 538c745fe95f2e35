"""An estimator put to sleep goes on to the last bit, and a wrong or damaged file is named."""

import json

import numpy as np
import pytest
from known_systems import Truth, moving, structure

import identification as idn
from symheli.errors import InputError


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize(
    "way", [1.0, idn.forgetting.Variable(100, 20), idn.forgetting.Directional(0.97)], ids=str
)
def test_a_saved_estimator_goes_on_as_if_nothing_had_happened(tmp_path, way, precision):
    truth = Truth(structure(outputs=("a", "b"), offset=True))
    rls = idn.RecursiveLeastSquares(truth.arx, way, precision=precision)
    record = truth.record(moving(160), noise=0.1)
    rows = np.column_stack([record["a"], record["b"], record["u"], record["p"]])
    whole, first = rls.online(), rls.online()
    whole.run(rows, history=False)
    first.run(rows[:80], history=False)
    rls.save(first.state, tmp_path / "deep" / "state.json")
    again = idn.RecursiveLeastSquares(truth.arx, way, precision=precision)
    second = again.online(again.load(tmp_path / "deep" / "state.json"))
    second.run(rows[80:], history=False)
    np.testing.assert_array_equal(second.state.memory, whole.state.memory)
    assert [p.name for p in (tmp_path / "deep").iterdir()] == ["state.json"]


@pytest.fixture
def saved(tmp_path):
    truth = Truth(structure())
    rls = idn.RecursiveLeastSquares(truth.arx, 0.99)
    rls.save(rls.run(truth.record(moving(60))).state, tmp_path / "state.json")
    return rls, tmp_path / "state.json"


@pytest.mark.parametrize(
    ("other", "words"),
    [
        (idn.RecursiveLeastSquares(structure(na=3), 0.99), "structure, na is 2, expected 3"),
        (
            idn.RecursiveLeastSquares(structure(basis=idn.Polynomial(2, 0.0, 14.0)), 0.99),
            "basis is Polynomial",
        ),
        (
            idn.RecursiveLeastSquares(structure(offset=True), 0.99),
            "offset is the default, expected True",
        ),
        (idn.RecursiveLeastSquares(structure(), 0.98), "forgetting is Constant"),
        (
            idn.RecursiveLeastSquares(structure(), 0.99, precision="single"),
            "precision is float64, expected float32",
        ),
    ],
)
def test_a_state_of_another_estimator_is_refused(saved, other, words):
    with pytest.raises(InputError, match=words):
        other.load(saved[1])


def test_damaged_files_are_refused(saved):
    rls, path = saved
    text = path.read_text()
    content = json.loads(text)
    for broken, words in (
        (text[:-200], "not a whole file"),
        ("[]", "not a file of"),
        (json.dumps({**content, "schema": "x"}), "expected a file of"),
        (json.dumps({**content, "version": 99}), "version 99"),
        (
            json.dumps({**content, "memory": [*content["memory"][:-1], "0x1.8p+1"]}),
            "do not match their digest",
        ),
        (json.dumps({**content, "memory": None}), "do not match their digest"),
    ):
        path.write_text(broken)
        with pytest.raises(InputError, match=words):
            rls.load(path)
    with pytest.raises(InputError, match="No such file"):
        rls.load(path.with_name("none.json"))


def test_a_state_of_another_size_is_refused(saved):
    rls, path = saved
    with pytest.raises(InputError, match="another structure or precision"):
        idn.RecursiveLeastSquares(structure(na=3)).online(rls.load(path))
