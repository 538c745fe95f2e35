"""What several test modules share."""

from __future__ import annotations

import studies  # noqa: F401  first: it asks for one BLAS thread, and threads that wait for each other cost minutes on a busy machine

import pytest  # isort: skip

import symheli


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
    return pytest.importorskip("pandas", reason="needs pandas: pip install 'symheli[logs]'")
