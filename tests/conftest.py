"""What several test modules share."""

from __future__ import annotations

import sys

from studies.threads import one_thread

one_thread()  # before NumPy is imported

import pytest  # noqa: E402

import symheli  # noqa: E402


@pytest.fixture(scope="session", params=["ideal", "pi"])
def heli(request):
    return symheli.Helicopter.load("xcell60", governor=request.param)


@pytest.fixture(scope="session")
def ideal():
    return symheli.Helicopter.load("xcell60", governor="ideal")


@pytest.fixture(scope="session")
def pi():
    return symheli.Helicopter.load("xcell60", governor="pi")


@pytest.fixture
def pd():
    return pytest.importorskip("pandas", reason="needs pandas: pip install 'symheli[labelled]'")


@pytest.fixture(autouse=True)
def _pictures_are_closed():
    """Those that a test leaves to be shown: matplotlib warns of more than twenty."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
