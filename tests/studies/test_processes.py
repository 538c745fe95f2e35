"""Calls side by side in processes of their own."""

import os
import subprocess
import sys
import textwrap
import time
from functools import partial

import pytest

from studies.processes import Processes
from symheli.errors import InputError, SymheliError, UnknownNameError
from symheli.values.signal import indices, signals


def submitted(processes, calls):
    return [processes.submit(call) for call in calls]


def test_every_call_is_answered_in_its_place():
    with Processes(2) as processes:
        answers = submitted(processes, [partial(pow, 2, k) for k in range(20)])
        assert [a.result() for a in answers] == [2**k for k in range(20)]
        assert processes.submit(os.getpid).result() != os.getpid()


@pytest.mark.parametrize("count", [1, 2])
def test_an_exception_comes_back_and_the_others_go_on(count):
    with Processes(count) as processes:
        bad, good = submitted(processes, [partial(int, "x"), partial(int, "7")])
        with pytest.raises(ValueError, match="invalid literal"):
            bad.result()
        assert good.result() == 7


def test_what_a_call_prints_is_no_answer(capfd):
    with Processes(2) as processes:
        assert processes.submit(partial(print, "hello")).result() is None
    assert "hello" in capfd.readouterr().err


def test_a_process_that_dies_says_so_and_the_others_are_answered():
    with Processes(2) as processes:
        dead, *alive = submitted(
            processes, [partial(os._exit, 3), *(partial(pow, k, 2) for k in range(6))]
        )
        with pytest.raises(SymheliError, match="a process that computed _exit has ended"):
            dead.result()
        assert [a.result() for a in alive] == [k**2 for k in range(6)]


def test_what_cannot_travel_is_refused_at_once():
    with Processes(2) as processes, pytest.raises(InputError, match="define its function in a"):
        processes.submit(lambda: 3)


def test_leaving_by_an_exception_ends_what_is_under_way():
    def enough():
        with Processes(2) as processes:
            submitted(processes, [partial(time.sleep, 60)] * 4)
            raise InputError("enough")

    begin = time.monotonic()
    with pytest.raises(InputError):
        enough()
    assert time.monotonic() - begin < 30


@pytest.mark.slow
def test_a_script_without_a_guard_may_ask(tmp_path):
    """Nothing of the script is imported again, so that it need not guard its main part."""
    script = tmp_path / "script.py"
    script.write_text(
        textwrap.dedent("""
        from functools import partial
        from studies.processes import Processes
        print("begin")
        with Processes(2) as processes:
            print(processes.submit(partial(pow, 3, 2)).result())
        """)
    )
    said = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert said.stdout.split() == ["begin", "9"]


def test_an_error_with_arguments_of_its_own_comes_back_as_it_was():
    with Processes(2) as processes:
        unknown = partial(indices, ["phy"], signals(("phi", "theta")), "signal")
        answer = processes.submit(unknown)
        with pytest.raises(UnknownNameError, match="did you mean 'phi'"):
            answer.result(timeout=60)


def test_an_answer_that_cannot_be_read_is_said_and_does_not_hang(tmp_path, monkeypatch):
    (tmp_path / "elsewhere.py").write_text(
        "class Unreadable(Exception):\n"
        "    def __init__(self, first, second):\n"
        "        super().__init__(first)\n"
        "def fail():\n"
        "    raise Unreadable(1, 2)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    import elsewhere  # type: ignore[import-not-found]

    with Processes(2) as processes:
        bad, good = submitted(processes, [elsewhere.fail, partial(int, "7")])
        with pytest.raises(SymheliError, match="cannot be read here"):
            bad.result(timeout=60)
        assert good.result(timeout=60) == 7


def test_processes_that_are_ended_answer_nothing_more():
    """At once, in the middle of a call; what waits is cancelled."""
    with Processes(1) as processes:
        under_way, waiting = submitted(processes, [partial(time.sleep, 60), partial(pow, 2, 3)])
        until = time.monotonic() + 10
        while not processes._workers and time.monotonic() < until:
            time.sleep(0.01)
        processes.end()
        with pytest.raises(SymheliError, match="has ended"):
            under_way.result(timeout=5)
        assert waiting.cancelled()
