"""One thread of BLAS within designs and certificates, and as many as before after them."""

import importlib
import re
import threading

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import synthesis
from symheli import LPVStateSpace, Scheduling
from symheli.threads import BLAS, one_thread, with_one_thread


def count():
    """Of the libraries of NumPy and SciPy; other packages bring some that take one at most."""
    blas = [found for found in threadpool_info() if found["user_api"] == "blas"]
    own = [found for found in blas if re.search(r"(numpy|scipy)", found["filepath"])]
    return {found["num_threads"] for found in own or blas}


@pytest.fixture
def two_threads(monkeypatch):
    for name in BLAS:
        monkeypatch.delenv(name, raising=False)
    with threadpool_limits(2, user_api="blas"):
        if count() != {2}:
            pytest.skip("BLAS here does not take two threads")
        yield


@pytest.mark.usefixtures("two_threads")
def test_one_thread_within_and_as_many_as_before_after():
    with one_thread():
        with one_thread():
            assert count() == {1}
        assert count() == {1}
    assert count() == {2}


@pytest.mark.usefixtures("two_threads")
def test_what_fails_gives_the_threads_back():
    @with_one_thread
    def fails():
        raise ValueError(str(count()))

    with pytest.raises(ValueError, match=r"\{1\}"):
        fails()
    assert count() == {2}


@pytest.mark.usefixtures("two_threads")
def test_another_thread_changes_nothing():
    seen = []

    def other():
        with one_thread():
            seen.append(count())

    thread = threading.Thread(target=other)
    thread.start()
    thread.join()
    assert seen == [{2}]


@pytest.mark.usefixtures("two_threads")
def test_the_environment_decides(monkeypatch):
    monkeypatch.setenv(BLAS[0], "2")
    with one_thread():
        assert count() == {2}


@pytest.mark.slow
@pytest.mark.usefixtures("two_threads")
def test_a_certificate_takes_one(monkeypatch):
    seen = []
    module = importlib.import_module("synthesis.certify.questions.questions")
    certify = module.certify

    def looked(*arguments, **options):
        seen.append(count())
        return certify(*arguments, **options)

    monkeypatch.setattr(module, "certify", looked)
    lag = LPVStateSpace.polynomial(
        A=[[[-1.0]]],
        B=[[[1.0]]],
        C=[[[1.0]]],
        D=[[[0.0]]],
        scheduling=Scheduling("p", "1", 0.0, 1.0, rate=0.5),
    )
    assert synthesis.l2_gain(lag).verified
    assert seen == [{1}]
    assert count() == {2}
