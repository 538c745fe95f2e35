"""What several test modules share, and how files are handed out to processes."""

from __future__ import annotations

import signal
import sys
from collections import Counter

from studies.threads import one_thread

one_thread()  # before NumPy is imported

import pytest  # noqa: E402

import symheli  # noqa: E402

TOGETHER = {
    **{
        f"tests/studies/test_{name}.py": "the report"
        for name in ("report", "report_numbers", "report_in_browser", "what_stages_read")
    },
    **{
        f"tests/synthesis/design/test_{name}.py": "the controller of the spring"
        for name in ("sampling", "reduction")
    },
}
"""Files that need the same long computation: one process does it once."""

LONGEST = (
    "tests/house/test_rooms.py",
    "tests/synthesis/certify/test_saved_certificates.py",
    "tests/synthesis/certify/test_second_witness.py",
    "the report",
    "tests/synthesis/certify/test_about_the_model_given.py",
    "tests/synthesis/certify/test_uncertain_models.py",
    "tests/synthesis/certify/test_never_call_unstable_stable.py",
    "tests/records/test_kinematic_check.py",
    "tests/synthesis/certify/test_order_of_bounds.py",
    "tests/synthesis/certify/test_tied_rates.py",
    "tests/synthesis/design/test_certify.py",
    "tests/synthesis/design/test_wrong_parameter.py",
    "tests/studies/test_resumed_study.py",
)
"""Handed out first, so that none of them keeps one process busy when the others have ended."""


def lot(nodeid):
    """What a process gets at once: a file, or those that belong `TOGETHER`."""
    file = nodeid.split("::", 1)[0]
    return TOGETHER.get(file, file)


def quick_case(item, mark):
    """Whether a marker `slow` of a function leaves out this case of it."""
    case = item.callspec.id if hasattr(item, "callspec") else None
    but, only = (
        (ids,) if isinstance(ids, str) else ids
        for ids in (mark.kwargs.get("but", ()), mark.kwargs.get("only", ()))
    )
    return case in but or (bool(only) and case not in only)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Quick cases of slow tests are not slow. In processes: the longest lots first, then those of
    many tests.
    """
    for item in items:
        item.own_markers = [
            m for m in item.own_markers if not (m.name == "slow" and quick_case(item, m))
        ]
    if hasattr(config, "workerinput"):
        size = Counter(lot(item.nodeid) for item in items)
        first = {name: place for place, name in enumerate(LONGEST)}
        items.sort(
            key=lambda item: (
                first.get(own := lot(item.nodeid), len(first)),
                -size[own],
                own,
            )
        )


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """That of `--dist loadfile`, with `lot` in place of the file and in the order above."""
    if config.getvalue("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    class Lots(LoadFileScheduling):
        def _split_scope(self, nodeid):
            return lot(nodeid)

    config.option.loadscopereorder = False
    return Lots(config, log)


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


@pytest.fixture(scope="module")
def interruptible():
    """An interrupt from the keyboard is heard, here and in processes begun here: one that was begun
    with it ignored, by nohup or in the background of a shell, would hand that on to all of them.
    """
    before = signal.getsignal(signal.SIGINT)
    if before == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
