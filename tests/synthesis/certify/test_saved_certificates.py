"""A certificate is proven again from its file alone; a file that is damaged or forged is refused in
words, or not verified.
"""

import json
import math
import subprocess
import sys
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from models import forged, lag, spring
from test_forged_certificates import FORMS, genuine, same

from symheli import LPVStateSpace, Scheduling
from symheli.errors import CertificateError, InputError, SymheliError
from symheli.lpv import PiecewiseLinear, UserFunctions
from synthesis import Certificate, l2_gain, stability
from synthesis.analysis import Status
from synthesis.certify.statement.trajectory import SchedulingTrajectory
from synthesis.forms import Spline
from synthesis.impose import Grid

pytestmark = pytest.mark.guard

QUICK = settings(
    max_examples=20, derandomize=True, deadline=None, suppress_health_check=list(HealthCheck)
)


@pytest.fixture(params=FORMS)
def saved(request, tmp_path):
    cert = genuine(request.param)
    return cert, cert.save(tmp_path / "proof.json")


def test_a_file_gives_back_the_certificate_and_its_exact_proof(saved):
    cert, path = saved
    again = Certificate.load(path)
    for f in fields(cert):
        if f.name not in ("proof", "attempts", "worst"):
            assert same(getattr(again, f.name), getattr(cert, f.name)), f.name
    assert again.attempts == cert.attempts
    assert again.verify()
    assert again.verify(rigorous=True)
    assert again.details == cert.details
    # every double comes back: what is written again is the same file
    assert again.save(path.with_name("again.json")).read_bytes() == path.read_bytes()


@pytest.mark.parametrize("form", ["box", "box stability", "decay", "energy to peak"])
def test_files_with_units_of_inputs_outputs_and_storage_are_read(form, tmp_path):
    cert = genuine(form)
    path = cert.save(tmp_path / "proof.json")
    content = json.loads(path.read_text())
    units = content["proof"]["units"]
    channel, root = units.pop("channel"), math.sqrt(units["time"])
    del units["multiplier"]
    peaks = form == "energy to peak"
    units |= {"type": "Units", "inputs": 1 / root, "storage": 1.0 if peaks else channel**2}
    units["outputs"] = channel if peaks else channel / root
    path.write_text(json.dumps(content))
    again = Certificate.load(path)
    assert again.proof.evidence.units.channel == pytest.approx(channel, rel=1e-12)
    assert again.verify(rigorous=True)


def test_a_trajectory_has_the_word_that_it_always_had_in_files(tmp_path):
    worst = SchedulingTrajectory(np.array([0.0, 0.5]), np.array([1.0, 2.0]))
    path = replace(genuine("spline"), worst=worst).save(tmp_path / "proof.json")
    assert '"type": "Trajectory"' in json.dumps(json.loads(path.read_text()))
    again = Certificate.load(path).worst
    assert isinstance(again, SchedulingTrajectory)
    np.testing.assert_array_equal(again, worst)


def test_a_process_that_never_saw_the_model_proves_it_again(tmp_path):
    path = genuine("spline").save(tmp_path / "proof.json")
    code = "import synthesis, sys; print(synthesis.Certificate.load(sys.argv[1]).verify(True))"
    told = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True
    )
    assert told.stdout.strip() == "True"


def places(value, path=()):
    """Every place in a JSON value."""
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, item in items:
        yield (*path, key)
        if isinstance(item, dict | list):
            yield from places(item, (*path, key))


def changed(content, path, value):
    content = json.loads(json.dumps(content))
    inner = content
    for key in path[:-1]:
        inner = inner[key]
    if value is ...:
        del inner[path[-1]]
    else:
        inner[path[-1]] = value
    return content


JUNK = (None, "P", -1, 1e300, 10**400, [], {}, True, {"float": "nan"}, {"type": "Certificate"})


@pytest.mark.parametrize("form", FORMS)
@QUICK
@given(data=st.data())
def test_junk_anywhere_is_an_error_or_a_failed_proof(form, data, tmp_path_factory):
    path = tmp_path_factory.mktemp("junk") / "proof.json"
    content = json.loads(genuine(form).save(path).read_text())
    place = data.draw(st.sampled_from(list(places(content))))
    junk = data.draw(st.sampled_from((*JUNK, ...)))
    path.write_text(json.dumps(changed(content, place, junk)))
    said = ""
    try:
        cert = Certificate.load(path)
    except SymheliError as error:
        cert, said = None, str(error)
    if cert is None or not cert.verify(rigorous=True):
        assert not said or said.startswith(str(path))
        return
    # it proves what it says: the claim is the genuine one or a weaker one, of the same model
    own = genuine(form)
    assert cert.kind == own.kind
    assert cert.rates == own.rates
    ranges = [[(s.low, s.high) for s in c.proof.evidence.parameters] for c in (cert, own)]
    assert ranges[0] == ranges[1]
    assert cert.bound >= own.bound * (1 - 1e-2) or own.kind in ("stability", "decay rate")


@pytest.mark.parametrize("form", ["spline", "box", "decay", "energy to peak", "lft, DG"])
def test_a_better_bound_in_the_file_is_refused(form, tmp_path):
    cert = genuine(form)
    path = cert.save(tmp_path / "proof.json")
    content = json.loads(path.read_text())
    name, better = ("alpha", 1.1) if cert.kind == "decay rate" else ("gamma", 0.9)
    other = {"alpha": "upper", "gamma": "lower"}[name]
    for key in (name, "frozen", other):
        content[key] *= better
    path.write_text(json.dumps(content))
    with pytest.raises(CertificateError, match="does not establish the certified bound"):
        Certificate.load(path)
    # nor where the file does not call itself verified
    content["verified"] = False
    path.write_text(json.dumps(content))
    assert not Certificate.load(path).verify()
    assert not Certificate.load(path).verify(rigorous=True)


def test_a_proof_for_a_wider_range_cannot_be_told(tmp_path):
    path = genuine("spline").save(tmp_path / "proof.json")
    content = json.loads(path.read_text())
    content["hypotheses"][0] = content["hypotheses"][0].replace("[0, 1]", "[0, 2]")
    path.write_text(json.dumps(content))
    with pytest.raises(CertificateError, match="do not say for which range and rate of p"):
        Certificate.load(path)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 0.999])
def test_a_truncated_file_is_called_damaged(share, tmp_path):
    path = genuine("spline").save(tmp_path / "proof.json")
    text = path.read_text()
    path.write_text(text[: int(share * len(text))])
    with pytest.raises(InputError, match="another or a damaged file"):
        Certificate.load(path)


def test_other_files_are_told_apart(tmp_path):
    path = tmp_path / "proof.json"
    for text, said in (
        ("[]", "expected the schema"),
        ('{"schema": "symheli certificate", "version": 2}', "expected version 1"),
        ('{"schema": "symheli certificate", "version": 1}', "missing: "),
        ('{"schema": NaN}', "another or a damaged file"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=said):
            Certificate.load(path)
    with pytest.raises(InputError, match="cannot be read"):
        Certificate.load(tmp_path / "nowhere.json")


def test_certificates_without_a_proof_are_kept_too(tmp_path):
    unproven = stability(spring(), math.inf, search=None)
    grid = l2_gain(lag(), form=Spline(degree=1), impose=Grid(), search=None)
    for cert in (unproven, grid):
        again = Certificate.load(cert.save(tmp_path / "proof.json"))
        assert again.status is cert.status is not Status.PROVEN
        assert not again.verify()
        assert not again.verify(rigorous=True)
    with pytest.raises(CertificateError, match="needs its proof"):
        replace(genuine("spline"), proof=None)


def test_a_model_on_straight_lines_is_kept_and_one_of_own_functions_is_refused(tmp_path):
    nodes = (0.0, 0.4, 1.0)
    A = [[[-1.0]], [[-1.2]], [[-2.0]]]
    one, none = [[[1.0]]] * 3, [[[0.0]]] * 3
    p = Scheduling("p", "1", 0.0, 1.0, 0.1)
    model = LPVStateSpace(
        PiecewiseLinear(nodes), *map(np.array, (A, one, one, none)), p, ("x",), ("u",), ("y",)
    )
    cert = l2_gain(model, form=Spline(segments=2), search=None)
    assert Certificate.load(cert.save(tmp_path / "proof.json")).verify(rigorous=True)
    own = UserFunctions((np.ones_like, np.sin, np.cos), 0.0, 1.0)
    evidence = cert.proof.evidence
    other = forged(cert, evidence=evidence._replace(lpv=replace(model, basis=own)))
    with pytest.raises(InputError, match="UserFunctions cannot be written"):
        other.save(tmp_path / "none.json")
    assert not (tmp_path / "none.json").exists()
