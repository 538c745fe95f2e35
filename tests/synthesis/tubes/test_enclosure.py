"""Bounds over sets contain every point of them, and are not much wider than they must be."""

import casadi
import mpmath
import numpy as np
import pytest

from symheli import Helicopter, trim
from symheli.codegen.evaluate import evaluate
from symheli.codegen.translation import operations
from symheli.errors import InputError
from synthesis.tubes.enclosure import Domain, enclose, interval, segment_averages
from synthesis.tubes.enclosure.form import AffineForm
from synthesis.tubes.enclosure.interval import Interval

RNG = np.random.default_rng(0)


def function(build, *sizes, name="f"):
    symbols = [casadi.SX.sym(f"x{i}", n) for i, n in enumerate(sizes)]
    return casadi.Function(name, symbols, [build(*symbols)])


def contains(form, symbols, values, slack=1e-15):
    """Whether values (count, [sets,] outputs) at these symbols (count, [sets,] m) lie in the form
    [sets,] outputs; symbols of kinks, beyond those, may have any value.
    """
    own = symbols.shape[-1]
    line = form.centre + (form.slopes[..., :own] @ symbols[..., None])[..., 0]
    rest = form.rest + np.abs(form.slopes[..., own:]).sum(axis=-1)
    slack = slack * (1 + np.abs(values))
    bound = form.interval
    inside = np.abs(values - line) <= rest * (1 + 1e-12) + slack
    return np.all(inside & (values >= bound.lower - slack) & (values <= bound.upper + slack))


def sampled(f, domains, count):
    """Values of a function at random points of its domains, and the symbols there."""
    drawn = [d.sample(RNG, count) for d in domains]
    symbols = np.concatenate([z for _, z in drawn], axis=-1)
    points = [[x[..., i] for i in range(x.shape[-1])] for x, _ in drawn]
    outputs = evaluate(operations(f), *points)[0]
    values = [np.broadcast_to(v, (count, *np.shape(drawn[0][0])[1:-1])) for v in outputs]
    return symbols, np.stack(values, axis=-1)


DISK = Domain.ellipsoid([0.0, 0.0], np.eye(2))
SQUARE = Domain.box([-1.0, -1.0], [1.0, 1.0])


@pytest.mark.parametrize(
    ("build", "domain", "lower", "upper"),
    [
        (lambda x: x[0] * x[1], DISK, -0.5, 0.5),  # eigenvalues of the quadratic form
        (lambda x: x[0] * x[1], SQUARE, -1.0, 1.0),
        (lambda x: x[0] ** 2, DISK, 0.0, 1.0),
        (lambda x: x[0] + x[1], DISK, -np.sqrt(2), np.sqrt(2)),
        (lambda x: x[0] - x[0], DISK, 0.0, 0.0),  # dependencies are not forgotten
        (lambda x: casadi.sin(x[0]), SQUARE, -np.sin(1), np.sin(1)),
        (lambda x: casadi.fabs(x[0]), SQUARE, 0.0, 1.0),
        (lambda x: casadi.sqrt(x[0] + 1.25), SQUARE, 0.5, 1.5),
        (lambda x: 1 / (x[0] + 3), SQUARE, 0.25, 0.5),
        (lambda x: casadi.fmax(x[0], x[1]), SQUARE, -1.0, 1.0),
        (lambda x: casadi.if_else(x[0] > 0, 2.0, 1.0), SQUARE, 1.0, 2.0),
        (lambda x: casadi.atan2(x[0], x[1] + 3), SQUARE, -np.arctan(0.5), np.arctan(0.5)),
    ],
)
def test_known_ranges_are_met(build, domain, lower, upper):
    bound = enclose(function(build, 2), domain).value.interval
    assert bound.lower[0] <= lower + 1e-15
    assert bound.upper[0] >= upper - 1e-15
    # as wide as the range itself, but for rounding
    np.testing.assert_allclose([bound.lower[0], bound.upper[0]], [lower, upper], atol=1e-9)


ALL = [
    lambda x: casadi.sin(x[0]) * casadi.exp(x[1]) - casadi.cos(x[0] * x[1]),
    lambda x: casadi.sqrt(x[0] ** 2 + x[1] ** 2 + 1e-20) * x[2],
    lambda x: casadi.fmin(x[0], casadi.fmax(x[1], x[2])) / (2 + x[0] * x[2]),
    lambda x: casadi.asin(0.4 * x[0] * x[1]) + casadi.atan2(x[2], 2.5 + x[0]),
    lambda x: casadi.fabs(x[0] - x[1]) * casadi.if_else(x[2] > 0.1, x[0], 1 - x[1]),
    lambda x: (x[0] + 0.1) ** 3 / 7 - casadi.tan(x[1]),
    lambda x: casadi.sign(x[0]) + casadi.logic_and(x[1] > 0, x[2] <= 0.2) * x[0],
]


@pytest.mark.parametrize("build", ALL)
@pytest.mark.parametrize("size", [1.0, 0.1, 1e-4])
def test_no_sample_lies_outside(build, size):
    # 40 sets at once: ellipsoids and boxes
    f = function(build, 3)
    centres = RNG.uniform(-0.6, 0.6, (40, 3))
    shapes = 0.25 * size * RNG.standard_normal((40, 3, 3))
    for domain in (
        Domain.ellipsoid(centres, shapes),
        Domain.box(centres - 0.3 * size, centres + 0.3 * size),
    ):
        found = enclose(f, domain)
        assert np.all(found.finite)
        assert contains(found.value, *sampled(f, [domain], 2000))


SMOOTH_OR_KINKED = [*ALL[:4], ALL[5], lambda x: casadi.fabs(x[0]) * x[1] - casadi.fmax(x[1], x[2])]


@pytest.mark.parametrize("build", SMOOTH_OR_KINKED)
def test_no_sample_of_the_jacobian_lies_outside(build):
    f = function(build, 3)
    x = casadi.SX.sym("x", 3)
    gradient = casadi.Function("g", [x], [casadi.jacobian(f(x), x).T])
    centres = RNG.uniform(-0.6, 0.6, (20, 3))
    domain = Domain.ellipsoid(centres, 0.15 * RNG.standard_normal((20, 3, 3)))
    found = enclose(f, domain, by=[0])
    symbols, values = sampled(gradient, [domain], 1000)
    assert np.all(found.finite)
    assert contains(found.jacobian[:, 0], symbols, values)


def test_the_remainder_falls_with_the_square_of_the_size():
    f = function(ALL[0], 3)
    rests = [
        enclose(f, Domain.box(np.full(3, 0.3 - h), np.full(3, 0.3 + h)), by=[0])
        for h in (0.1, 0.01)
    ]
    for part in ("value", "jacobian"):
        wide, narrow = (getattr(r, part).rest.max() for r in rests)
        assert 50 < wide / narrow < 200


def test_rounding_is_part_of_the_bounds():
    # a point: what remains are rounding errors, and mpmath's value lies within them
    f = function(lambda x: casadi.sin(x[0]) / 3 + 0.1 * x[1] * x[1] - casadi.exp(x[2]) / x[0], 3)
    mpmath.mp.prec = 200
    for x in RNG.uniform(0.5, 2, (50, 3)):
        bound = enclose(f, Domain.point(x)).value.interval
        a, b, c = map(mpmath.mpf, x.tolist())
        exact = mpmath.sin(a) / 3 + mpmath.mpf(0.1) * b * b - mpmath.exp(c) / a
        assert mpmath.mpf(bound.lower[0]) <= exact <= mpmath.mpf(bound.upper[0])
        assert bound.upper[0] - bound.lower[0] < 1e-13
    mpmath.mp.prec = 53


@pytest.mark.parametrize("name", ["sin", "cos", "exp", "asin", "atan"])
def test_elementary_functions_without_python_flint(name, monkeypatch):
    low = RNG.uniform(-0.9, 0.8, 50)
    x = Interval(low, low + RNG.uniform(0, 0.1, 50))
    first = x.apply(name)
    interval._elementary.cache_clear()
    monkeypatch.setitem(__import__("sys").modules, "flint", None)
    second = x.apply(name)
    monkeypatch.undo()
    interval._elementary.cache_clear()
    for bounds in (first, second):
        for t in (x.lower, x.middle, x.upper):
            exact = np.array([float(getattr(mpmath, name)(v)) for v in t])
            assert np.all(bounds.lower <= exact)
            assert np.all(exact <= bounds.upper)
    np.testing.assert_allclose(first.lower, second.lower, atol=1e-8)
    np.testing.assert_allclose(first.upper, second.upper, atol=1e-8)


def test_a_function_that_may_jump_has_no_slope_unless_known_to_be_continuous():
    f = function(lambda x: casadi.if_else(x[0] > 0, x[0] + 1, x[0]), 1)
    g = function(lambda x: casadi.if_else(x[0] > 0, 2 * x[0], 1 * x[0]), 1)
    both = Domain.box([-1.0], [1.0])
    assert not enclose(f, both, by=[0]).finite
    known = enclose(g, both, by=[0], continuous=True).jacobian.interval
    np.testing.assert_allclose([known.lower[0, 0], known.upper[0, 0]], [1, 2])
    right = enclose(f, Domain.box([0.1], [1.0]), by=[0])
    assert right.jacobian.interval.upper[0, 0] == pytest.approx(1)


def test_a_kink_has_one_symbol_for_all_derivatives():
    f = function(lambda x: casadi.fabs(x[0] + x[1]), 2)
    found = enclose(f, SQUARE, by=[0])
    assert found.symbols == 2
    assert found.jacobian.slopes.shape == (1, 2, 3)
    np.testing.assert_allclose(found.jacobian.slopes[0, :, 2], 1.0)
    np.testing.assert_allclose(found.jacobian.rest, 0.0, atol=1e-12)
    # an average over segments halves what is linear in the domain, not what a kink leaves open
    g = function(lambda x: casadi.fabs(x[0]) + x[0] ** 2, 2)
    average, switched, _ = segment_averages(g, SQUARE, along=[0])
    np.testing.assert_allclose(average.slopes[0, 0], [1.0, 0.0])
    np.testing.assert_allclose(switched[:, 0, 0, 0], 1.0)


def test_a_kink_of_a_kink_leaves_no_remainder():
    # y = x0 + |x1|: d|y| = s [1, t], s and t the signs of y and x1
    f = function(lambda x: casadi.fabs(x[0] + casadi.fabs(x[1])), 2)
    found = enclose(f, SQUARE, by=[0])
    np.testing.assert_allclose(found.jacobian.centre, 0.0)
    np.testing.assert_allclose(found.jacobian.rest, 0.0, atol=1e-12)
    np.testing.assert_allclose(sorted(found.jacobian.slopes[0, :, 2:].T.tolist()), [[0, 1], [1, 0]])
    average, switched, turning = segment_averages(f, SQUARE, along=[0])
    np.testing.assert_allclose(average.rest, 0.0, atol=1e-12)
    for piece in switched:
        numbers = piece[0].T[np.any(piece[0], axis=0)]
        np.testing.assert_allclose(sorted(numbers.tolist()), [[0, 1], [1, 0]], atol=1e-12)
    np.testing.assert_allclose(turning, 0.0, atol=1e-12)


def test_the_matrix_of_a_kink_turns_with_the_symbols():
    # |x0| x1, slopes s [x1, x0] on the side s: nothing is left, and half of the turn is the mean
    f = function(lambda x: casadi.fabs(x[0]) * x[1], 2)
    average, switched, turning = segment_averages(f, Domain.box([-1.0, 1.0], [1.0, 3.0]), along=[0])
    np.testing.assert_allclose(average.centre, 0.0, atol=1e-12)
    np.testing.assert_allclose(average.rest, 0.0, atol=1e-12)
    np.testing.assert_allclose(switched.mean(axis=0)[0, :, 0], [2.0, 0.0])
    # the last piece: the set is as large as the domain, the mean place in it 7/8
    np.testing.assert_allclose(turning[-1, 0, :, :, 0], 7 / 8 * np.array([[0.0, 1.0], [1.0, 0.0]]))


def test_the_size_of_a_number_and_its_sign_are_two_numbers():
    f = function(lambda x: casadi.vertcat(x[0] * casadi.fabs(x[0]), casadi.fabs(x[0])), 1)
    j = enclose(f, Domain.box([-1.0], [1.0]), by=[0]).jacobian
    # at x = -1 the slopes are 2 and -1, at 0 they are 0 and 1: no line holds these and (2, 1)
    kinks = j.slopes[0, :, 1:] if j.slopes.ndim == 4 else j.slopes[:, 0, 1:]
    assert np.linalg.matrix_rank(kinks) == 2


def test_the_slope_of_a_speed_is_bounded_where_it_passes_zero():
    f = function(lambda x: casadi.sqrt(x[0] ** 2 + x[1] ** 2), 2)
    slope = enclose(f, DISK, by=[0]).jacobian.interval
    np.testing.assert_allclose(slope.lower, -1)
    np.testing.assert_allclose(slope.upper, 1)


def test_where_a_function_is_not_defined_there_is_no_bound():
    for build in (
        lambda x: 1 / x[0],
        lambda x: casadi.asin(2 * x[0]),
        lambda x: casadi.tan(2 * x[0]),
        lambda x: casadi.sqrt(x[0]),
        lambda x: casadi.sqrt(x[0] - 2),
        lambda x: casadi.sqrt(x[0] + 0.999),
        lambda x: casadi.sin(casadi.sqrt(x[0])),
    ):
        found = enclose(function(build, 1), Domain.box([-1.0], [1.0]))
        assert not found.finite
        assert found.value.interval.upper[0] == np.inf


@pytest.mark.parametrize(
    "build",
    [
        lambda x: casadi.sqrt(casadi.fabs(x)),
        lambda x: casadi.sqrt(casadi.fmax(x, 0)),
        lambda x: casadi.sqrt(x**2 + 3 * x**4),
        lambda x: casadi.sqrt(casadi.fabs(x) * x**2 / 2),
        lambda x: casadi.sqrt(casadi.if_else(x > 0, x, 0)),
    ],
)
def test_a_root_of_what_is_not_negative_has_bounds_from_zero_on(build):
    """Rounded outwards a sum of squares would reach below zero, where there is no root."""
    bound = enclose(function(build, 1), Domain.box([-1.0], [1.0])).value.interval
    assert bound.lower[0] == 0.0
    assert 0.7 < bound.upper[0] < 2.001


def test_a_root_is_followed_over_the_set():
    # y^3 + y = x0 + x1: one root; dy/dx = 1/(3 y^2 + 1)
    x, y = casadi.SX.sym("x", 2), casadi.SX.sym("y")
    start = casadi.Function("s", [x], [casadi.SX(0.5)])
    f = casadi.Function("f", [x, y], [y * x[0], y**3 + y - x[0] - x[1]])
    domain = Domain.ellipsoid([1.0, 1.0], 0.2 * np.eye(2))
    found = enclose(f, domain, start=start, by=[0])
    points, symbols = domain.sample(RNG, 5000)
    root = points.sum(axis=1) / 2
    for _ in range(60):
        root -= (root**3 + root - points.sum(axis=1)) / (3 * root**2 + 1)
    slope = 1 / (3 * root**2 + 1)
    assert contains(found.roots, symbols, root[:, None])
    assert contains(found.value, symbols, (root * points[:, 0])[:, None])
    jacobian = np.stack([root + points[:, 0] * slope, points[:, 0] * slope], axis=1)
    assert contains(found.jacobian[0], symbols, jacobian)
    assert found.roots.rest[0] < 0.01


def test_two_roots_in_the_set_are_not_taken_for_one():
    # y^2 = x has two roots that meet at 0
    x, y = casadi.SX.sym("x"), casadi.SX.sym("y")
    start = casadi.Function("s", [x], [casadi.sqrt(casadi.fabs(x))])
    f = casadi.Function("f", [x, y], [y, y**2 - x])
    near = enclose(f, Domain.box([-0.1], [0.3]), start=start)
    far = enclose(f, Domain.box([0.9], [1.1]), start=start)
    assert not near.finite
    assert far.finite


def test_a_row_of_large_numbers_does_not_widen_the_others():
    """Both sides of a kink were enclosed only where it was large beside the remainder of all rows,
    of different units; the pitch rate's row held three times its remainder.
    """
    x = casadi.SX.sym("x", 2)
    kinked = casadi.fmax(x[0], 0) * casadi.exp(3 * x[1])
    large = 1e4 * casadi.exp(3 * x[0])
    alone, beside = (
        segment_averages(
            casadi.Function("f", [x], [casadi.vertcat(*rows)]),
            Domain.box([-0.3, -0.3], [0.3, 0.3]),
            along=[0],
        ).average.rest[0]
        for rows in ([kinked], [kinked, large])
    )
    np.testing.assert_array_equal(alone, beside)


@pytest.fixture(scope="module", params=["xcell60", "xcell_kahn_hudson", "yamaha_r50"])
def heli(request):
    return Helicopter.load(request.param, governor="ideal")


@pytest.mark.slow(but="xcell60-4.0")
@pytest.mark.parametrize("airspeed", [0.0, 4.0, 13.0])
def test_the_helicopter_and_its_jacobian(heli, airspeed):
    # against the compiled model with its own inflow solver: tolerance 1e-9, that of the solver
    point = trim(heli, airspeed=airspeed)
    sizes = 0.5 * np.array([0.5, 0.5, 0.5, 0.1, 0.1, 0.2, 0.05, 0.05, 0.02, 0.02])
    domains = [
        Domain.ellipsoid(np.array(point.x), np.diag(sizes)),
        Domain.point(np.array(point.u)),
        Domain.ellipsoid(np.zeros(3), 0.2 * np.eye(3)),
    ]
    found = enclose(heli.implicit, *domains, start=heli.inflow, by=[0, 1, 2])
    assert found.finite
    (x, z), (w, y) = domains[0].sample(RNG, 2000), domains[2].sample(RNG, 2000)
    symbols = np.concatenate([z, y], axis=1)
    u = np.array(point.u)
    rhs = casadi.Function("rhs", *_symbolic(heli, "rhs"))
    jacobian = casadi.Function("jacobian", *_symbolic(heli, "jacobian"))
    values = np.asarray(rhs.map(2000)(x.T, np.tile(u[:, None], 2000), w.T)).T
    A, B, E = (
        np.stack(np.split(np.asarray(m), 2000, axis=1))
        for m in jacobian.map(2000)(x.T, np.tile(u[:, None], 2000), w.T)
    )
    slopes = np.concatenate([A, B, E], axis=2)
    assert contains(found.value, symbols, values, 1e-9)
    for row, sample in enumerate(np.swapaxes(slopes, 0, 1)):
        assert contains(found.jacobian[row], symbols, sample, 1e-9)
    # not wider than 12 times what samples fill, row by row: first order is of use
    line = found.value.centre + symbols @ found.value.slopes[:, : found.symbols].T
    fill = np.abs(values - line).max(axis=0) / found.value.rest
    assert np.all(fill[found.value.rest > 1e-9] > 1 / 12)


def _symbolic(heli, name):
    x, u, w = casadi.SX.sym("x", 10), casadi.SX.sym("u", 4), casadi.SX.sym("w", 3)
    made = heli.dynamics.function(name, list(np.array(heli.parameters)))
    return [x, u, w], list(made.call([x, u, w]))


def test_equations_must_bring_one_variable_each():
    x, y = casadi.SX.sym("x"), casadi.SX.sym("y", 2)
    f = casadi.Function("f", [x, y], [y[0], casadi.vertcat(y[0] + y[1] - x, y[1] - x)])
    start = casadi.Function("s", [x], [casadi.vertcat(0, x)])
    with pytest.raises(InputError, match="one new variable"):
        enclose(f, Domain.box([0.0], [1.0]), start=start)


def test_wrong_domains_are_refused():
    f = function(lambda x: x[0], 2)
    with pytest.raises(InputError, match="sizes"):
        enclose(f, Domain.point([1.0]))
    g = function(lambda x, y: x[0] + y, 2, 1)
    with pytest.raises(InputError, match="sets"):
        enclose(g, Domain.point(np.zeros((2, 2))), Domain.point(np.zeros((3, 1))))
    with pytest.raises(InputError, match="lower <= upper"):
        Domain.box([1.0], [0.0])
    with pytest.raises(InputError, match="finite"):
        Domain.point([np.nan])
    with pytest.raises(InputError, match="groups"):
        Domain(np.zeros(2), np.eye(2), (1,))


@pytest.mark.slow
def test_a_million_samples_lie_inside():
    x = casadi.SX.sym("x", 3)
    f = casadi.Function("f", [x], [casadi.vertcat(*[build(x) for build in ALL])])
    domain = Domain.ellipsoid([0.1, -0.2, 0.15], 0.3 * np.eye(3))
    found = enclose(f, domain)
    for _ in range(10):
        assert contains(found.value, *sampled(f, [domain], 100_000))


def test_constants_and_known_forms_keep_their_shape():
    like = enclose(function(lambda x: x, 2), DISK).value
    np.testing.assert_allclose(AffineForm.constant(2.0, like).interval.lower, 2.0, rtol=1e-15)


def test_averages_along_segments_are_those_of_quadrature():
    def build(x):
        return (
            casadi.sin(x[0]) * x[1] + x[0] * casadi.fabs(x[1]) + x[1] * (3 + 2 * casadi.fabs(x[1]))
        )

    f = function(build, 2)
    slope = casadi.SX.sym("x", 2)
    jacobian = casadi.Function("j", [slope], [casadi.jacobian(f(slope), slope)])
    domain = Domain.ellipsoid([0.4, 0.05], [[0.3, 0.1], [0.0, 0.2]])
    average, switched, turning = segment_averages(f, domain, along=[0])
    points, z = domain.sample(RNG, 300)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    for x, own in zip(points, z, strict=True):
        on = domain.centre[:, None] + (x - domain.centre)[:, None] * (nodes + 1) / 2
        value = np.asarray(jacobian.map(200)(on)).reshape(1, 200, 2).transpose(1, 0, 2)
        mean = np.tensordot(weights / 2, value, axes=1)
        off = np.abs(mean - average.centre - average.slopes @ own)
        turned = np.abs(np.moveaxis(turning, -2, -1) @ own)
        kinks = (np.abs(switched) + turned).sum(axis=-1).mean(axis=0)
        # a quadrature over a kink is off by a jump of 2 over its 200 nodes
        assert np.all(off <= average.rest + kinks + 2e-2)


def test_remainders_of_averages_fall_with_the_pieces_of_a_segment():
    # derivative 3 x^2, whose form over [-1, 1] is 1.5 +- 1.5: a third of that is left by many
    f = function(lambda x: x[0] ** 3, 1)
    box = Domain.box([-1.0], [1.0])
    rest = [segment_averages(f, box, along=[0], pieces=k)[0].rest.item() for k in (1, 4, 32)]
    np.testing.assert_allclose(rest, [1.5, 1.5 * (1 + 4 + 9 + 16) / 64, 0.5], rtol=0.05)


def test_the_derivative_of_x_times_its_size_has_no_remainder_but_one_symbol():
    f = function(lambda x: 3 * (2 * x[0] + casadi.fabs(x[1])) * x[1], 2)
    found = enclose(f, Domain.ellipsoid([1.0, 0.02], 0.1 * np.eye(2)), by=[0])
    # 2 |x| over [-.08, .12]: between 0 and .24, from a line of slope .2 with half a width of .048
    np.testing.assert_allclose(found.jacobian.slopes[0, 1], [0.6, 0.12, 0.288], rtol=1e-9)
    assert found.jacobian.rest.max() < 1e-12
