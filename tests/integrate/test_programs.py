"""Programs: the same bits from NumPy and CasADi's virtual machine, the same from C whatever lies
side by side, and both to rounding.
"""

import ctypes
import platform

import casadi
import numpy as np
import pytest

from symheli.codegen import Layout, as_casadi, c_function, compile, evaluate, program
from symheli.codegen.branches import branches
from symheli.codegen.compile import compiler, library
from symheli.errors import CompilerWarning, InputError

needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler")


def points(heli, count, seed=0):
    """States far beyond any flight: every branch is taken somewhere."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(len(heli.flight_states), count)) * 0.5
    x[:3] *= 20
    if heli.governor == "pi":
        x[15] = 167 + 20 * x[15]
    u = rng.normal(size=(4, count)) * 0.15
    x[:, 0] = 0.0  # hover, nothing turning
    x[6, 0], x[-2 if heli.governor == "pi" else 6, 0] = 1.0, 167.0 if heli.governor == "pi" else 1.0
    return x, u, rng.normal(size=(3, count)) * 5


def test_a_program_is_its_casadi_function_to_rounding(heli):
    x, u, wind = points(heli, 2000)
    ours = np.array(evaluate(program(heli.flight_rhs), x, u, wind)[0])
    theirs = np.array(heli.flight_rhs.map(2000)(x, u, wind))
    # quotients by constants are products by reciprocals: a few units of 1e-16 in each of a few
    # hundred operations
    np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-11)


def test_the_virtual_machine_gives_the_bits_of_numpy(heli):
    x, u, wind = points(heli, 500)
    made = program(heli.flight_rhs)
    np.testing.assert_array_equal(
        np.array(as_casadi(made).map(500)(x, u, wind)), np.array(evaluate(made, x, u, wind)[0])
    )


def in_machine_code(made, layout, inputs):
    """The only output of a program at many points, so many at a time as the layout has lanes."""
    names = [f"in{i}" for i in range(len(made.sizes))]
    given = "".join(f"const lane *{name}, " for name in names)
    call = f"void call({given}lane *out) {{ f({', '.join(names)}, out); }}\n"
    source = layout.prelude + c_function(made, layout, "f") + call
    code = ctypes.CDLL(str(library(source, f"test-{layout.lanes}")))
    out = np.empty((len(made.outputs[0]), inputs[0].shape[1]))
    for first in range(0, out.shape[1], layout.lanes):
        part = slice(first, first + layout.lanes)
        arrays = [np.ascontiguousarray(a[:, part]) for a in (*inputs, out)]
        code.call(*(ctypes.c_void_p(a.ctypes.data) for a in arrays))
        out[:, part] = arrays[-1]
    return out


@pytest.mark.slow
@needs_compiler
def test_machine_code_gives_the_same_bits_in_every_layout(ideal):
    made, everywhere = program(ideal.flight_rhs), points(ideal, 640)
    alone = in_machine_code(made, Layout(), everywhere)
    for layout in (Layout(8), Layout(8, 4), Layout(3, 2)):
        # 642 points: a multiple of six lanes too
        padded = [np.concatenate([a, a[:, : -640 % layout.lanes]], axis=1) for a in everywhere]
        np.testing.assert_array_equal(in_machine_code(made, layout, padded)[:, :640], alone)
    # each of a few hundred operations rounded otherwise
    np.testing.assert_allclose(alone, evaluate(made, *everywhere)[0], rtol=1e-12, atol=1e-11)


@needs_compiler
def test_elementary_functions_and_fused_operations_are_those_of_numpy_to_rounding():
    a, b = casadi.SX.sym("a", 2), casadi.SX.sym("b")
    x, y = a[0], a[1]
    whole = casadi.Function(
        "whole",
        [a, b],
        [
            casadi.densify(
                casadi.vertcat(
                    *(casadi.sin(x), casadi.cos(3 * x), casadi.tan(y), casadi.exp(x)),
                    *(casadi.asin(casadi.sin(y)), casadi.atan2(x, y)),
                    *(x * y + b, x * y - b, b - x * y, x * y + y * b, x * x - y * y),
                )
            )
        ],
    )
    made = program(whole)
    names = [o.name for o in made.operations]
    assert [names.count(name) for name in ("fma", "fms", "fnma", "add", "sub")] == [2, 2, 1, 0, 0]
    rng = np.random.default_rng(0)
    inputs = rng.uniform(-1.5, 1.5, (2, 64)), rng.normal(size=(1, 64))
    expected = np.array(whole.map(64)(*inputs))
    # 2 units of each function, times up to 15 where the tangent is steep, and of a few more sums
    for value in (
        evaluate(made, *inputs)[0],
        *(in_machine_code(made, Layout(k), inputs) for k in (1, 8)),
    ):
        np.testing.assert_allclose(value, expected, rtol=1e-14, atol=1e-15)
    np.testing.assert_array_equal(
        in_machine_code(made, Layout(), inputs), in_machine_code(made, Layout(8), inputs)
    )


def test_a_product_that_is_needed_by_itself_is_not_fused():
    a = casadi.SX.sym("a", 3)
    product = a[0] * a[1]
    outputs = casadi.vertcat(product + a[2], casadi.sqrt(product))
    names = [o.name for o in program(casadi.Function("f", [a], [outputs])).operations]
    assert names.count("mul") == names.count("add") == 1
    assert "fma" not in names


@needs_compiler
def test_without_fused_multiply_adds_one_is_told_so(monkeypatch):
    """Code for the oldest 64-bit processors of this kind."""
    if platform.machine() != "x86_64":
        pytest.skip("levels of x86-64")
    flags = tuple(f for f in compile.FLAGS if not f.startswith("-march"))
    monkeypatch.setattr(compile, "FLAGS", (*flags, "-march=x86-64"))
    compile._warn_once.cache_clear()
    with pytest.warns(CompilerWarning, match="no fused multiply-add"):
        assert not compile.loaded(library(Layout().prelude, "unfused")).has_fma()


def test_a_side_holds_what_it_alone_needs(ideal):
    """Every user of an operation on a side is on that side, or is the selection itself: nothing is
    used that was not computed.
    """
    made = program(ideal.flight_rhs)
    homes = branches(made)

    def inside(side, outer):
        while side != outer and side is not None:
            side = homes[side[0]]
        return side == outer

    for k, operation in enumerate(made.operations):
        for place, a in enumerate(operation.arguments):
            user = (k, place == 1) if operation.name == "select" and place > 0 else homes[k]
            assert inside(user, homes[a]) or made.operations[a].name == "constant"
    assert all(homes[a] is None for output in made.outputs for a in output)
    roots = [homes[k] for k, o in enumerate(made.operations) if o.name == "sqrt"]
    assert (
        sum(home is not None for home in roots) >= 4
    )  # two Halley steps of each rotor that are rarely taken


def test_held_work_done_once_changes_no_bit(heli):
    x, u, wind = points(heli, 500)
    made = program(heli.flight_rhs)
    held, rest = made.hoist([0])
    kept = evaluate(held, u, wind)[0]
    np.testing.assert_array_equal(
        np.array(evaluate(rest, x, kept)[0]), np.array(evaluate(made, x, u, wind)[0])
    )
    assert len(rest.operations) < len(made.operations)


def test_conditions_and_signs_keep_their_meaning():
    a, b = casadi.SX.sym("a", 3), casadi.SX.sym("b", 1)
    expressions = [
        casadi.if_else(casadi.logic_and(a[0] < b, a[1] >= b), a[2], -a[2]),
        casadi.if_else(casadi.logic_or(a[0] == b, a[1] != b), 1.0, a[2]),
        casadi.sign(a[0]) + (a[1] < a[2]),
        casadi.if_else(a[0] <= b, a[0], b),
        casadi.if_else(a[0] >= b, a[0], b),
        a[0] / b + a[1] / b,
        a[2] / 3,
    ]
    function = casadi.Function("f", [a, b], [casadi.densify(casadi.vertcat(*expressions))])
    grid = np.array(np.meshgrid(*[[-2.0, 0.0, 0.5, 3.0]] * 3, [-2.0, 0.5, 4.0])).reshape(4, -1)
    x, p = grid[:3], grid[3:]
    whole = program(function)
    held, rest = whole.hoist([0])
    expected = np.array(function.map(grid.shape[1])(x, p))
    for made in (evaluate(whole, x, p)[0], evaluate(rest, x, evaluate(held, p)[0])[0]):
        np.testing.assert_allclose(np.array(made), expected, rtol=1e-15)


def test_a_function_without_a_form_is_refused():
    a = casadi.SX.sym("a")
    with pytest.raises(InputError, match=r"wave: CasADi operation \d+ has no form"):
        program(casadi.Function("wave", [a], [casadi.log(a)]))


def test_the_right_hand_side_stays_cheap(ideal):
    """Roots and quotients set the pace of machine code: 18 and 46 of them once, in 1060
    operations.
    """
    names = [o.name for o in program(ideal.flight_rhs).operations]
    assert names.count("sqrt") <= 12
    assert names.count("div") <= 12
    assert len(names) < 720


@needs_compiler
def test_code_made_for_one_processor_is_not_taken_by_another(tmp_path, monkeypatch):
    """A home directory may be shared by two machines."""
    monkeypatch.setenv("SYMHELI_CACHE", str(tmp_path))
    source = "double one(void) { return 1.0; }\n"
    here = library(source, "one")
    assert library(source, "one") == here
    monkeypatch.setattr(compile, "_cpu", lambda: "another processor")
    assert library(source, "one") != here


@needs_compiler
def test_a_processor_is_told_from_another_where_linux_does_not_say(monkeypatch):
    """By the macros that -march=native defines."""

    def absent(*_, **__):
        raise FileNotFoundError

    monkeypatch.setattr(compile.Path, "read_text", absent)
    assert "#define" in compile._cpu.__wrapped__()
