"""Every proven statement: saved, read by the one reader, verified, printed from its numbers."""

import json
import random
from functools import cache
from math import inf, log

import numpy as np
import pytest
import sympy

from studies import cli
from symheli import LinearModel, LPVStateSpace, Scheduling
from symheli.errors import InputError, SymheliError
from synthesis import decay_rate, h2_gain, l2_gain, lft_gain, stability
from synthesis.analysis import (
    energy_to_peak,
    output_strictness,
    passivity_index,
    sector_radius,
)
from synthesis.certify.statement.statement_file import read
from synthesis.checker.report import main as checker
from synthesis.forms import Spline
from synthesis.regions import region_of_attraction, terminal
from synthesis.robust import (
    DelayBlock,
    DynamicBlock,
    ParameterBlock,
    multiplier_gain,
    robust_margin,
    slope_margin,
    worst_case_gain,
)
from synthesis.sets import invariant_set, low_complexity_set
from synthesis.switching import dwell_time


@cache
def lag(dt=None):
    p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    A = [[[-1.0]], [[-1.0]]] if dt is None else [[[0.5]], [[-0.2]]]
    return LPVStateSpace.polynomial(A, [[[1.0]]], [[[1.0]]], [[[0.0]]], p, dt=dt)


@cache
def passing():
    """A lag and a quarter of its input, over two parameters."""
    p, q = Scheduling("p", "1", 0.0, 1.0, rate=0.5), Scheduling("q", "1", 0.0, 1.0, rate=0.5)
    one, z = [[1.0]], (0, 0)
    A = {z: [[-1.0]], (1, 0): [[-1.0]]}
    D = {z: [[0.25]], (0, 1): [[0.25]]}
    return LPVStateSpace.polynomial(A, {z: one}, {z: one}, D, [p, q])


def with_feedthrough():
    p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    return LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.25]]], p)


def third_order():
    """-1/(s + 1)^3, positive feedback: a line is stable below 8."""
    A = [[-1.0, 0.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, -1.0]]
    B, C = [[-1.0], [0.0], [0.0]], [[0.0, 0.0, 1.0]]
    return LinearModel(A, B, C, [[0.0]], ["x1", "x2", "x3"], ["d"], ["v"])


def loss(into, out):
    return DynamicBlock([into], [out], 0.5)


def two_by_two():
    """A lag from u to y, and one from the block's d to its v, over one parameter."""
    p = Scheduling("p", "1", 0.0, 1.0, rate=0.0)
    B, D = [[1.0, 1.0]], [[0.0, 0.5], [0.0, 0.0]]
    return LPVStateSpace.polynomial(
        [[[-1.0]], [[-1.0]]], [B], [[[1.0], [0.7]]], [D], p, inputs=["u", "d"], outputs=["y", "v"]
    )


def opened():
    """Two lags in a row, from the block's d and from u to its v, and to y."""
    A, B = [[-1.0, 0.0], [1.0, -2.0]], [[1.0, 1.0], [0.0, 0.0]]
    C, D = [[0.0, 1.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]]
    return LinearModel(A, B, C, D, ["x1", "x2"], ["d", "u"], ["v", "y"])


def swaying():
    return ParameterBlock("d", "v", -0.5, 0.5, inf)


def rotated():
    nothing = np.zeros((2, 0))
    A, names = [[0.5, 0.2], [0.0, 0.7]], ["x_m", "y_m"]
    return LinearModel(A, nothing, np.eye(2), nothing, ["x", "y"], [], names, dt=0.1)


def pushed():
    return LinearModel([[1.0]], [[2.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["x_m"])


QUICK = {"form": Spline(degree=1, segments=1), "search": None}
TRIPLED = {(0, 1): [[3.0]], (1, 0): [[3.0]]}
SLOW = [[[-1.0]], [[-1.0]]]
X, U = sympy.symbols("x u")
MADE = {
    "l2 gain": lambda: l2_gain(lag(), **QUICK),
    "sampled l2 gain": lambda: l2_gain(lag(0.1), **QUICK),
    "stability": lambda: stability(lag(), **QUICK),
    "decay rate": lambda: decay_rate(lag(), **QUICK),
    "energy-to-peak gain": lambda: energy_to_peak(lag(), **QUICK),
    "h2 gain": lambda: h2_gain(lag(), **QUICK),
    "passivity index": lambda: passivity_index(with_feedthrough(), **QUICK),
    "output strictness": lambda: output_strictness(with_feedthrough(), **QUICK),
    "sector": lambda: sector_radius(with_feedthrough(), 0.7, **QUICK),
    "l2 gain of two": lambda: l2_gain(passing(), **QUICK),
    "stability of two": lambda: stability(passing(), **QUICK),
    "decay rate of two": lambda: decay_rate(passing(), **QUICK),
    "passivity index of two": lambda: passivity_index(passing(), **QUICK),
    "output strictness of two": lambda: output_strictness(passing(), **QUICK),
    "sector of two": lambda: sector_radius(passing(), 0.7, **QUICK),
    "LFT gain": lambda: lft_gain(lag().to_lft(), "DG", search=None),
    "slope margin": lambda: slope_margin(third_order(), "d", "v", "Zames-Falb", odd=True),
    "robust margin": lambda: robust_margin(passing().with_rate(0.0), [loss("u1", "y1")]),
    "worst-case gain": lambda: worst_case_gain(two_by_two(), [loss("d", "v")]),
    "multiplier gain": lambda: multiplier_gain(opened(), DelayBlock("d", "v", 0.2)),
    "multiplier peak gain": lambda: multiplier_gain(opened(), swaying(), kind="energy to peak"),
    "ellipsoid": lambda: invariant_set(pushed(), input_bounds={"u": 1.0}),
    "parallelepiped": lambda: low_complexity_set(rotated(), state_bounds={"x": 1.0, "y": 2.0}),
    "dwell time": lambda: dwell_time(SLOW, TRIPLED, within=1.2, parts=4),
    "average dwell time": lambda: dwell_time(SLOW, TRIPLED, average=True),
    "sampled dwell time": lambda: dwell_time([[[0.9]], [[0.8]]], TRIPLED, dt=0.1),
    "region": lambda: region_of_attraction({X: -X + X**3}, X**2),
    "terminal set": lambda: terminal(
        {X: X**3 + U}, [[1.0]], [[1.0]], controls=[U], input_bounds={"u": 1.0}, share=0.5
    ),
}
BETTER = {
    **dict.fromkeys(("l2 gain", "sampled l2 gain", "energy-to-peak gain", "h2 gain"), "gamma"),
    "LFT gain": "gamma",
    "slope margin": "slope",
    **dict.fromkeys(("multiplier gain", "multiplier peak gain"), "gain"),
    "decay rate": "alpha",
    "l2 gain of two": "gamma",
    "decay rate of two": "alpha",
    **dict.fromkeys(("sector", "sector of two"), "gamma"),
    **dict.fromkeys(("passivity index", "output strictness"), "index"),
    **dict.fromkeys(("passivity index of two", "output strictness of two"), "index"),
    **dict.fromkeys(("dwell time", "average dwell time", "sampled dwell time"), "seconds"),
    "region": "level",
    "terminal set": "alpha",
}

LARGER = ("alpha", "index", "slope", "level")
"""Numbers of which a larger one is better."""


@cache
def made(kind):
    return MADE[kind]()


@pytest.fixture(params=MADE)
def saved(request, tmp_path):
    """(kind, the statement, its file)."""
    found = made(request.param)
    return request.param, found, found.save(tmp_path / "proof.json")


def test_it_is_read_without_knowing_what_it_is(saved):
    _, found, file = saved
    again = read(file)
    assert type(again) is type(found)
    assert again.verify(rigorous=True)
    assert (again.claim, again.conditions) == (found.claim, found.conditions)
    assert again.facts == found.facts
    assert again.bound == found.bound or np.isnan(found.bound)
    assert (again.verified, again.why) == (True, "")


def test_symheli_verify_prints_claim_and_conditions(saved, capsys):
    _, found, file = saved
    assert cli.main(["verify", str(file)]) == 0
    told = capsys.readouterr().out
    assert told.startswith(f"proven in exact arithmetic: {found.claim}\n")
    assert all(f"- {line}" in told for line in found.conditions)
    assert cli.main(["verify", str(file), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["exact"]
    assert data["claim"] == found.claim
    assert "nan" not in found.claim


def checked(file):
    """The exit status of the checker, which shares no code with the package."""
    return checker([str(file)])


def with_text_changed(value):
    if isinstance(value, dict):
        return {name: with_text_changed(part) for name, part in value.items()}
    if isinstance(value, list):
        return [with_text_changed(part) for part in value]
    return "for every model of the world" if isinstance(value, str) and " " in value else value


UNKNOWN = ("passivity", "output", "sector", "slope", "robust", "worst-case")
"""First words of kinds that the checker does not decide."""


@pytest.mark.guard
def test_the_checker_that_stands_alone_agrees(saved):
    """With the file as it is, and with a better number where there is one."""
    kind, _, file = saved
    expected = 2 if kind.startswith(UNKNOWN) else 0
    assert checked(file) == expected
    if kind in BETTER and not expected:
        content, name = json.loads(file.read_text()), BETTER[kind]
        content[name] *= 1.2 if name in ("alpha", "level") else 0.8
        file.write_text(json.dumps(content))
        assert checked(file) == 1


def test_sentences_of_the_file_are_not_repeated_as_the_claim(saved):
    _, found, file = saved
    content = json.loads(file.read_text())
    kept = {name: content[name] for name in ("schema", "statement", "kind") if name in content}
    file.write_text(json.dumps({**with_text_changed(content), **kept}))
    try:
        again = read(file)
    except SymheliError:
        return
    assert (again.claim, again.conditions) == (found.claim, found.conditions)


@pytest.mark.parametrize(("kind", "factor"), [("robust margin", 1.01), ("worst-case gain", 0.99)])
def test_a_better_level_is_not_proven(kind, factor, tmp_path):
    file = made(kind).save(tmp_path / "proof.json")
    content = json.loads(file.read_text())
    for names in (["bound"], ["bound", "level"]):
        forged = dict(content)
        for name in names:
            forged[name] *= factor if name == "bound" else 1 / factor
        file.write_text(json.dumps(forged))
        again = proven(file)
        assert again is None or (again.bound > made(kind).bound) == (kind == "worst-case gain")


@pytest.mark.guard
@pytest.mark.parametrize("kind", BETTER)
def test_a_better_number_is_not_proven(kind, tmp_path):
    found = made(kind)
    file = found.save(tmp_path / "proof.json")
    content = json.loads(file.read_text())
    name = BETTER[kind]
    content[name] *= 1.2 if name in LARGER else 0.8
    for other in {"lower", "upper", "frozen", "index_limit"} & content.keys():
        content[other] = {"float": "nan"}
    file.write_text(json.dumps(content))
    assert not proven(file)


def proven(file):
    """The statement of a file where its exact check passes; None where it is refused."""
    try:
        found = read(file)
        return found if found.verify(rigorous=True) else None
    except SymheliError:
        return None


def numbers(value, path=()):
    if isinstance(value, dict):
        value = {k: v for k, v in value.items() if k not in ("attempts", "seconds", "worst")}
        for name, part in value.items():
            yield from numbers(part, (*path, name))
    elif isinstance(value, list):
        for i, part in enumerate(value):
            yield from numbers(part, (*path, i))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path


@pytest.mark.guard
def test_a_number_changed_is_refused_or_says_what_it_now_proves(saved, tmp_path):
    """No change ends in a traceback; what passes holds for the numbers in the file, about another
    model or with more room.
    """
    kind, found, file = saved
    content = json.loads(file.read_text())
    places = sorted(numbers(content), key=str)
    random.seed(0)
    for path in random.sample(places, min(4, len(places))):
        for change in (lambda v: 1.5 * v, lambda v: -v, lambda v: 0.5 * v):
            forged = json.loads(file.read_text())
            at = forged
            for step in path[:-1]:
                at = at[step]
            at[path[-1]] = change(at[path[-1]])
            (tmp_path / "forged.json").write_text(json.dumps(forged))
            again = proven(tmp_path / "forged.json")
            if again is not None and kind in BETTER and BETTER[kind] == path[0]:
                better = again.bound > found.bound * (1 + 1e-2)
                looser = BETTER[kind] not in LARGER
                assert better == looser or again.bound == found.bound


def test_a_dwell_time_is_bound_to_its_segments():
    found = made("dwell time")
    assert sum(found.lengths) <= found.seconds
    assert log(3) < found.seconds


@pytest.mark.guard
def test_a_claim_is_about_one_model(tmp_path):
    found = made("l2 gain")
    assert found.proven_of(lag())
    assert found.proven_of(lag().with_rate(3.0))  # the rate is a condition, not the model
    assert not found.proven_of(lag(0.1))
    other = LPVStateSpace.polynomial(
        [[[-1.0]], [[-1.0 - 1e-15]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], lag().parameters
    )
    assert not found.proven_of(other)
    with pytest.raises(InputError, match="the proof is about an LPVStateSpace"):
        found.proven_of(lag().to_lft())
    with pytest.raises(InputError, match="not about one model"):
        made("dwell time").proven_of(lag())
    assert made("LFT gain").proven_of(lag().with_rate(inf).to_lft())


CLOSED_FORMS = {
    "l2 gain": 1.0,
    "decay rate": 1.0,
    "energy-to-peak gain": np.sqrt(0.5),
    "h2 gain": np.sqrt(0.5),
    "passivity index": 0.25,  # Re G from 1.25 to 0.25
    "output strictness": 0.8,  # 1/G(0)
    "sector": 0.55,  # |G(0) - 0.7|
    "l2 gain of two": 1.5,
    "decay rate of two": 1.0,
    "passivity index of two": 0.25,
    "output strictness of two": 2 / 3,
    "sector of two": 0.8,
}
"""Of what is worst at some frozen p; motion within the rates makes it little worse."""


@pytest.mark.parametrize("kind", CLOSED_FORMS)
def test_the_bound_is_near_its_closed_form(kind):
    found = made(kind)
    sense = found.kind.facets.sense
    exact = CLOSED_FORMS[kind]
    assert sense * found.bound >= sense * exact * (1 - 1e-6)
    assert found.bound == pytest.approx(exact, rel=3e-2)
    assert found.frozen == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize("kind", [k for k in CLOSED_FORMS if "of two" not in k])
def test_every_kind_is_drawn(kind):
    axes = made(kind).plot()
    assert made(kind).kind in axes.get_ylabel()


def test_an_unknown_kind_is_refused_and_never_a_gain(tmp_path):
    file = made("l2 gain").save(tmp_path / "proof.json")
    content = json.loads(file.read_text())
    for name in ("dissipation of the moon", "passivity", "radius about 1.0e", 3, None):
        file.write_text(json.dumps({**content, "kind": name}))
        with pytest.raises(InputError, match="expected one of the kinds"):
            read(file)


@pytest.mark.guard
def test_no_proof_of_one_kind_serves_another(tmp_path):
    first, second = (made(kind).save(tmp_path / f"{kind}.json") for kind in ("sector", "l2 gain"))
    sector, gain = json.loads(first.read_text()), json.loads(second.read_text())
    nothing = {"float": "nan"}
    for one, other in ((sector, gain), (gain, sector)):
        one = {**one, "kind": other["kind"], "frozen": nothing, "lower": nothing}
        first.write_text(json.dumps(one))
        assert not proven(first)


def test_waves_bound_an_index_from_the_other_side():
    """The spring of the page on inequalities: what waves refute and what is proven close in."""
    model = LPVStateSpace.polynomial(
        [[[0, 1], [-1, -0.4]], [[0, 0], [-2, 0]]],
        [[[0], [1]]],
        [[[0, 1]]],
        [[[0.1]]],
        Scheduling("p", "1", 0.0, 1.0, rate=0.2),
    )
    cert = passivity_index(model)
    assert 0.047 < cert.index < cert.index_limit < 0.0625 < cert.frozen


def test_an_unknown_statement_is_named(tmp_path):
    file = tmp_path / "proof.json"
    for name in ("passivity of the moon", None, ["set"]):
        head = {"schema": "symheli statement", "version": 2, "statement": name}
        file.write_text(json.dumps(head))
        with pytest.raises(InputError, match=r"unknown statement .*certificate, claim, dwell-time"):
            read(file)
