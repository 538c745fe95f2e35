"""The C kernel and its NumPy twin: one algorithm, one memory, the same numbers; and both what batch
formulas say.
"""

import numpy as np
import pytest
from known_systems import Truth, moving, structure

import identification as idn
from identification.recursive import kernel
from identification.recursive.kernel import twin
from identification.recursive.kernel.configuration import KernelConfiguration
from identification.recursive.online import Online
from identification.structure.regressors import regression
from symheli import lpv
from symheli.lpv import CubicSpline
from symheli.records import FlightRecord

WAYS = (
    1.0,
    0.98,
    idn.forgetting.Constant(0.9, floor=0.0),
    idn.forgetting.Variable(longest=200, shortest=20, recent=10, usual=100),
    idn.forgetting.Directional(0.97, quiet=0.05),
)
STRUCTURES = {
    "two outputs, offset, rate": structure(
        outputs=("a", "b"), inputs=("u", "v"), offset=True, offset_rate=True
    ),
    "no inputs, one lag": structure(inputs=(), na=1, nb=0, basis=idn.Polynomial(0, 0.0, 13.0)),
    "spline, current p": structure(
        basis=CubicSpline((0.0, 2.0, 6.0, 10.0, 13.0)), scheduling_at="now", delay=0, nb=3
    ),
    "nine outputs": structure(
        outputs=tuple("abcdefghi"), na=1, nb=1, basis=idn.Polynomial(1, 0.0, 13.0)
    ),
}


def both(rls):
    if kernel.compiled_kernel(rls.precision) is None:
        pytest.skip("no compiled kernel is installed")
    return Online(rls.configuration, rls._kernel, rls.init()), Online(
        rls.configuration, twin.Kernel(rls.configuration), rls.init()
    )


def awkward(arx, n=160):
    """Rows [y, u, p] with a silence, a missing sample, a jump, sizes far apart, and p that rests
    and creeps before it moves.
    """
    rng = np.random.default_rng(3)
    rows = np.column_stack([rng.normal(size=(n, arx.ny + arx.nu)), moving(n)])
    rows[:5, :-1] *= 1e-6
    rows[:20, -1] = 3.0
    rows[20:40, -1] = 3.0 + 1e-5 * np.arange(20)
    rows[60, 0] = np.nan
    rows[90:120, :-1] = 0.0
    rows[130:, 0] *= 50.0
    return rows


@pytest.mark.slow(
    only=(
        "two outputs, offset, rate-Constant(factor=0.9, floor=0.0)-double",
        "two outputs, offset, rate-Constant(factor=0.9, floor=0.0)-single",
        "spline, current p-Constant(factor=0.9, floor=0.0)-single",
        "nine outputs-Constant(factor=0.9, floor=0.0)-double",
        "nine outputs-Constant(factor=0.9, floor=0.0)-single",
    )
)
@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("way", WAYS, ids=str)
@pytest.mark.parametrize("name", STRUCTURES)
def test_c_and_numpy_agree_to_the_last_bit(name, way, precision):
    """The same IEEE operations in the same order, no contraction: there is nothing to differ by, so
    no tolerance either.
    """
    compiled, numpy = both(idn.RecursiveLeastSquares(STRUCTURES[name], way, precision=precision))
    for a, b in zip(
        compiled.run(awkward(STRUCTURES[name])), numpy.run(awkward(STRUCTURES[name])), strict=True
    ):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(compiled.state.memory, numpy.state.memory)
    np.testing.assert_array_equal(compiled.gain, numpy.gain)
    assert np.isfinite(compiled.coefficients).all()


@pytest.mark.parametrize("precision", ["double", "single"])
def test_an_output_that_speaks_up_late_explains_all_of_a_sample(precision):
    """Nothing is known of the first of eight outputs when the ninth, in the next block of rows, has
    long been measured: the new row takes all that is left of the sample, and none of it may reach
    the next block.
    """
    arx = STRUCTURES["nine outputs"]
    rows = awkward(arx)[:40]
    rows[:20, :8] = 0.0
    compiled, numpy = both(idn.RecursiveLeastSquares(arx, precision=precision))
    compiled.run(rows)
    numpy.run(rows)
    np.testing.assert_array_equal(compiled.state.memory, numpy.state.memory)


def split():
    """Output a knows its own past and u; b everything: two factors."""
    orders = {"a": {"a": 2, "b": 0}, "b": 2}
    return idn.LPVARX(
        ("a", "b"), ("u",), "p", na=orders, nb=1, delay=1, basis=idn.Polynomial(1, 0.0, 13.0)
    )


def test_c_and_numpy_agree_where_outputs_have_different_regressors():
    compiled, numpy = both(idn.RecursiveLeastSquares(split(), 0.99))
    for a, b in zip(compiled.run(awkward(split())), numpy.run(awkward(split())), strict=True):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(compiled.state.memory, numpy.state.memory)


def test_block_diagonal_estimates_are_those_of_least_squares_output_by_output():
    arx = split()
    record = Truth(arx).record(moving(300), noise=0.1)
    state = idn.RecursiveLeastSquares(arx).run(record).state
    data = regression(arx, record)
    for j, group in enumerate(arx.groups):
        columns = arx.regressors(group)
        expected = np.linalg.lstsq(data.phi[:, columns], data.y[:, j], rcond=None)[0]
        # two backward stable methods on a problem of condition below 1e3
        np.testing.assert_allclose(state.theta[columns, j], expected, rtol=0, atol=1e-11)
        np.testing.assert_allclose(state.solve()[columns, j], expected, rtol=0, atol=1e-11)
        absent = np.setdiff1d(np.arange(arx.n_regressors), columns)
        assert not state.theta[absent, j].any()
    assert [f.shape for f in state.factors] == [(7, 7), (11, 11)]
    assert state.residual_covariance[0, 1] == 0.0


SQUARES = (np.ones_like, np.square)
BESIDE = {
    "two parameters": lpv.Product(
        (idn.Polynomial(1, 0.0, 13.0), lpv.PiecewiseLinear((-1.0, 0.0, 1.0))), None
    ),
    "total degree": lpv.Product((idn.Polynomial(2, 0.0, 13.0), idn.Polynomial(2, -1.0, 1.0)), 2),
    "one's own functions": lpv.UserFunctions(SQUARES, 0.0, 13.0),
}


@pytest.mark.slow(but="one's own functions-double")
@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("name", BESIDE)
def test_other_bases_give_what_batch_least_squares_gives(name, precision):
    basis = BESIDE[name]
    p = ("v", "s")[: basis.dimension]
    arx = structure(scheduling=p, basis=basis, offset=True, offset_rate=True, na=1)
    rng = np.random.default_rng(1)
    k = np.arange(400)
    columns = {
        "y": rng.normal(size=400),
        "u": rng.normal(size=400),
        "v": moving(400),
        "s": np.sin(0.53 * k),
    }
    record = FlightRecord.from_arrays(0.1 * k, dict.fromkeys(columns, "1"), **columns)
    rls = idn.RecursiveLeastSquares(arx, precision=precision)
    history = rls.run(record)
    data = regression(arx, record)
    best = np.linalg.lstsq(data.phi, data.y, rcond=None)[0]
    # predictions of size 1; condition below 1e3, twice the rounding errors of 400 samples
    tolerance = 1e-10 if precision == "double" else 1e-2
    np.testing.assert_allclose(
        data.phi @ history.state.theta, data.phi @ best, rtol=0, atol=tolerance
    )
    single = rls.online()
    for row in np.column_stack([columns[c] for c in ("y", "u", *p)]):
        single.update(row[:1], row[1:2], row[2] if len(p) == 1 else row[2:])
    np.testing.assert_array_equal(single.state.memory, history.state.memory)
    compiled, numpy = both(rls)
    rows = np.column_stack([columns[c] for c in ("y", "u", *p)])
    for a, b in zip(compiled.run(rows), numpy.run(rows), strict=True):
        np.testing.assert_array_equal(a, b)


def test_basis_in_the_kernel_is_the_basis_of_the_structure():
    """Its Bernstein form against Legendre's recursion and SciPy's splines."""
    for basis in (idn.Polynomial(5, -3.0, 13.0), CubicSpline((0.0, 1.0, 4.0, 9.0, 13.0))):
        (factor,) = KernelConfiguration(
            structure(basis=basis), idn.forgetting.Constant(), np.float64
        ).factors
        for p in np.linspace(basis.low, basis.high, 41):
            # Legendre's fifth has Bernstein coefficients of up to 330: a few roundings of those
            np.testing.assert_allclose(twin.evaluate(factor, p), basis(p), rtol=0, atol=1e-12)


def test_directional_forgetting_is_its_formula():
    """Cao and Schwartz: R <- R - (1 - l) R phi phi' R / (phi' R phi) + phi phi', R the
    information.
    """
    arx, rng, factor = (
        structure(inputs=(), na=2, nb=0, basis=idn.Polynomial(1, 0.0, 13.0)),
        np.random.default_rng(0),
        0.9,
    )
    rls = idn.RecursiveLeastSquares(arx, idn.forgetting.Directional(factor, quiet=0.0))
    online, n = rls.online(), arx.n_regressors
    information = np.zeros((n, n))
    for k in range(60):
        phi, y = rng.normal(size=n), rng.normal(size=1)
        online.absorb(phi, y)
        if k == 9:  # by then the prior is 1e-17 of what the data say
            information = online.state.factor[:n, :n].T @ online.state.factor[:n, :n]
        elif k > 9:
            v = information @ phi
            information = (
                information - (1 - factor) * np.outer(v, v) / (phi @ v) + np.outer(phi, phi)
            )
    R = online.state.factor[:n, :n]
    np.testing.assert_allclose(R.T @ R, information, rtol=1e-10)
    np.testing.assert_allclose(online.state.solve(), online.state.theta, rtol=0, atol=1e-12)


def test_a_regressor_that_never_moves_keeps_its_coefficient_and_the_others_are_found():
    arx = structure(inputs=("u", "dead"), na=1, nb=1)
    record = Truth(arx).record(moving(200), noise=0.1)
    record = record.with_signals({"dead": "1"}, dead=np.zeros(200))
    state = idn.RecursiveLeastSquares(arx).run(record).state
    without = structure(inputs=("u",), na=1, nb=1)
    expected = idn.fit(without, record).theta
    assert not state.determined
    np.testing.assert_array_equal(state.theta[-3:], 0.0)
    np.testing.assert_allclose(state.theta[:-3], expected, rtol=0, atol=1e-11)


def test_two_regressors_that_move_together_are_shared_out_without_blowing_up():
    arx = structure(inputs=("u", "twin"), na=1, nb=1)
    record = Truth(arx).record(moving(400), noise=0.1)
    record = record.with_signals({"twin": "1"}, twin=0.7 * record["u"])
    history = idn.RecursiveLeastSquares(arx).run(record)
    assert not history.state.determined
    assert np.abs(history.coefficients[20:]).max() < 10
    # both routes to the coefficients, the gain and the factor, leave the same ones alone
    np.testing.assert_allclose(history.state.theta, history.state.solve(), rtol=0, atol=1e-9)
    data = regression(arx, record)
    best = np.linalg.lstsq(data.phi, data.y, rcond=None)[0]
    # many coefficients explain the data alike; the residual is that of all of them
    np.testing.assert_allclose(data.phi @ history.state.theta, data.phi @ best, rtol=0, atol=1e-9)


def test_online_run_and_single_updates_agree():
    truth = Truth(structure())
    record = truth.record(moving(100), noise=0.1)
    rls = idn.RecursiveLeastSquares(truth.arx, 0.99)
    a, b, rows = (
        rls.online(),
        rls.online(),
        np.column_stack([record["y"], record["u"], record["p"]]),
    )
    a.run(rows, history=False)
    for y, u, p in rows:
        b.update([y], u, p)
    np.testing.assert_array_equal(a.state.memory, b.state.memory)
    np.testing.assert_array_equal(b.coefficients, b.state.theta)
    assert a.determined == b.determined == b.state.determined


@pytest.mark.skipif(
    kernel.compiled_kernel("single") is None, reason="ten million samples want the compiled kernel"
)
@pytest.mark.slow
def test_single_precision_that_never_forgets_says_when_it_is_full():
    arx = structure(na=1, nb=1, basis=idn.Polynomial(0, 0.0, 13.0))
    rng = np.random.default_rng(0)
    rows = np.column_stack([rng.normal(size=(100_000, 2)), np.full(100_000, 5.0)])
    online = idn.RecursiveLeastSquares(arx, precision="single").online()
    for _ in range(83):
        online.run(rows, history=False)
    assert not online.saturated
    online.run(
        rows, history=False
    )  # 8.4e6 > 1 / eps = 8388608 - the weight has counted every sample
    assert online.saturated
    assert online.state.count == 8_400_000 - 1
    assert np.isfinite(online.coefficients).all()


def test_the_twin_takes_over_with_one_warning(monkeypatch):
    from symheli.errors import CompilerWarning

    monkeypatch.setenv("SYMHELI_COMPILE", "0")
    kernel.compiled_kernel.cache_clear()
    kernel._without.cache_clear()
    try:
        with pytest.warns(
            CompilerWarning, match="SYMHELI_COMPILE=0: recursive estimates run in NumPy"
        ) as caught:
            states = [idn.RecursiveLeastSquares(structure()).init() for _ in range(3)]
        assert len(caught) == 1
        assert isinstance(idn.RecursiveLeastSquares(structure())._kernel, twin.Kernel)
        assert not states[0].determined
    finally:
        kernel.compiled_kernel.cache_clear()
