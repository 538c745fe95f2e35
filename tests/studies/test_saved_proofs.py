"""The proofs of a study lie beside its results, and each proves its bound again."""

import json
import re

import pytest
from json_schema import faults
from test_results_schema import SCHEMA_FILE

from studies.transition import guarantees, report
from studies.transition.outcome import Outcome
from studies.transition.proofs import GustProofs
from studies.transition.saved_proofs import proof_file
from symheli import LPVStateSpace, Scheduling
from symheli.lpv.bases import Patches
from synthesis import Certificate
from synthesis.analysis import LowerBoundSearch
from synthesis.forms import Spline

pytestmark = pytest.mark.guard

QUICK = LowerBoundSearch(levels=2, dwells=1, starts=1, nodes=8, evaluations=1, samples=100)


@pytest.fixture(scope="module")
def outcome():
    """A lag that is proven, by P(p) and by an LFT test, and a model that is not stable."""
    speed = Scheduling("airspeed", "m/s", 0.0, 13.0)
    lag, unstable = (
        LPVStateSpace.polynomial([[[pole]], [[0.05]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], speed)
        for pole in (-2.0, 0.1)
    )
    asked = guarantees.bounds("baseline", "gust", lag, (0.0, 3.0), Spline(segments=(2,)), QUICK)
    asked += guarantees.lft_bounds("baseline", "gust", lag)[1:2]
    asked += guarantees.bounds("exact", "gust", unstable, (0.0,), Spline(segments=(2,)), QUICK)
    found = GustProofs(bounds=tuple(guarantees.answered(asked)), exact_frozen=1.0)
    return Outcome(vehicle="xcell60", quick=True, seed=0, gust=found)


def test_every_bound_names_the_file_that_proves_it(outcome, tmp_path):
    found = json.loads(report.write_results(outcome, tmp_path).read_text())
    assert not list(faults(found, SCHEMA_FILE))
    bounds = found["guarantees"]["bounds"]
    names = [b["proof"] for b in bounds]
    assert names[:2] == [
        "proofs/gust-baseline-p-p-0-l2-gain.json",
        "proofs/gust-baseline-p-p-3-l2-gain.json",
    ]
    assert "proofs/gust-baseline-lft-d-g-inf-l2-gain.json" in names
    for bound in bounds:
        assert (bound["proof"] is not None) == bound["verified"]
        if bound["verified"]:
            cert = Certificate.load(tmp_path / bound["proof"])
            assert cert.verify(rigorous=True)
            assert cert.gamma == bound["proven_gain"]["value"]
    named = [n for n in names if n]
    assert len(set(named)) == len(named) == 3


def test_a_proof_is_written_once_and_again_where_it_is_gone(outcome, tmp_path):
    report.write_results(outcome, tmp_path)
    first, second = (tmp_path / proof_file(b) for b in outcome.bounds[:2])
    before = first.stat().st_mtime_ns
    second.unlink()
    report.write_results(outcome, tmp_path)
    assert first.stat().st_mtime_ns == before
    assert second.is_file()


def test_a_proof_about_a_model_that_jumps_travels_too(tmp_path):
    """As that of the exact helicopter, whose models have corners."""
    basis = Patches(1, (0.0, 5.0, 13.0))
    p = basis.points(3)
    values = (-2.0 + 0.05 * p - 0.2 * (p > 5.0))[:, None, None]
    one, none = (basis.fit(p, level + 0 * values) for level in (1.0, 0.0))
    speed = (Scheduling("airspeed", "m/s", 0.0, 13.0),)
    jumps = LPVStateSpace(basis, basis.fit(p, values), one, one, none, speed, "x", "u", "y")
    form = Spline(segments=(2,))
    (bound,) = guarantees.answered(guarantees.bounds("exact", "gust", jumps, (1.0,), form, QUICK))
    assert bound.certificate.verified
    back = Certificate.load(bound.certificate.save(tmp_path / "proof.json"))
    assert back.verify(rigorous=True)
    assert back.gamma == bound.certificate.gamma


def links(page):
    """What a page leads to outside of itself."""
    found = re.findall(r'(?:href|src)="([^"#][^"]*)"', page)
    return [target for target in found if not target.startswith("data:")]


def test_the_report_links_every_proof_and_every_link_is_there(outcome, tmp_path):
    page = report.write_report(outcome, tmp_path).read_text(encoding="utf-8")
    targets = links(page)
    assert sorted(targets) == sorted(filter(None, map(proof_file, outcome.bounds)))
    for target in targets:
        assert (tmp_path / target).is_file()
        assert Certificate.load(tmp_path / target).verified
    section = page[page.index("What can be proven</h2>") :]
    listed = section[: section.index("<h2")]
    assert links(listed) == targets
    fast = next(b for b in outcome.bounds if b.rate == 3.0)
    said = f"baseline, P(p), 3 m/s²: gain of at most {fast.certificate.gamma:.3g}"
    assert f'href="{proof_file(fast)}">{proof_file(fast)[7:]}</a> {said}</li>' in listed


def test_without_a_proof_there_is_nothing_to_link(tmp_path):
    nothing = Outcome(vehicle="xcell60", quick=True, seed=0)
    page = report.write_report(nothing, tmp_path).read_text(encoding="utf-8")
    assert "symheli verify" not in page
    assert links(page) == []
