"""Sine, cosine, arc sine, arc tangent and exponential of the generated code: against 40 digits, and
the same bits in every lane and at every level of instructions that fuses.
"""

import ctypes
import platform
import shutil
import subprocess

import mpmath
import numpy as np
import pytest

from symheli.codegen import Layout
from symheli.codegen.compile import FLAGS, compiler, library

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler")

ARGUMENTS = {"sin": 1, "cos": 1, "asin": 1, "exp": 1, "atan2": 2}


def source(layout):
    """For each function a loop over its points, so many at a time as the layout has lanes."""
    text = layout.prelude
    for name, count in ARGUMENTS.items():
        given = ", ".join(f"const double *in{i}" for i in range(count))
        taken = ", ".join(f"in{i}[k + l]" for i in range(count))
        text += (
            f"void {name}_lanes({given}, double *restrict out, long n)\n{{\n"
            "  for (long k = 0; k < n; k += LANES)\n    for (int l = 0; l < LANES; ++l)"
            f" out[k + l] = elementary_{name}({taken});\n}}\n"
        )
    return text


def values(code, name, *points):
    points = [np.ascontiguousarray(p, float) for p in points]
    out = np.empty_like(points[0])
    pointers = [ctypes.c_void_p(a.ctypes.data) for a in (*points, out)]
    getattr(code, f"{name}_lanes")(*pointers, ctypes.c_long(len(out)))
    return out


@pytest.fixture(scope="module")
def side_by_side():
    return ctypes.CDLL(str(library(source(Layout(8)), "elementary-8")))


def arguments(name):
    """Points of each function, a multiple of eight: usual ones, tiny ones, and the hardest."""
    rng = np.random.default_rng(0)
    tiny = 10.0 ** rng.uniform(-300, 0, 400)
    if name in ("sin", "cos"):
        near_zeros = np.round(rng.uniform(-3000, 3000, 1200)) * np.pi / 2
        return (np.concatenate([rng.uniform(-5000, 5000, 1600), near_zeros, tiny]),)
    if name == "asin":
        return (np.concatenate([rng.uniform(-1, 1, 1600), 1 - tiny, tiny]),)
    if name == "exp":
        return (np.concatenate([rng.uniform(-708, 709, 1600), rng.uniform(-1, 1, 400), tiny]),)
    wide = 10.0 ** rng.uniform(-8, 8, 800)
    return rng.normal(size=1600), rng.normal(size=1600) * np.concatenate([np.ones(800), wide])


@pytest.mark.parametrize("name", ARGUMENTS)
def test_within_two_units_in_the_last_place(side_by_side, name):
    points = arguments(name)
    with mpmath.workdps(40):
        exact = [
            getattr(mpmath, name)(*map(mpmath.mpf, map(float, p)))
            for p in zip(*points, strict=True)
        ]
        errors = [
            abs(mpmath.mpf(float(value)) - e) / float(np.spacing(abs(float(e))))
            for value, e in zip(values(side_by_side, name, *points), exact, strict=True)
        ]
    assert max(errors) < 2


@pytest.mark.parametrize("name", ARGUMENTS)
def test_the_lane_changes_no_bit(side_by_side, name):
    one = ctypes.CDLL(str(library(source(Layout()), "elementary-1")))
    points = arguments(name)
    np.testing.assert_array_equal(
        values(one, name, *points), values(side_by_side, name, *points), strict=True
    )


@pytest.mark.slow(only="exp")
@pytest.mark.skipif(platform.machine() != "x86_64", reason="levels of x86-64")
@pytest.mark.parametrize("name", ARGUMENTS)
def test_the_level_of_instructions_changes_no_bit(side_by_side, name, tmp_path):
    if not side_by_side.has_fma():
        pytest.skip("this processor does not fuse")
    flags = [f for f in FLAGS if not f.startswith("-march")]
    code, built = tmp_path / "code.c", tmp_path / "code.so"
    code.write_text(source(Layout(8)))
    subprocess.run(
        [shutil.which(compiler()), *flags, "-march=x86-64-v3", str(code), "-o", str(built), "-lm"],
        check=True,
    )
    points = arguments(name)
    np.testing.assert_array_equal(
        values(ctypes.CDLL(str(built)), name, *points), values(side_by_side, name, *points)
    )


def test_signs_of_zero_and_what_is_no_number(side_by_side):
    zeros = np.array([0.0, -0.0] * 4)
    for name in ("sin", "asin"):
        np.testing.assert_array_equal(
            np.signbit(values(side_by_side, name, zeros)), np.signbit(zeros)
        )
    nan = np.array([np.nan, np.inf, -np.inf, 2e6, -2e6, np.nan, np.nan, np.nan])
    for name in ("sin", "cos"):  # beyond 2^20 quarter turns nothing is known of the angle
        assert np.isnan(values(side_by_side, name, nan)).all()
    assert np.isnan(values(side_by_side, "asin", nan)).all()
    np.testing.assert_array_equal(
        values(side_by_side, "exp", nan), [np.nan, np.inf, 0, np.inf, 0, *[np.nan] * 3]
    )
    y = np.array([0.0, -0.0, 0.0, -0.0, 1.0, -1.0, np.nan, 1.0])
    x = np.array([0.0, 0.0, -0.0, -0.0, 0.0, -0.0, 1.0, np.nan])
    np.testing.assert_array_equal(values(side_by_side, "atan2", y, x), np.arctan2(y, x))
    assert np.signbit(values(side_by_side, "atan2", y, x))[1]
