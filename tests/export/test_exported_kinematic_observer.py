"""The exported observer of a rigid vehicle estimates what Python estimates, over missing samples
too.
"""

import re
import shutil
import subprocess

import numpy as np
import pytest
from export.test_exported_kinematic_model import CONTROLS, STRUCTURES, model_of

import identification as idn
from identification.export import write_kinematic_observer
from symheli import lpv
from symheli.errors import InputError

CC = shutil.which("gcc") or shutil.which("clang") or shutil.which("cc")
STRICT = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")
STRUCTURES = STRUCTURES | {
    "moving p": idn.KinematicARX(
        CONTROLS, "V", na=1, nb=3, basis=idn.Polynomial(1, 0.0, 13.0), offset_rate=True
    ),
    "no memory": idn.KinematicARX(CONTROLS, "V", na=1, nb=1, basis=idn.Polynomial(1, 0.0, 13.0)),
}


def observer_of(kin):
    sensors = dict(zip(kin.outputs, np.linspace(0.03, 0.1, 8), strict=True))
    return model_of(kin).observer(sensors, process=0.02)


def built(folder, name="observer"):
    parts = (name, f"{name}_body", f"{name}_aero")
    for part in parts:
        subprocess.run([CC, *STRICT, "-c", f"{part}.c"], cwd=folder, check=True)
    objects = [f"{part}.o" for part in parts]
    command = [CC, *STRICT, f"{name}_check.c", *objects, "-lm", "-o", "check"]
    subprocess.run(command, cwd=folder, check=True)
    return subprocess.run([str(folder / "check")], capture_output=True, text=True)


@pytest.mark.slow(but="airspeed")
@pytest.mark.skipif(CC is None, reason="no C compiler")
@pytest.mark.parametrize("case", STRUCTURES)
def test_the_c_observer_is_python_to_rounding(tmp_path, case):
    write_kinematic_observer(observer_of(STRUCTURES[case]), tmp_path, "own")
    done = built(tmp_path, "own")
    assert done.returncode == 0, done.stdout
    # measurements one by one, and Gauss and Jordan, for two solutions of linear equations
    assert 0 < float(done.stdout.split()[-1]) < 1e-12
    estimated, of = map(int, re.findall(r"(\d+) of (\d+)", done.stdout)[0])
    assert estimated == of > 130


@pytest.mark.slow
@pytest.mark.skipif(CC is None, reason="no C compiler")
def test_single_precision_keeps_its_digits(tmp_path):
    observer = observer_of(STRUCTURES["airspeed"])
    write_kinematic_observer(observer, tmp_path, precision="single")
    done = built(tmp_path)
    assert done.returncode == 0, done.stdout
    assert float(done.stdout.split()[-1]) < 1e-5


@pytest.mark.slow(but="-w, v-w, v")
@pytest.mark.skipif(CC is None, reason="no C compiler")
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("-w, v", "w, v"),
        ("* process[k] *", "* (2 * process[k]) *"),
        ("s->P[row][row] = column < FAST ? sensor[column] : 0;", ""),
        ("gain[i] * sensor[m] - row[i]", "-row[i]"),
        ("if (!is_finite(y[m])) continue;", ""),
    ],
)
def test_the_check_notices_another_filter(tmp_path, old, new):
    write_kinematic_observer(observer_of(STRUCTURES["airspeed"]), tmp_path)
    text = (tmp_path / "observer.c").read_text()
    assert old in text
    (tmp_path / "observer.c").write_text(text.replace(old, new))
    assert built(tmp_path).returncode == 1


@pytest.mark.skipif(CC is None, reason="no C compiler")
def test_it_says_why_nothing_is_estimated(tmp_path):
    write_kinematic_observer(observer_of(STRUCTURES["airspeed"]), tmp_path)
    (tmp_path / "observer_check.c").write_text("""
#include <math.h>
#include "observer.h"
static int step(observer_state *s, double p, double theta, double u)
{
    const double yy[8] = {1, 0, 0, 0, 0, 0, 0, theta}, uu[4] = {0, 0, 0, u};
    double y[8];
    return observer_update(s, yy, uu, &p, y);
}
static int again(observer_state *s)
{
    return step(s, 5, 0, 0) == OBSERVER_STARTING && step(s, 5, 0, 0) == OBSERVER_STARTING
        && step(s, 5, 0, 0) == OBSERVER_ESTIMATED;
}
int main(void)
{
    static observer_state s;
    observer_init(&s);
    if (!again(&s)) return 1;
    if (step(&s, 13.1, 0, 0) != OBSERVER_REFUSED || !again(&s)) return 2;
    if (step(&s, NAN, 0, 0) != OBSERVER_MISSING || !again(&s)) return 3;
    if (step(&s, 5, 0, INFINITY) != OBSERVER_MISSING || !again(&s)) return 4;
    if (step(&s, 5, NAN, 0) != OBSERVER_ESTIMATED || step(&s, 5, 0, 0) != OBSERVER_ESTIMATED)
        return 5;
    observer_init(&s);
    if (step(&s, 5, NAN, 0) != OBSERVER_MISSING || !again(&s)) return 6;
    observer_init(&s);
    if (step(&s, 5, 1.56, 0) != OBSERVER_STARTING || step(&s, 5, 1.56, 0) != OBSERVER_STARTING)
        return 7;
    if (step(&s, 5, 1.56, 0) != OBSERVER_LOST || !again(&s)) return 8;
    return 0;
}
""")
    assert built(tmp_path).returncode == 0


def test_what_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(InputError, match="C identifier"):
        write_kinematic_observer(observer_of(STRUCTURES["airspeed"]), tmp_path, "a b")
    own = lpv.UserFunctions((np.ones_like, np.sin), 0.0, 1.0)
    kin = idn.KinematicARX("d_lon", "V", basis=own)
    with pytest.raises(InputError, match="user-supplied functions"):
        write_kinematic_observer(observer_of(kin), tmp_path)
    assert not list(tmp_path.iterdir())
