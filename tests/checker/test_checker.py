"""The checker that stands alone: what it proves and refuses, and that it needs nothing else."""

import ast
import json
import math
import random
import shutil
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from models import spring
from scipy import linalg

from symheli import LinearModel, LPVStateSpace, Scheduling
from symheli.errors import SymheliError
from symheli.lpv import BSpline, CubicSpline, PiecewiseLinear, Polynomial
from synthesis import Certificate, decay_rate, h2_gain, l2_gain, lft_gain, stability, switching
from synthesis.analysis import energy_to_peak
from synthesis.certify.questions import certificate_file
from synthesis.certify.statement.sentences import motion
from synthesis.checker import dwell, report
from synthesis.checker.cells import cells
from synthesis.checker.demands import Claim, exponential, failure
from synthesis.checker.exact import pivots_positive, positive_definite, shown
from synthesis.checker.polynomials import bernstein_coefficients, variable
from synthesis.checker.reading import DAMAGED, Model, Parameter
from synthesis.forms import LaggedParameter, Spline
from synthesis.numerics.polynomial.exact import rational
from synthesis.sets import InvariantSet, LowComplexitySet, invariant_set, low_complexity_set

pytestmark = pytest.mark.guard

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "synthesis" / "checker"
FILES = sorted((ROOT / "tests" / "data" / "proofs").glob("*.json"))
DECIDED = [f for f in FILES if f.stem != "tube"]
PROVEN, NOT_PROVEN, UNKNOWN = 0, 1, 2
LINES = 3000
COARSE = Spline(segments=2, degree=2)
FORGED = 8
"""Numbers of each file that the default tests change."""


def checked(path, capsys):
    """Exit status and what is printed."""
    status = report.main([str(path)])
    return status, capsys.readouterr().out


def proven_by_the_package(path):
    for kind in (Certificate, InvariantSet, LowComplexitySet):
        try:
            found = kind.load(path)
        except SymheliError:
            continue
        return found.verify(rigorous=True) if kind is Certificate else found.verify()
    return False


def saved(content, path):
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def scheduled(basis, dt=None):
    """Two states, one input and output, fitted to the basis over [0, 13]."""
    p, s = np.linspace(0.0, 13.0, 40), Scheduling("p", "1", 0.0, 13.0, 2.0)
    A = np.array([[[-1 - q / 20, 1 + np.sin(q / 3) / 5], [q / 50 - 1, -0.5]] for q in p])
    B, C = np.array([[[0.0], [1 + q / 100]] for q in p]), np.tile([[1.0, 0.0]], (40, 1, 1))
    if dt:
        A, B = np.eye(2) + dt * A, dt * B
    fitted = (basis.fit(p, M) for M in (A, B, C, np.zeros((40, 1, 1))))
    return LPVStateSpace(basis, *fitted, (s,), ("a", "b"), ("u",), ("y",), dt)


LINEAR, CUBIC = PiecewiseLinear((0.0, 4.3, 13.0)), CubicSpline((0.0, 2.0, 5.1, 9.0, 13.0))
SMOOTH, QUADRATIC = BSpline(3, (0.0, 3.1, 7.7, 13.0)), Polynomial(2, 0.0, 13.0)
MADE = {
    "lag": lambda: l2_gain(
        scheduled(QUADRATIC), form=LaggedParameter(1.0, segments=3, degree=2), search=None
    ),
    "linear": lambda: l2_gain(scheduled(LINEAR), form=COARSE, search=None),
    "cubic": lambda: l2_gain(scheduled(CUBIC), form=COARSE, search=None),
    "B-spline": lambda: l2_gain(scheduled(SMOOTH, 0.05), form=COARSE, search=None),
    "decay, sampled": lambda: decay_rate(scheduled(QUADRATIC, 0.05), search=None),
    "peak, sampled": lambda: energy_to_peak(scheduled(QUADRATIC, 0.05), search=None),
    "H2, sampled": lambda: h2_gain(scheduled(QUADRATIC, 0.05), search=None),
    "stable, sampled": lambda: stability(scheduled(QUADRATIC, 0.05), form=COARSE, search=None),
}


@pytest.mark.parametrize("file", DECIDED, ids=lambda f: f.stem)
def test_a_saved_proof_is_proven_as_the_package_proves_it(file, capsys):
    status, said = checked(file, capsys)
    assert (status == PROVEN) == proven_by_the_package(file)
    assert said.splitlines()[-1] == "proven in exact arithmetic"


@pytest.mark.parametrize("name", MADE)
def test_other_bases_times_and_forms_are_proven_too(name, tmp_path, capsys):
    found = MADE[name]()
    assert found.verified
    assert checked(found.save(tmp_path / "proof.json"), capsys)[0] == PROVEN


def test_a_tube_is_not_decided_and_it_is_said_why(capsys):
    status, said = checked(next(f for f in FILES if f.stem == "tube"), capsys)
    assert status == UNKNOWN
    assert "nonlinear equations" in said


def test_a_copy_of_the_folder_alone_decides(tmp_path):
    shutil.copytree(FOLDER, tmp_path / "alone", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(FILES[0], tmp_path / "proof.json")
    command = [sys.executable, "-I", "-S", "alone", "proof.json"]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr) == (PROVEN, "")
    assert run.stdout.splitlines()[-1] == "proven in exact arithmetic"


def test_it_has_few_lines():
    files = [f for f in FOLDER.rglob("*") if f.is_file() and "__pycache__" not in f.parts]
    assert all(f.suffix == ".py" for f in files)
    assert sum(len(f.read_text(encoding="utf-8").splitlines()) for f in files) < LINES


def test_it_imports_the_standard_library_and_flint_alone():
    for file in FOLDER.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and not node.level:
                names = [str(node.module)]
            assert {n.partition(".")[0] for n in names} <= {*sys.stdlib_module_names, "flint"}


def test_a_gain_below_that_of_a_frozen_model_is_refused_with_place_and_size(tmp_path, capsys):
    content = json.loads((ROOT / "tests/data/proofs/l2-gain.json").read_text())
    content["gamma"] = 0.9999 * content["frozen"]
    status, said = checked(saved(content, tmp_path / "forged.json"), capsys)
    assert status == NOT_PROVEN
    assert "V falls with dp1/dt" in said
    assert "at p1 = " in said
    least = float(said.rpartition("at least ")[2])
    assert content["gamma"] < least < 1.1 * content["frozen"]


CLAIMS = {
    "decay-rate": [(("alpha",), 1.05)],
    "invariant-set": [(("state_bounds", 0, 1), 0.5), (("input_bounds", 0, 1), 0.5)],
    "l2-gain-uncertain": [(("gamma",), 0.99), (("proof", "block", "bound"), 1.5)],
    "stability-higher-order": [],
    "stability": [],
    "lft-stability": [],
}
"""The numbers of a claim, with factors that make it stronger; of other files `gamma`."""


@pytest.mark.parametrize("file", DECIDED, ids=lambda f: f.stem)
def test_a_stronger_claim_is_not_proven(file, tmp_path, capsys):
    for path, factor in CLAIMS.get(file.stem, [(("gamma",), 0.99)]):
        content = json.loads(file.read_text())
        exchange(content, path, lambda v, factor=factor: factor * v)
        status, said = checked(saved(content, tmp_path / "forged.json"), capsys)
        assert status == NOT_PROVEN, (path, said)


def exchange(content, path, change):
    for key in path[:-1]:
        content = content[key]
    content[path[-1]] = change(content[path[-1]])


# what serves the search and the eyes of the check in floating point alone
IGNORED = {"units", "elevation", "shape", "time", "shift"}


def numbers(value, path=()):
    """The places of all numbers of a proof that mean something."""
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, item in items:
        if key == "units" or (key in IGNORED and not isinstance(item, dict)):
            continue
        if path == ("proof",) and key == "coordinates":
            continue
        if isinstance(item, dict | list):
            yield from numbers(item, (*path, key))
        elif isinstance(item, int | float) and not isinstance(item, bool):
            yield (*path, key)


def not_false(content, path):
    """Whether the package's second witness finds no p at which it is false, whatever is written in
    words, as a forger writes them.
    """
    if content["schema"] != "symheli certificate":
        return proven_by_the_package(saved(content, path))
    proof = content["proof"]
    model = proof.get("lpv") or proof.get("source") or proof["lft"]
    given = model.get("parameters") or [b["scheduling"] for b in model["blocks"]]
    decoded = certificate_file.decoded
    rates = decoded(content["rates"])
    said = [motion(decoded(s), r) for s, r in zip(given, rates, strict=True)]
    said += [decoded(proof["block"]).sentence] if proof.get("block") else []
    content = {**content, "hypotheses": [*content["hypotheses"], *said]}
    cert = certificate_file._certificate(content)
    evidence, P = cert.proof.evidence, cert.proof.lyapunov
    return evidence.checked_independently(P, cert.bound, rational())


def forgeries(file, count):
    """Copies of a file with one number changed."""
    content, rng = json.loads(file.read_text()), random.Random(file.stem)
    outside = ("lower", "upper", "frozen", "indicative")
    content |= {name: {"float": "nan"} for name in outside if name in content}
    wanted = {k: v for k, v in content.items() if k in ("gamma", "alpha", "rates", "proof")}
    places = list(numbers(wanted if "proof" in content else {**content, "version": None}))
    for _ in range(count):
        place, other = rng.choice(places), json.loads(json.dumps(content))
        factor = rng.choice([0.0, -1.0, 0.5, 0.999, 1.02, 2.0])
        exchange(other, place, lambda v, f=factor: type(v)(f * v) if f * v != v else v + 1)
        yield place, factor, other


def not_believed(file, count, tmp_path, capsys):
    path, tried = tmp_path / "forged.json", 0
    for place, factor, content in forgeries(file, count):
        status, said = checked(saved(content, path), capsys)
        assert status in (PROVEN, NOT_PROVEN, UNKNOWN)
        assert status != PROVEN or not_false(content, path), (place, factor, said)
        tried += 1
    return tried


@pytest.mark.parametrize("file", DECIDED, ids=lambda f: f.stem)
def test_a_changed_number_is_believed_only_where_it_is_still_true(file, tmp_path, capsys):
    assert not_believed(file, FORGED, tmp_path, capsys)


@pytest.mark.slow
@pytest.mark.parametrize("file", DECIDED, ids=lambda f: f.stem)
def test_a_hundred_changed_numbers(file, tmp_path, capsys):
    assert not_believed(file, 100, tmp_path, capsys) == 100


JUNK = (None, "P", -1, 1e300, 10**400, [], {}, True, {"float": "nan"}, {"type": "Certificate"})


def everywhere(value, path=()):
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, item in items:
        yield (*path, key)
        if isinstance(item, dict | list):
            yield from everywhere(item, (*path, key))


@pytest.mark.parametrize("file", FILES, ids=lambda f: f.stem)
def test_a_damaged_file_is_told_in_a_sentence(file, tmp_path, capsys):
    rng = random.Random(file.stem)
    content = json.loads(file.read_text())
    places = [p for p in everywhere(content) if p[0] in ("schema", "kind", "gamma", "proof")]
    for _ in range(25):
        other = json.loads(json.dumps(content))
        junk = rng.choice(JUNK)
        exchange(other, rng.choice(places), lambda _, junk=junk: junk)
        status, said = checked(saved(other, tmp_path / "damaged.json"), capsys)
        assert status in (PROVEN, NOT_PROVEN, UNKNOWN)
        assert said.splitlines()[-1].startswith(("proven", "not proven: ", "not checked: "))


@pytest.mark.parametrize("text", ["", "{", "[]", "NaN", '{"schema": "x"}', "{" * 10**5, "\x00"])
def test_a_file_of_another_kind_is_told_apart(text, tmp_path, capsys):
    path = tmp_path / "other.json"
    path.write_text(text)
    status, said = checked(path, capsys)
    assert status == UNKNOWN
    assert said.startswith("not checked: ")
    assert checked(tmp_path / "nothing.json", capsys)[0] == UNKNOWN


def test_a_statement_of_the_second_version_is_read(tmp_path, capsys):
    for file in DECIDED:
        content = json.loads(file.read_text()) | {"schema": "symheli statement", "version": 2}
        assert checked(saved(content, tmp_path / "statement.json"), capsys)[0] == PROVEN


SAMPLED = LinearModel(
    [[1.2]], [[1.0, 0.1]], [[1.0]], [[0.0, 0.0]], ["x"], ["u", "w"], ["x_m"], dt=0.1
)


def test_sets_with_disturbances_are_proven_and_larger_disturbances_refused(tmp_path, capsys):
    limits = {"input_bounds": {"u": 0.7}, "disturbance": {"w": 1.0}}
    for found in (
        low_complexity_set(SAMPLED, controller=[[-0.7]], **limits),
        invariant_set(SAMPLED, controller=[[-0.7]], **limits),
    ):
        path = found.save(tmp_path / "set.json")
        assert checked(path, capsys)[0] == PROVEN
        content = json.loads(path.read_text())
        exchange(content, ("disturbance", 0, 1), lambda v: 10 * v)
        assert checked(saved(content, path), capsys)[0] == NOT_PROVEN


@pytest.mark.parametrize("alpha", ["less than the shares", 0.99])
def test_another_decay_of_a_set_is_refused(alpha, tmp_path, capsys):
    """Below what the disturbances take, and above what the loop has."""
    found = invariant_set(
        SAMPLED, controller=[[-0.7]], input_bounds={"u": 0.7}, disturbance={"w": 1.0}
    )
    content = json.loads(found.save(tmp_path / "set.json").read_text())
    shares = sum(content["shares"]["array"])
    content["alpha"] = 0.7 * shares if isinstance(alpha, str) else alpha
    assert checked(saved(content, tmp_path / "set.json"), capsys)[0] == NOT_PROVEN


@pytest.mark.parametrize("scaling", ["DG", "full block"])
def test_an_lft_with_both_kinds_of_multipliers_is_proven_and_a_smaller_gain_refused(
    scaling, tmp_path, capsys
):
    found = lft_gain(spring(damping=0.4).to_lft().reduce(), scaling, search=None)
    content = json.loads(found.save(tmp_path / "lft.json").read_text())
    assert checked(tmp_path / "lft.json", capsys)[0] == PROVEN
    content["gamma"] *= 0.999
    assert checked(saved(content, tmp_path / "lft.json"), capsys)[0] == NOT_PROVEN


def test_a_faster_sampled_decay_is_refused(tmp_path, capsys):
    found = MADE["decay, sampled"]()
    content = json.loads(found.save(tmp_path / "decay.json").read_text())
    content["alpha"] *= 1.2
    assert checked(saved(content, tmp_path / "decay.json"), capsys)[0] == NOT_PROVEN


def of_rate(rate, tie=None):
    return Parameter(Fraction(0), Fraction(1), rate, tie)


def test_the_next_p_is_within_a_sample_of_p_and_both_rates_are_looked_at():
    content = json.loads((ROOT / "tests/data/proofs/l2-gain-sampled.json").read_text())
    model, rate = Model.read(content["proof"]["lpv"]), Fraction(1, 2)
    knots = [(Fraction(0), Fraction(1, 3), Fraction(1))]
    reach, steps = rate * model.dt, set()
    for cell in cells(model, (of_rate(rate),), knots, [True]):
        for point in ((Fraction(a), Fraction(b)) for a in (0, 1) for b in (0, 1)):
            now, later = (
                Fraction(F.value(point).terms[()][0][0], F.value(point).below)
                for F in (cell.here[0], cell.there[0])
            )
            steps.add(later - now)
            assert 0 <= later <= 1
        drifts = cell.drifts(cell.here[0], [True])
        assert {F.value(point).terms[()][0][0] > 0 for _, F in drifts} == {False, True}
    assert (min(steps), max(steps)) == (-reach, reach)


def test_a_rate_that_lets_p_leave_its_range_is_not_reached():
    motion = (of_rate(None, 1), Parameter(Fraction(-1), Fraction(1), Fraction(1, 2), None))
    content = json.loads((ROOT / "tests/data/proofs/l2-gain-two-parameters.json").read_text())
    model = Model.read(content["proof"]["source"])
    ends = [(p.low, p.high) for p in motion]
    (cell,) = (c for c in cells(model, motion, ends, [True, True]) if c.middle[1] > 0)
    # p2^2 <= 1 - p1 where p2 rises from 0 to 1 on the cell
    for p1, p2, there in ((0.5, 0.70, True), (0.5, 0.72, False), (0.0, 1.0, True)):
        point = (Fraction(p1), Fraction(p2))
        assert cell.reaches(tuple((t, t) for t in point)) == there


TURNS = [[0.0, 1.0], [-10.0, -1.0]], [[0.0, 1.0], [-0.1, -0.5]]


@pytest.mark.parametrize("average", [False, True])
@pytest.mark.parametrize("dt", [None, 0.05])
def test_dwell_times_are_proven_and_shorter_ones_refused(average, dt):
    modes = TURNS if dt is None else [linalg.expm(dt * np.array(A)) for A in TURNS]
    within = None if average else 3.0
    found = switching.dwell_time(modes, average=average, within=within, dt=dt)
    content = json.loads(json.dumps(found.stored))
    assert failure(dwell.claimed(content)) == ""
    assert failure(dwell.claimed(content | {"seconds": 0.9 * found.seconds}))
    if average:
        assert failure(dwell.claimed(content | {"decay": 3 * found.decay}))
    else:
        # the time really is shorter: V would have to fall faster than it does
        content["lengths"]["array"] = [0.8 * v for v in content["lengths"]["array"]]
        if dt is None:
            assert failure(dwell.claimed(content))


def test_a_rotated_form_is_positive_where_its_minors_are():
    rng = np.random.default_rng(0)
    for n in (1, 2, 3, 8):
        for _ in range(40):
            M = rng.integers(-40, 40, (n, n))
            M = (M @ M.T - int(rng.integers(0, 60)) * np.eye(n, dtype=int)).tolist()
            minors = all(round(np.linalg.det(np.array(M)[:k, :k])) > 0 for k in range(1, n + 1))
            assert positive_definite(M) == pivots_positive(M) == minors
            assert minors or not shown(M)


def test_a_form_that_is_singular_by_less_than_a_double_tells_is_not_positive():
    big = 10**30
    singular = [[big, big, 0], [big, big, 0], [0, 0, 1]]
    above = [[big, big, 0], [big, big + 1, 0], [0, 0, 1]]
    below = [[big, big, 0], [big, big - 1, 0], [0, 0, 1]]
    assert [positive_definite(M) for M in (singular, above, below)] == [False, True, False]


@pytest.mark.parametrize("x", [0.0, 1e-9, 0.3, 4.0, 90.0])
def test_an_exponential_lies_between_its_limits(x):
    low, high = exponential(Fraction(x))
    assert low <= high
    assert float(low) == pytest.approx(math.exp(x), rel=1e-14)
    assert float(high - low) <= 1e-20 * float(high)


def test_nothing_is_claimed_from_the_words_of_a_file(tmp_path, capsys):
    content = json.loads(FILES[0].read_text())
    text = json.dumps(content).replace('"x1"', '"nonsense"').replace("exogenous", "nonsense")
    path = tmp_path / "words.json"
    path.write_text(text)
    assert "nonsense" not in checked(path, capsys)[1]
    assert isinstance(report.claim_of(content["kind"], content), Claim)
    assert ValueError in DAMAGED


def test_the_coefficients_of_a_polynomial_are_those_of_bernstein():
    t = variable(0)
    found = bernstein_coefficients(t + t @ t, 1)
    (zero,), (half,), (two,) = (found[(k,)][0] for k in range(3))
    assert (zero, 4 * half) == (0, two)
    assert two > 0
