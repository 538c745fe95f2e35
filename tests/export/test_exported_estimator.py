"""The exported estimator compiles without a warning, freestanding, and reproduces Python's numbers
to the last bit.
"""

import shutil
import subprocess

import numpy as np
import pytest

import identification as idn
from identification.export import write_estimator
from symheli import lpv
from symheli.errors import InputError

CC = shutil.which("gcc") or shutil.which("clang") or shutil.which("cc")
STRICT = (
    "-std=c99",
    "-O2",
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-pedantic",
    "-Werror",
    "-ffp-contract=off",
)
LONGITUDINAL = idn.LPVARX(
    ("theta", "w", "u"),
    ("d_lon",),
    "airspeed",
    na=3,
    nb=1,
    delay=2,
    basis=idn.Polynomial(2, 0.0, 13.0),
    scheduling_at="now",
)
GROUPS = idn.LPVARX(
    ("a", "b"),
    ("c", "d"),
    "p",
    na={"a": 1, "b": {"a": 0, "b": 2}},
    nb=2,
    delay=0,
    basis=lpv.CubicSpline((0.0, 1.0, 4.0, 9.0)),
    offset_rate=True,
)
BESIDE = idn.LPVARX(
    "y",
    (),
    ("v", "s"),
    na=2,
    nb=0,
    delay=0,
    basis=lpv.Product((idn.Polynomial(1, 0.0, 9.0), lpv.PiecewiseLinear((-1.0, 0.0, 1.0)))),
    offset=True,
)
CASES = {
    "longitudinal": idn.RecursiveLeastSquares(LONGITUDINAL),
    "longitudinal, single": idn.RecursiveLeastSquares(LONGITUDINAL, 0.99, precision="single"),
    "groups, variable": idn.RecursiveLeastSquares(GROUPS, idn.forgetting.Variable(200, 20)),
    "groups, directional, single": idn.RecursiveLeastSquares(
        GROUPS, idn.forgetting.Directional(0.97), precision="single"
    ),
    "two parameters, no inputs": idn.RecursiveLeastSquares(BESIDE, 0.98),
}


class Everything(dict):
    """A unit for every signal."""

    def __missing__(self, name):
        return "1"

    def __contains__(self, name):
        return True


def built(folder, name, *more):
    """Compile as an autopilot would, without a hosted library, and the check as a program; returns
    what it prints.
    """
    for part in (f"{name}.c", "rls.c"):
        subprocess.run(
            [CC, *STRICT, *more, "-ffreestanding", "-c", part, "-o", f"{part}.o"],
            cwd=folder,
            check=True,
        )
    subprocess.run(
        [CC, *STRICT, f"{name}_check.c", f"{name}.c.o", "rls.c.o", "-lm", "-o", "check"],
        cwd=folder,
        check=True,
    )
    return subprocess.run([str(folder / "check")], capture_output=True, text=True)


@pytest.mark.slow
@pytest.mark.skipif(CC is None, reason="no C compiler")
@pytest.mark.parametrize(
    ("case", "flags"),
    [*((case, ()) for case in CASES), ("groups, variable", ("-DRLS_NO_VECTORS",))],
)
def test_the_exported_estimator_reproduces_python_to_the_last_bit(tmp_path, case, flags):
    """With vectors, where the compiler has them, and number by number."""
    write_estimator(CASES[case], Everything(), tmp_path)
    done = built(tmp_path, "estimator", *flags)
    assert done.returncode == 0, done.stdout
    assert "the same to the last bit" in done.stdout


@pytest.mark.slow
@pytest.mark.skipif(CC is None, reason="no C compiler")
def test_the_check_notices_another_number(tmp_path):
    write_estimator(CASES["longitudinal"], Everything(), tmp_path)
    source = tmp_path / "estimator.c"
    text = source.read_text()
    assert "RLS_CONSTANT, 0x1.0000000000000p+0" in text
    source.write_text(
        text.replace("RLS_CONSTANT, 0x1.0000000000000p+0", "RLS_CONSTANT, 0x1.fff0000000000p-1")
    )
    done = built(tmp_path, "estimator")
    assert done.returncode == 1
    assert "last bit" not in done.stdout


@pytest.mark.slow
@pytest.mark.skipif(CC is None or shutil.which("nm") is None, reason="no C compiler, or no nm")
def test_nothing_is_allocated_and_no_library_is_called(tmp_path):
    """All the compiler may add on its own are the four memory functions every C environment must
    have.
    """
    write_estimator(CASES["longitudinal"], Everything(), tmp_path)
    built(tmp_path, "estimator")
    listing = subprocess.run(
        ["nm", "-u", "rls.c.o"], cwd=tmp_path, check=True, capture_output=True, text=True
    ).stdout
    assert {line.split()[-1] for line in listing.splitlines() if line.strip()} <= {
        "memset",
        "memcpy",
        "memmove",
        "memcmp",
    }


def test_the_header_says_what_every_number_is(tmp_path):
    write_estimator(
        CASES["longitudinal"],
        {"theta": "rad", "w": "m/s", "u": "m/s", "d_lon": "rad", "airspeed": "m/s"},
        tmp_path,
        "heli",
    )
    text = (tmp_path / "heli.h").read_text()
    assert "#define HELI_Y_w 1 /* m/s */" in text
    assert "#define HELI_P_airspeed 0 /* m/s, 0 to 13 */" in text
    names = LONGITUDINAL.regressor_names
    assert f"#define HELI_R_{'theta_1_f0_airspeed_k'} 0 /* {names[0]} */" in text
    assert f"#define HELI_STATE {CASES['longitudinal'].configuration.sizes[0]} " in text
    indices = [line.split()[1] for line in text.splitlines() if line.startswith("#define HELI_R_")]
    assert len(set(indices)) == LONGITUDINAL.n_regressors


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
        write_estimator(idn.RecursiveLeastSquares(own), Everything(), tmp_path)
    with pytest.raises(InputError, match="C identifier"):
        write_estimator(CASES["longitudinal"], Everything(), tmp_path, "a b")
    with pytest.raises(InputError, match="units: none given for theta, w, u, d_lon, airspeed"):
        write_estimator(CASES["longitudinal"], {}, tmp_path)
    assert not list(tmp_path.iterdir())


def test_the_command_writes_it(tmp_path, capsys):
    from studies.cli import main

    assert (
        main(
            [
                "export",
                "identifier",
                "--outputs",
                "q,theta",
                "--inputs",
                "d_lon",
                "--single",
                "--out",
                str(tmp_path / "on board"),
            ]
        )
        == 0
    )
    assert "estimator_check.c" in capsys.readouterr().out
    assert (
        "#define ESTIMATOR_Y_q 0 /* rad/s */" in (tmp_path / "on board" / "estimator.h").read_text()
    )
    assert main(["export", "identifier", "--outputs", "thta", "--out", str(tmp_path)]) == 1
    assert "did you mean 'theta'" in capsys.readouterr().err
