"""The exported estimator of a rigid vehicle learns what Python learns, over a gap too."""

import shutil
import subprocess

import pytest

import identification as idn
from identification.export import write_estimator, write_kinematic_estimator
from symheli.errors import InputError

CC = shutil.which("gcc") or shutil.which("clang") or shutil.which("cc")
STRICT = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")
NO_FMA = "-ffp-contract=off"
CONTROLS = ("d_lon", "d_lat", "d_col", "d_ped")
UNITS = dict.fromkeys(CONTROLS, "rad") | {"V": "m/s"}
KIN = idn.KinematicARX(CONTROLS, "V", na=2, nb=2, basis=idn.Polynomial(2, 0.0, 13.0))
DT = 0.02


def built(folder, name="estimator"):
    parts = ("rls", name, f"{name}_body", f"{name}_aero")
    for part in parts:
        subprocess.run([CC, *STRICT, NO_FMA, "-c", f"{part}.c"], cwd=folder, check=True)
    objects = [f"{part}.o" for part in parts]
    subprocess.run(
        [CC, *STRICT, f"{name}_check.c", *objects, "-lm", "-o", "check"], cwd=folder, check=True
    )
    return subprocess.run([str(folder / "check")], capture_output=True, text=True)


@pytest.mark.slow(but="estimator-double")
@pytest.mark.skipif(CC is None, reason="no C compiler")
@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("name", ["estimator", "heli"])
def test_it_learns_what_python_learns(tmp_path, precision, name):
    rls = idn.RecursiveLeastSquares(KIN, 0.99, precision=precision)
    write_kinematic_estimator(rls, UNITS, DT, tmp_path, name)
    done = built(tmp_path, name)
    assert done.returncode == 0, done.stdout
    # the same operations but for sin, cos and tan of this computer's library
    assert float(done.stdout.split()[-1]) < {"double": 1e-12, "single": 1e-3}[precision]


@pytest.mark.slow
@pytest.mark.skipif(CC is None, reason="no C compiler")
@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("estimator_body.c", "u * q - v * p", "u * q + v * p"),
        ("estimator.c", "started = 0;\n    estimator_aero_update(missing, missing, at);", ""),
    ],
)
def test_the_check_notices_other_kinematics_and_a_gap_that_is_not_one(tmp_path, file, old, new):
    write_kinematic_estimator(idn.RecursiveLeastSquares(KIN), UNITS, DT, tmp_path)
    text = (tmp_path / file).read_text()
    assert old in text
    new = new or "(void)missing; (void)at;"
    (tmp_path / file).write_text(text.replace(old, new))
    assert built(tmp_path).returncode == 1


def test_a_structure_without_kinematics_is_refused(tmp_path):
    plain = idn.LPVARX("q", "d_lon", "V", na=1, nb=1, delay=1, basis=idn.Polynomial(1, 0.0, 13.0))
    with pytest.raises(InputError, match="need a KinematicARX"):
        write_kinematic_estimator(idn.RecursiveLeastSquares(plain), UNITS, DT, tmp_path)
    with pytest.raises(InputError, match="written by write_kinematic_estimator"):
        write_estimator(idn.RecursiveLeastSquares(KIN), UNITS, tmp_path)
    assert not list(tmp_path.iterdir())
