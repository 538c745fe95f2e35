"""What is written for other programs is used there as they would use it."""

import re
import shutil
import subprocess

import numpy as np
import pytest
from scipy.io import loadmat

import symheli
from studies import cli
from symheli.export import write_c

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic")
needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")


def export(*arguments):
    assert cli.main(["export", *map(str, arguments)]) == 0


# --- C -------------------------------------------------------------------------------------------


@pytest.mark.slow(but="ideal")
@needs_compiler
@pytest.mark.parametrize("governor", ["ideal", "pi"])
def test_the_check_beside_the_c_code_passes_with_warnings_as_errors(governor, tmp_path):
    path = tmp_path / "deep" / "heli.c"
    export("c", "--out", path, "--governor", governor)
    program = tmp_path / "check"
    subprocess.run(
        ["cc", *STRICT, str(path), str(path.with_name("heli_check.c")), "-o", str(program), "-lm"],
        check=True,
    )
    done = subprocess.run([str(program)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    assert done.stdout.count("largest difference") == 3


@needs_compiler
def test_the_check_fails_where_a_number_of_the_model_is_wrong(tmp_path, ideal):
    code = write_c(ideal, tmp_path / "heli.c")[0]
    wrong = code.read_text().replace("9.8100000000000005e+00", "9.8100001000000000e+00")
    assert wrong != code.read_text()
    code.write_text(wrong)
    subprocess.run(
        ["cc", str(code), str(tmp_path / "heli_check.c"), "-o", str(tmp_path / "check"), "-lm"],
        check=True,
    )
    done = subprocess.run([str(tmp_path / "check")], capture_output=True, text=True)
    assert done.returncode == 3
    assert done.stdout.count("FAILED") == 3


@pytest.mark.slow
@needs_compiler
@pytest.mark.skipif(shutil.which("cmake") is None, reason="no cmake")
def test_cmake_builds_and_tests_it(tmp_path, ideal):
    write_c(ideal, tmp_path / "my heli.c")
    for command in (
        ["cmake", "-S", ".", "-B", "build"],
        ["cmake", "--build", "build"],
        ["ctest", "--test-dir", "build"],
    ):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    assert "100% tests passed" in done.stdout


def test_the_header_names_every_state_input_and_wind_with_its_unit(tmp_path, heli):
    header = write_c(heli, tmp_path / "heli.c")[1].read_text()
    for prefix, names in (
        ("X", heli.states),
        ("FLIGHT", heli.flight_states),
        ("U", heli.inputs),
        ("WIND", heli.wind),
    ):
        for index, name in enumerate(names):
            assert re.search(
                rf"#define RHS_{prefix}_{name} {index} /\* {re.escape(name.unit)}[ ,]", header
            )
        assert f"#define RHS_N_{prefix} {len(names)}\n" in header


def test_a_cmake_file_of_somebody_else_is_left_alone(tmp_path, ideal):
    mine = tmp_path / "CMakeLists.txt"
    mine.write_text("project(autopilot)\n")
    assert mine not in write_c(ideal, tmp_path / "heli.c")
    assert mine.read_text() == "project(autopilot)\n"
    mine.unlink()
    assert mine in write_c(ideal, tmp_path / "heli.c")
    assert mine in write_c(ideal, tmp_path / "other.c")
    assert "other.c" in mine.read_text()


# --- MATLAB --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def mat(tmp_path_factory):
    path = tmp_path_factory.mktemp("matlab") / "family.mat"
    export("mat", "--out", path, "--airspeeds", 2, 8, "--points", 3)
    return path


@pytest.fixture(scope="module")
def family():
    return symheli.sweep(symheli.Helicopter.load("xcell60", governor="ideal"), [2.0, 5.0, 8.0])


def test_the_mat_file_is_the_family(mat, family):
    got = loadmat(mat, simplify_cells=True)
    np.testing.assert_array_equal(got["airspeeds"], family.airspeeds)
    for name in "ABCD":
        np.testing.assert_allclose(
            np.moveaxis(got[name], -1, 0), getattr(family, name), atol=1e-9
        )  # trims end within 1e-9
    np.testing.assert_allclose(got["x0"].T, [t.x.array for t in family.trims], atol=1e-9)
    np.testing.assert_allclose(got["u0"].T, [t.u.array for t in family.trims], atol=1e-9)
    np.testing.assert_allclose(
        got["y0"].T, [[t.x[y] for y in family.outputs] for t in family.trims], atol=1e-9
    )
    for group in ("states", "inputs", "outputs"):
        assert list(got[group]) == list(getattr(family, group))
        assert list(got[f"{group}_units"]) == [s.unit for s in getattr(family, group)]


STAND_INS = {
    # what the documented signatures ss(A,B,C,D,Name,Value,...) and
    # lpvss(ParameterName,DataFcn,Ts,t0,p0) receive, kept in a struct
    "ss.m": (
        """function s = ss(A, B, C, D, varargin)
s = struct('A', A, 'B', B, 'C', C, 'D', D);
for k = 1:2:numel(varargin)
    s.(varargin{k}) = varargin{k + 1};
end
end
"""
    ),
    "lpvss.m": (
        """function s = lpvss(name, data, Ts, t0, p0)
[A, B, C, D, E, dx0, x0, u0, y0, delays] = data(t0, p0);
s = struct('ParameterName', name, 'Ts', Ts, 'A', A, 'order', size(A, 1), 'E', E, ...
    'dx0', dx0, 'x0', x0, 'delays', delays);
end
"""
    ),
    "check.m": (
        """[models, lpv, family] = load_symheli('family.mat');
[A, B, C, D, E, dx0, x0, u0, y0, delays] = symheli_at(family, 3.5);
[~, ~, ~, ~, ~, ~, below] = symheli_at(family, 0);
save('-v7', 'seen.mat', 'models', 'lpv', 'A', 'B', 'C', 'D', 'dx0', 'x0', 'u0', 'y0', 'below');
"""
    ),
}
"""No MATLAB is needed: Octave runs the functions with stand-ins for the two constructors."""


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="no Octave")
def test_the_loader_runs_and_interpolates(mat, family):
    for name, text in STAND_INS.items():
        (mat.parent / name).write_text(text)
    done = subprocess.run(
        ["octave-cli", "--norc", "check.m"], cwd=mat.parent, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    seen = loadmat(mat.parent / "seen.mat", simplify_cells=True)
    for name in "ABCD":
        np.testing.assert_allclose(
            np.moveaxis(seen["models"][name], -1, 0), getattr(family, name), atol=1e-9
        )
        np.testing.assert_allclose(
            seen[name], 0.5 * (getattr(family, name)[0] + getattr(family, name)[1]), atol=1e-9
        )
    np.testing.assert_allclose(seen["models"]["SamplingGrid"]["airspeed"], family.airspeeds)
    assert list(seen["models"]["StateName"]) == list(family.states)
    assert list(seen["models"]["InputUnit"]) == ["rad"] * 4
    assert list(seen["lpv"]["OutputName"]) == list(family.outputs)
    assert (seen["lpv"]["ParameterName"], seen["lpv"]["Ts"]) == ("airspeed", 0)
    x0, u0 = (
        np.array([t.x.array for t in family.trims]),
        np.array([t.u.array for t in family.trims]),
    )
    np.testing.assert_allclose(seen["x0"], 0.5 * (x0[0] + x0[1]), atol=1e-9)
    np.testing.assert_allclose(seen["u0"], 0.5 * (u0[0] + u0[1]), atol=1e-9)
    np.testing.assert_allclose(seen["y0"], seen["x0"], atol=1e-9)
    np.testing.assert_array_equal(seen["dx0"], np.zeros(10))
    np.testing.assert_allclose(
        seen["below"], x0[0], atol=1e-9
    )  # held outside the airspeeds of the family


def test_the_files_that_matlab_needs_lie_together(mat):
    assert {"family.mat", "load_symheli.m", "symheli_at.m"} <= {
        p.name for p in mat.parent.iterdir()
    }
    for name in ("load_symheli", "symheli_at"):
        # MATLAB finds a function by the name of its file
        assert re.match(rf"function \[.*\] = {name}\(", (mat.parent / f"{name}.m").read_text())
