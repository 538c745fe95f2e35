"""Listed models in any order: growth against known joint spectral radii, gains against other
routes, designs against those over a parameter; what is proven is proven by the checker too.
"""

import json
import math
from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm

import synthesis
from symheli import LinearModel, LPVStateSpace, Scheduling
from symheli.errors import InputError, SynthesisError
from synthesis import Plant, l2_gain
from synthesis.checker import report
from synthesis.switching import ListedBound, growth_rate, listed_feedback, listed_gain
from synthesis.switching.listed_inequality import Listed, holds, lifted, monomials

KNOWN = {
    "two states": ([[[-1, -1], [-4, 0]], [[3, 3], [-2, 1]]], 3.917384715148),
    "golden": ([[[0, 1, 1], [1, 0, 0], [0, -1, 0]], [[0, 1, 0], [-1, 0, 1], [-1, 0, 0]]],
               (1 + math.sqrt(5)) / 2),
    "three of four states": (
        [[[0, 1, 7, 4], [1, 6, -2, -3], [-1, -1, -2, -6], [3, 0, 9, 1]],
         [[-3, 3, 0, -2], [-2, 1, 4, 9], [4, -3, 1, 1], [1, -5, -1, -2]],
         [[1, 4, 5, 10], [0, 5, 1, -4], [0, -1, 4, 6], [-1, 5, 0, 1]]], 8.914964),
    "nilpotent": ([[[0, 1], [0, 0]], [[0, 0], [1, 0]]], 1.0),
}  # fmt: skip
"""Joint spectral radii of the examples of SwitchOnSafety.jl."""


def listed(rng, count, n, dt, spread=0.3):
    A = rng.normal(size=(n, n)) * (0.2 if dt else 1.0) - (0.0 if dt else 4.0) * np.eye(n)
    return [
        LinearModel(
            A + spread * (0.3 if dt else 1.0) * rng.normal(size=(n, n)),
            rng.normal(size=(n, 2)),
            rng.normal(size=(1, n)),
            rng.normal(size=(1, 2)),
            [f"x{i}" for i in range(n)],
            ["u", "v"],
            ["y"],
            dt=dt,
        )
        for _ in range(count)
    ]


@pytest.mark.parametrize("name", KNOWN)
def test_the_joint_spectral_radius_is_known_to_a_part_in_ten_thousand(name):
    modes, radius = KNOWN[name]
    found = growth_rate(np.array(modes, float), dt=1.0)
    assert found.verified
    assert_allclose(found.lower, radius, rtol=1e-6)
    # the search ends within 1e-4 of the lower bound
    assert radius * (1 - 1e-6) <= found.bound <= radius * 1.00011


def test_the_growth_that_is_named_is_attained_by_its_word():
    modes, _ = KNOWN["three of four states"]
    found = growth_rate(np.array(modes, float), dt=1.0, effort=1.0)
    through = np.eye(4)
    for i in found.word:
        through = np.array(modes[i]) @ through
    radius = np.abs(np.linalg.eigvals(through)).max()
    assert_allclose(radius ** (1 / len(found.word)), found.lower, rtol=1e-9)


@pytest.mark.parametrize("shift", [-0.3, 0.3])
def test_an_exponent_may_have_either_sign_and_moves_with_the_modes(shift):
    """exp(t s) times the states: the exponent of A + s I is that of A plus s."""
    still = [np.array([[0.0, -1.0], [1.0, 0.0]]), np.array([[0.0, -1.4], [1.0, 0.0]])]
    found = growth_rate([A + shift * np.eye(2) for A in still])
    through = np.eye(2)
    for i, t in zip(found.word, found.times, strict=True):
        through = expm((still[i] + shift * np.eye(2)) * t) @ through
    rate = math.log(np.abs(np.linalg.eigvals(through)).max()) / sum(found.times)
    assert_allclose(rate, found.lower, atol=1e-9)
    assert found.verified
    assert found.lower <= found.bound <= found.lower + 0.01
    # a quarter turn of each in turn is no worse: the amplitude grows by sqrt(1.4) in both together
    quarters = math.log(math.sqrt(1.4)) / (0.5 * math.pi * (1 + 1 / math.sqrt(1.4)))
    assert found.lower - shift >= quarters - 1e-9


def test_monomials_move_as_the_states_move():
    rng = np.random.default_rng(5)
    A, x = rng.normal(size=(3, 3)), rng.normal(size=3)
    for degree in (2, 3):
        place = list(monomials(3, degree))

        def risen(x, place=place):
            return np.array([np.prod(x[list(word)]) for word in place])

        assert_allclose(lifted(A, degree, True) @ risen(x), risen(A @ x), rtol=1e-12)
        h = 1e-6
        slope = (risen(x + h * A @ x) - risen(x - h * A @ x)) / (2 * h)
        # central differences: an error of h^2
        assert_allclose(lifted(A, degree, False) @ risen(x), slope, rtol=1e-8, atol=1e-8)


def by_cvxpy(models):
    """Least gain of one P for all, written down anew."""
    n = models[0].A.shape[0]
    P, g = cp.Variable((n, n), symmetric=True), cp.Variable()
    held = [P >> 1e-8 * np.eye(n)]
    for m in models:
        if m.dt is None:
            top = cp.bmat([[m.A.T @ P + P @ m.A, P @ m.B], [m.B.T @ P, np.zeros((2, 2))]])
        else:
            AB = np.hstack([m.A, m.B])
            keep = np.hstack([np.eye(n), np.zeros((n, 2))])
            top = AB.T @ P @ AB - keep.T @ P @ keep
        CD = np.hstack([m.C, m.D])
        last = np.hstack([np.zeros((2, n)), np.eye(2)])
        form = top + CD.T @ CD - g * last.T @ last
        held.append(0.5 * (form + form.T) << 0)
    cp.Problem(cp.Minimize(g), held).solve(solver=cp.CLARABEL)
    return math.sqrt(g.value)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("dt", [None, 0.5])
def test_a_gain_is_at_most_that_of_a_common_function_and_at_least_the_attained_one(dt, seed):
    models = listed(np.random.default_rng(seed), 3, 3, dt)
    found = listed_gain(models)
    assert found.verified
    # solvers agree to 1e-6, back-offs end at 1e-5 of these well-scaled models
    assert found.lower * (1 - 1e-9) <= found.bound <= by_cvxpy(models) * (1 + 2e-5)


def test_the_gain_of_a_pair_is_that_over_a_parameter_that_jumps():
    a, b = listed(np.random.default_rng(11), 2, 3, None)
    p = Scheduling("p", "1", 0.0, 1.0, rate=math.inf)
    pair = [[M, N - M] for M, N in zip((a.A, a.B, a.C, a.D), (b.A, b.B, b.C, b.D), strict=True)]
    other = l2_gain(LPVStateSpace.polynomial(*pair, p), math.inf, search=None)
    # the bounded real lemma is convex in (A, B, C, D): mixtures are no worse than the two
    assert_allclose(listed_gain([a, b]).bound, other.gamma, rtol=1e-3)


def plants(over, dt=None):
    out = []
    for v in over:
        model = LinearModel(
            [[0.0, 1.0], [-1.0 - v, -0.2]] if dt is None else [[1.0, 0.1], [-0.1 * v, 0.98]],
            [[0.0, 0.0], [1.0, 1.0]],
            [[1.0, 0.0], [0.0, 0.0]],
            [[0.0, 0.0], [0.0, 0.5]],
            ["x", "v"],
            ["w", "u"],
            ["x", "cost"],
            dt=dt,
        )
        out.append(Plant(model, ["w"], ["x", "cost"], ["u"], ["x"]))
    return out


@pytest.mark.parametrize("scheduled", [False, True])
def test_a_design_proves_nearly_what_its_program_promises(scheduled):
    for dt in (None, 0.1):
        made = listed_feedback(plants((-0.5, 0.5), dt), scheduled=scheduled)
        assert made.proof.verified
        # the gains are those of 1.01 times the optimum, accepted up to 1.02 times that
        assert made.proof.bound <= 1.01 * 1.02 * made.optimum


def test_one_gain_each_is_the_design_over_a_parameter_that_jumps():
    p = Scheduling("p", "1", -0.5, 0.5, rate=math.inf)
    first, last = (plant.at(0.5) for plant in plants((-0.5, 0.5)))
    A = [0.5 * (first.A + last.A), last.A - first.A]
    model = LPVStateSpace.polynomial(
        A,
        [np.hstack([first.B1, first.B2])],
        [np.vstack([first.C1, np.eye(2)[1:]])],
        [np.vstack([np.hstack([first.D11, first.D12]), np.zeros((1, 2))])],
        p,
        states=["x", "v"],
        inputs=["w", "u"],
        outputs=["x", "cost", "v"],
    )
    plant = Plant(model, ["w"], ["x", "cost"], ["u"], ["x", "v"])
    made = listed_feedback(plants((-0.5, 0.5)), scheduled=True)
    # both minimise over X and Y(p), here affine; two solvers to 1e-3
    assert_allclose(made.optimum, synthesis.state_feedback(plant).optimum, rtol=1e-3)


def test_what_cannot_be_stabilized_by_one_gain_is_refused_with_advice():
    def one(sign):
        model = LinearModel(
            [[1.0]], [[1.0, sign]], [[1.0], [0.0]], [[0.0, 0.0], [0.0, 0.1]],
            ["x"], ["w", "u"], ["x", "cost"],
        )  # fmt: skip
        return Plant(model, ["w"], ["x", "cost"], ["u"], ["x"])

    both = [one(1.0), one(-1.0)]
    with pytest.raises(SynthesisError, match="scheduled=True"):
        listed_feedback(both)
    assert listed_feedback(both, scheduled=True).proof.verified


@pytest.fixture(scope="module")
def bounds():
    rng = np.random.default_rng(2)
    return [
        growth_rate(np.array(KNOWN["two states"][0], float), dt=0.5),
        growth_rate([[[-0.3, -1.0], [1.0, 0.0]], [[-0.3, -1.5], [1.0, 0.0]]]),
        listed_gain(listed(rng, 2, 3, 1.0)),
        listed_gain(listed(rng, 2, 3, None)),
    ]


@pytest.mark.guard
@pytest.mark.parametrize("which", range(4))
def test_the_checker_proves_what_is_saved_and_no_forged_number(which, bounds, tmp_path, capsys):
    found = bounds[which]
    path = found.save(tmp_path / "bound.json")
    assert report.main([str(path)]) == 0
    said = capsys.readouterr().out
    assert found.claim in said
    assert ListedBound.load(path).bound == found.bound
    content = json.loads(path.read_text())
    # below the attained level no proof can be true
    below = found.lower - 1e-6 * abs(found.lower)
    forged = [{"bound": below}, {"letters": 0 if content["letters"] else 1}]
    forged += [{"degree": 0}, {"dt": None if content["dt"] else 1.0}]
    for name in ("A", "P"):
        array = json.loads(json.dumps(content[name]))
        array["array"][0] *= -1.5
        forged.append({name: array})
    for change in forged:
        other = tmp_path / "forged.json"
        other.write_text(json.dumps(content | change))
        assert report.main([str(other)]) != 0, change
        capsys.readouterr()


def test_models_that_do_not_fit_are_refused():
    with pytest.raises(InputError, match="at least one"):
        growth_rate([])
    with pytest.raises(InputError, match="the same states"):
        growth_rate([np.eye(2), np.eye(3)], dt=1.0)
    nothing = np.zeros((1, 0))
    one = LinearModel(-np.eye(1), nothing, nothing.T, np.zeros((0, 0)), ["x"], [], [])
    with pytest.raises(InputError, match="growth_rate without channels"):
        listed_gain([one])
    p = Scheduling("p", "1", 0.0, 1.0)
    model = LPVStateSpace.polynomial(
        [[[-1.0]], [[-1.0]]], [[[1.0, 1.0]]], [[[1.0]]], [[[0.0, 0.0]]], p,
        inputs=["w", "u"], outputs=["x"],
    )  # fmt: skip
    plant = Plant(model, ["w"], ["x"], ["u"], ["x"])
    with pytest.raises(InputError, match="without parameters"):
        listed_feedback([plant])


def test_a_p_that_is_not_symmetric_proves_nothing():
    # x -> [2 1; 1 2] x grows by 3; the lower triangles of P and P - A'PA are positive definite
    A, P = np.array([[[2.0, 1.0], [1.0, 2.0]]]), np.array([[[1.0, -10.0], [0.0, 1.0]]])
    models = Listed(A, np.zeros((1, 2, 0)), np.zeros((1, 0, 2)), np.zeros((1, 0, 0)), 1.0)
    for form in (P[0], P[0] - A[0].T @ P[0] @ A[0]):
        assert np.linalg.eigvalsh(np.tril(form) + np.tril(form, -1).T)[0] > 0
    assert not holds(models, P, 0, 1.0, 1, False)


@pytest.mark.parametrize("which", [0, 2, 3])
def test_a_factor_or_a_gain_below_zero_is_not_proven(which, bounds):
    found = bounds[which]
    assert found.verify()
    assert not replace(found, value=-found.bound).verify()
