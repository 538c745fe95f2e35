"""An identified rigid vehicle as C compiles without a warning and does what Python does."""

import re
import shutil
import subprocess

import numpy as np
import pytest

import identification as idn
from identification.export import write_kinematic_model
from symheli import lpv
from symheli.errors import InputError
from symheli.values import Signal

CC = shutil.which("gcc") or shutil.which("clang") or shutil.which("cc")
STRICT = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")
CONTROLS = ("d_lon", "d_lat", "d_col", "d_ped")
UNITS = dict.fromkeys("uvw", "m/s") | dict.fromkeys("pqr", "rad/s")
BOX = lpv.Product(
    (lpv.BSpline(2, (0.0, 6.0, 13.0)), idn.Polynomial(1, -2.0, 2.0)), total_degree=None
)
STRUCTURES = {
    "airspeed": idn.KinematicARX(CONTROLS, "V", na=2, nb=2, basis=idn.Polynomial(2, 0.0, 13.0)),
    "orders by signal": idn.KinematicARX(
        ("d_lon", "d_col"), "V", nb={"d_lon": 3, "d_col": 1}, basis=idn.Polynomial(1, 0.0, 13.0)
    ),
    "two parameters": idn.KinematicARX(CONTROLS, ("V", "a"), na=1, nb=1, basis=BOX),
}


def model_of(kin, seed=0):
    """Random coefficients of order one a second, damped."""
    aero, rng = kin.aerodynamics, np.random.default_rng(seed)
    theta = rng.uniform(-0.02, 0.02, (aero.n_regressors, 6)) / kin.basis.size
    regression = idn.model.LPVARXModel(
        structure=aero,
        theta=theta,
        dt=0.02,
        outputs=tuple(Signal(s, UNITS[s[0]]) for s in aero.outputs),
        inputs=tuple(Signal(s, UNITS.get(s, "rad")) for s in aero.inputs),
        scheduling=tuple(Signal(s, "m/s") for s in aero.parameters),
        residual_covariance=np.eye(6),
        rows_used=100,
    )
    return idn.model.KinematicModel(
        structure=kin, aerodynamics=regression, trim=np.zeros((kin.basis.size, 8))
    )


def built(folder, name="model"):
    parts = (name, f"{name}_body", f"{name}_aero")
    for part in parts:
        subprocess.run([CC, *STRICT, "-c", f"{part}.c"], cwd=folder, check=True)
    subprocess.run(
        [CC, *STRICT, f"{name}_check.c", *(f"{part}.o" for part in parts), "-lm", "-o", "check"],
        cwd=folder,
        check=True,
    )
    return subprocess.run([str(folder / "check")], capture_output=True, text=True)


@pytest.mark.slow(but="airspeed")
@pytest.mark.skipif(CC is None, reason="no C compiler")
@pytest.mark.parametrize("case", STRUCTURES)
def test_the_c_model_is_python_to_rounding(tmp_path, case):
    write_kinematic_model(model_of(STRUCTURES[case]), tmp_path, "heli")
    done = built(tmp_path, "heli")
    assert done.returncode == 0, done.stdout
    assert 0 < float(done.stdout.split()[-1]) < 1e-12  # sums run in another order
    there, of = map(int, re.findall(r"(\d+) of (\d+)", done.stdout)[0])
    assert there == of > 50


@pytest.mark.skipif(CC is None, reason="no C compiler")
def test_single_precision_keeps_its_digits(tmp_path):
    write_kinematic_model(model_of(STRUCTURES["airspeed"]), tmp_path, precision="single")
    done = built(tmp_path)
    assert done.returncode == 0, done.stdout
    assert "typedef float model_body_real;" in (tmp_path / "model_body.h").read_text()


@pytest.mark.slow(but="model_body.c-v * r - w * q-v * r + w * q")
@pytest.mark.skipif(CC is None, reason="no C compiler")
@pytest.mark.parametrize(
    ("file", "old", "new"),
    [("model_body.c", "v * r - w * q", "v * r + w * q"), ("model.c", "FAST + i", "FAST")],
)
def test_the_check_notices_another_equation(tmp_path, file, old, new):
    write_kinematic_model(model_of(STRUCTURES["airspeed"]), tmp_path)
    text = (tmp_path / file).read_text()
    assert old in text
    (tmp_path / file).write_text(text.replace(old, new))
    assert built(tmp_path).returncode == 1


@pytest.mark.skipif(CC is None, reason="no C compiler")
def test_after_a_gap_the_past_is_filled_first_and_a_lost_run_says_so(tmp_path):
    write_kinematic_model(model_of(STRUCTURES["airspeed"]), tmp_path)
    (tmp_path / "model_check.c").write_text("""
#include <math.h>
#include "model.h"
static int step(model_state *s, double p, double phi, double theta, double u)
{
    const double yy[8] = {1, 0, 0, 0, 0, 0, phi, theta}, uu[4] = {0, 0, 0, u};
    double y[8] = {7};
    const int said = model_predict(s, &p, y);
    model_observe(s, yy, uu);
    return (said == MODEL_PREDICTED) == (y[0] != 7) ? said : -1;
}
static int again(model_state *s)
{
    return step(s, 5, 0, 0, 0) == MODEL_NO_PAST && step(s, 5, 0, 0, 0) == MODEL_NO_PAST
        && step(s, 5, 0, 0, 0) == MODEL_PREDICTED;
}
int main(void)
{
    model_state s;
    model_init(&s);
    if (!again(&s)) return 1;
    if (step(&s, 13.1, 0, 0, 0) != MODEL_REFUSED || !again(&s)) return 2;
    if (step(&s, NAN, 0, 0, 0) != MODEL_REFUSED || !again(&s)) return 3;
    if (step(&s, 5, NAN, 0, 0) != MODEL_PREDICTED || !again(&s)) return 4;
    if (step(&s, 5, 0, 0, INFINITY) != MODEL_PREDICTED || !again(&s)) return 5;
    if (step(&s, 5, 0, 1.56, 0) != MODEL_PREDICTED || step(&s, 5, 0, 0, 0) != MODEL_LOST) return 6;
    return 0;
}
""")
    assert built(tmp_path).returncode == 0


def test_what_cannot_be_written_is_refused(tmp_path):
    own = lpv.UserFunctions((np.ones_like, np.sin), 0.0, 1.0)
    with pytest.raises(InputError, match="user-supplied functions"):
        write_kinematic_model(model_of(idn.KinematicARX("d_lon", "V", basis=own)), tmp_path)
    with pytest.raises(InputError, match="C identifier"):
        write_kinematic_model(model_of(STRUCTURES["airspeed"]), tmp_path, "a b")
    assert not list(tmp_path.iterdir())
