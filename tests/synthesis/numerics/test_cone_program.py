"""Cone programs: what a solver's word means, and the same program in cvxpy."""

import clarabel
import cvxpy
import numpy as np
import pytest
import scs
from scipy import sparse
from test_lying_solvers import QUESTIONS

from synthesis.numerics.program import cone_program
from synthesis.numerics.program.answer import Answer
from synthesis.numerics.program.cone_program import ConeProgram, Solver, solve


@pytest.mark.parametrize("question", QUESTIONS)
def test_cvxpy_has_the_same_optimum(question, monkeypatch):
    """Of the programs of every question: handed on, and solved by another solver."""
    posed = []
    honest = cone_program._interruptible

    def kept(method, program, solver):
        answer, x, word, dual = honest(method, program, solver)
        if word == "Solved" and len(program.c) < 200:
            posed.append((program, x))
        return answer, x, word, dual

    monkeypatch.setattr(cone_program, "_interruptible", kept)
    QUESTIONS[question]()
    assert posed
    for program, x in posed[:2]:
        problem, _ = program.to_cvxpy()
        problem.solve(solver="CLARABEL", tol_gap_abs=1e-8, tol_gap_rel=1e-8, tol_feas=1e-8)
        # both end 1e-8 from it, in the units of the larger of cost and 1
        assert problem.value == pytest.approx(program.c @ np.asarray(x), rel=1e-5, abs=1e-6)


def test_every_status_of_a_solver_has_an_answer():
    words = {name for name in dir(clarabel.SolverStatus) if name[0] != "_"}
    assert words == {*cone_program._CLARABEL}
    numbers = {n for name, n in vars(scs).items() if name.isupper() and type(n) is int}
    assert numbers == {*cone_program._SCS}
    s = cvxpy.settings
    assert {*s.SOLUTION_PRESENT, *s.INF_OR_UNB, s.SOLVER_ERROR} == {*cone_program._CVXPY}


@pytest.mark.parametrize("solver", ["CLARABEL", "SCS"])
def test_almost_infeasible_is_no_answer(solver):
    """x >= 1 and x <= 1 - e: infeasible for e = 1; where e is the tolerance, nothing is said."""
    for gap, answers in ((1.0, {Answer.INFEASIBLE}), (1e-12, {Answer.SOLVED, Answer.FAILED})):
        A = sparse.csc_matrix([[-1.0], [1.0]])
        program = ConeProgram(np.zeros(1), A, np.array([-1.0, 1.0 - gap]), (1, 1))
        assert solve(program, Solver(solver)).answer in answers


def test_one_status_of_each_solver_means_infeasible():
    for table in (cone_program._CLARABEL, cone_program._SCS, cone_program._CVXPY):
        assert sum(answer is Answer.INFEASIBLE for answer in table.values()) == 1
