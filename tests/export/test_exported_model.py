"""An identified model as C compiles without a warning, freestanding, and predicts and simulates
what Python does.
"""

import shutil
import subprocess

import numpy as np
import pytest

import identification as idn
from identification.export import write_model
from studies.cli import main
from symheli import lpv
from symheli.errors import InputError
from symheli.values import Signal

CC = shutil.which("gcc") or shutil.which("clang") or shutil.which("cc")
STRICT = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")
CUBIC = idn.Polynomial(3, 0.0, 13.0)
BOX = lpv.Product(
    (lpv.BSpline(2, (0.0, 6.0, 13.0)), idn.Polynomial(1, 0.9, 1.3)), total_degree=None
)
STRUCTURES = {
    "lag": idn.LPVARX(
        ("a", "b"), ("c", "d"), "p", na=2, nb=2, delay=1, basis=CUBIC, offset=True, offset_rate=True
    ),
    "now, feedthrough": idn.LPVARX(
        ("a", "b"), ("c",), "p", na=3, nb=2, delay=0, basis=CUBIC, scheduling_at="now"
    ),
    "orders by signal": idn.LPVARX(
        ("a", "b"),
        ("c",),
        "p",
        na={"a": 1, "b": {"a": 0, "b": 2}},
        nb=1,
        delay=3,
        basis=lpv.CubicSpline((0.0, 1.0, 4.0, 9.0)),
    ),
    "no inputs": idn.LPVARX(
        "a", (), "p", na=2, nb=0, delay=0, basis=lpv.PiecewiseLinear((0.0, 3.0, 9.0)), offset=True
    ),
    "no past": idn.LPVARX("a", "c", "p", na=0, nb=1, delay=0, basis=CUBIC, scheduling_at="now"),
    "two parameters": idn.LPVARX(
        "a", "c", ("p", "s"), na=2, nb=1, delay=1, basis=BOX, offset_rate=True
    ),
}


def model_of(arx, seed=0):
    """Random coefficients, small enough to be stable at every p; a unit for every signal."""
    theta = (
        np.random.default_rng(seed).uniform(-0.3, 0.3, (arx.n_regressors, arx.ny))
        / arx.basis.size
        * arx.free
    )
    outputs, inputs, scheduling = (
        tuple(Signal(str(s), "rad") for s in group)
        for group in (arx.outputs, arx.inputs, arx.parameters)
    )
    return idn.model.LPVARXModel(
        structure=arx,
        theta=theta,
        dt=0.02,
        outputs=outputs,
        inputs=inputs,
        scheduling=scheduling,
        residual_covariance=np.eye(arx.ny),
        rows_used=100,
    )


def built(folder, name="model"):
    subprocess.run(
        [CC, *STRICT, "-ffreestanding", "-c", f"{name}.c", "-o", "m.o"], cwd=folder, check=True
    )
    subprocess.run(
        [CC, *STRICT, f"{name}_check.c", "m.o", "-lm", "-o", "check"], cwd=folder, check=True
    )
    return subprocess.run([str(folder / "check")], capture_output=True, text=True)


@pytest.mark.slow(only=("orders by signal-double", "orders by signal-single"))
@pytest.mark.skipif(CC is None, reason="no C compiler")
@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("case", STRUCTURES)
def test_the_c_model_predicts_and_runs_free_as_python_does(tmp_path, case, precision):
    write_model(model_of(STRUCTURES[case]), tmp_path, precision=precision)
    done = built(tmp_path)
    assert done.returncode == 0, done.stdout
    assert (
        float(done.stdout.split()[-1]) > 0
    )  # the sums run in another order: numbers that all agree to the last bit were not compared


@pytest.mark.skipif(CC is None, reason="no C compiler")
def test_the_check_notices_another_coefficient(tmp_path):
    model = model_of(STRUCTURES["lag"])
    write_model(model, tmp_path)
    source, number = tmp_path / "model.c", float(model.theta[0, 0]).hex()
    text = source.read_text()
    assert number in text
    source.write_text(text.replace(number, float(model.theta[0, 0] + 1e-6).hex()))
    assert built(tmp_path).returncode == 1


@pytest.mark.skipif(CC is None, reason="no C compiler")
def test_what_is_out_of_range_or_not_finite_is_refused_and_the_past_starts_afresh(tmp_path):
    write_model(model_of(STRUCTURES["lag"]), tmp_path)
    (tmp_path / "model_check.c").write_text("""
#include <math.h>
#include "model.h"
static int step(model_state *s, double u, double p, double measured)
{
    const double uu[2] = {u, 0}, pp[1] = {p}, yy[2] = {measured, 0};
    double y[2] = {7, 7};
    const int said = model_predict(s, uu, pp, y);
    model_observe(s, yy);
    return said == MODEL_PREDICTED || y[0] == 7 ? said : -1;
}
static int again(model_state *s)
{
    return step(s, 0, 5, 0) == MODEL_NO_PAST && step(s, 0, 13, 0) == MODEL_NO_PAST
        && step(s, 0, 5, 0) == MODEL_PREDICTED;
}
int main(void)
{
    model_state s;
    model_init(&s);
    if (!again(&s)) return 1;
    if (step(&s, 0, 13.1, 0) != MODEL_REFUSED || !again(&s)) return 2;
    if (step(&s, NAN, 5, 0) != MODEL_REFUSED || !again(&s)) return 3;
    if (step(&s, 0, NAN, 0) != MODEL_REFUSED || !again(&s)) return 4;
    if (step(&s, 0, 5, INFINITY) != MODEL_PREDICTED || !again(&s)) return 5;
    return 0;
}
""")
    assert built(tmp_path).returncode == 0


def test_what_cannot_be_written_is_refused(tmp_path):
    own = idn.LPVARX(
        "y",
        "u",
        "p",
        na=1,
        nb=1,
        delay=1,
        basis=lpv.UserFunctions((np.ones_like, np.sin), 0.0, 1.0),
    )
    with pytest.raises(InputError, match="user-supplied functions"):
        write_model(model_of(own), tmp_path)
    with pytest.raises(InputError, match="C identifier"):
        write_model(model_of(STRUCTURES["lag"]), tmp_path, "a b")
    with pytest.raises(InputError, match="precision"):
        write_model(model_of(STRUCTURES["lag"]), tmp_path, precision="half")
    assert not list(tmp_path.iterdir())


def test_the_command_writes_it_and_says_what_it_needs(tmp_path, capsys):
    model_of(STRUCTURES["lag"]).save(tmp_path / "m.json")
    assert (
        main(
            [
                "export",
                "model",
                "--model",
                str(tmp_path / "m.json"),
                "--out",
                str(tmp_path / "c"),
                "--single",
            ]
        )
        == 0
    )
    header = (tmp_path / "c" / "model.h").read_text()
    assert "typedef float model_real;" in header
    assert "#define MODEL_P_p 0 /* rad, 0 to 13 */" in header
    assert main(["export", "model"]) == 1
    assert "--model FILE.json" in capsys.readouterr().err
    assert main(["export", "model", "--model", str(tmp_path / "none.json")]) == 1
    assert "none.json" in capsys.readouterr().err
