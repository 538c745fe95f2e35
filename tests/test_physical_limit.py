"""What the benchmarks set beside a flight: operations counted, chains of operations timed."""

import sys
from pathlib import Path

import casadi
import numpy as np

from symheli.codegen import program

sys.path.append(str(Path(__file__).resolve().parents[1]))  # benchmarks/ is not installed

from benchmarks.peak import flop
from benchmarks.waiting import Waiting

WAIT = {"add": 3.0, "mul": 4.0, "fma": 5.0, "div": 13.0, "sqrt": 20.0}


def made(expression, *symbols):
    return program(casadi.Function("f", list(symbols), [casadi.densify(expression)]))


def test_a_fused_operation_counts_for_two():
    x = casadi.SX.sym("x", 3)
    count = made(casadi.sqrt(x[0] * x[1] + x[2]) / x[0], x).count()
    assert count == {"fma": 1, "sqrt": 1, "div": 1}
    assert flop(count) == 4


def test_the_longest_chain_is_waited_for_from_when_the_inputs_are_there():
    x = casadi.SX.sym("x", 2)
    chain = made(casadi.vertcat(casadi.sqrt(x[0] * x[0] * x[0]) + x[1], x[1] * x[1]), x)
    point = Waiting(chain, np.ones((2, 1)))
    assert [float(t[0]) for t in point.ready(WAIT, {})] == [4 + 4 + 20 + 3, 4]
    late = [np.zeros(1), np.full(1, 100.0)]
    assert [float(t[0]) for t in point.ready(WAIT, {0: late})] == [103, 104]


def test_only_the_side_that_is_taken_is_counted_and_waited_for():
    """A side that is worth a branch: three roots."""
    x = casadi.SX.sym("x", 2)
    roots = casadi.sqrt(casadi.sqrt(casadi.sqrt(x[1])))
    chosen = made(casadi.if_else(x[0] < 0, roots, x[1]), x)
    point = Waiting(chosen, np.array([[-1.0, 1.0, 2.0, 3.0], [4.0, 4.0, 4.0, 4.0]]))
    np.testing.assert_array_equal(point.ready(WAIT, {})[0], [60, 0, 0, 0])
    assert point.count()["sqrt"] == 3 / 4
    assert chosen.count()["sqrt"] == 3
