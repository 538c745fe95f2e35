"""What several test modules share."""

from __future__ import annotations

import pytest

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
