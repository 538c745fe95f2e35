"""Progress goes to standard error: bars on a terminal, elsewhere lines now and then."""

import os
import subprocess
import sys
import threading

import pytest

from studies import progress
from studies.progress import Display, Lines, _Open, displayed, duration
from symheli.progress import Progress, task, tracked

WORK = """
import sys, time
from studies.progress import displayed
from symheli.progress import tracked
with displayed():
    for k in tracked("outer [of it]", range({steps})):
        for _ in tracked("inner", range(2)):
            time.sleep({pause})
        sys.stderr.write(f"  printed {{k}}\\n")
print("the answer")
"""


def run(steps, pause, **streams):
    return subprocess.Popen(
        [sys.executable, "-c", WORK.format(steps=steps, pause=pause)],
        stdout=subprocess.PIPE,
        text=True,
        **streams,
    )


@pytest.mark.slow
def test_on_a_terminal_there_are_bars_and_what_is_printed_stays_whole():
    pty = pytest.importorskip("pty", reason="a terminal of POSIX")
    ours, theirs = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "100"}
    child = run(4, 0.3, stderr=theirs, env=environment)
    os.close(theirs)
    shown = []

    def read():
        try:
            while part := os.read(ours, 4096):
                shown.append(part)
        except OSError:  # the other end is closed
            pass

    reader = threading.Thread(target=read)
    reader.start()
    out, _ = child.communicate(timeout=60)
    reader.join(10)
    os.close(ours)
    text = b"".join(shown).decode()
    assert out == "the answer\n"
    assert "Traceback" not in text
    for part in ("outer [of it]", "3 of 4", "left", *(f"  printed {k}" for k in range(4))):
        assert part in text


@pytest.mark.slow
def test_where_there_is_no_terminal_there_are_lines_after_a_while():
    child = run(3, 0.5, stderr=subprocess.PIPE)
    out, err = child.communicate(timeout=60)
    assert out == "the answer\n"
    lines = [line for line in err.splitlines() if "printed" not in line]
    assert len(lines) == 1  # after two seconds, and the next in ten
    assert lines[0].startswith("symheli: outer [of it]: ")
    assert lines[0].endswith(" left")


def test_what_is_over_soon_shows_nothing_and_loads_nothing(capfd):
    with displayed():
        for _ in tracked("short", range(100)):
            pass
    assert capfd.readouterr() == ("", "")
    code = (
        "import sys; from studies import cli; cli.main(['trim', '--airspeed', '5', '--json']);"
        " sys.exit('rich' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == 0


def begun(at, since, stepped):
    return _Open(at, since=since, stepped=stepped)


def test_the_remaining_time_is_that_of_the_speed_so_far_less_what_has_passed():
    part = begun(Progress("x", 3, 12), 100.0, 130.0)
    assert part.remaining(130.0) == pytest.approx(90.0)
    assert part.remaining(150.0) == pytest.approx(70.0)
    assert part.remaining(221.0) is None  # that step takes longer than all that was left
    assert begun(Progress("x", 12, 12), 100.0, 130.0).remaining(130.0) == 0
    for unknown in (Progress("x", 0, 12), Progress("x", 3, None), Progress("x", 4, 100)):
        assert begun(unknown, 100.0, 130.0).remaining(130.0) is None


def test_time_is_measured_to_the_last_step_whatever_is_noted_between():
    part = begun(Progress("x", 0, 10), 0.0, 0.0)
    part.step(Progress("x", 1, 10), 10.0)
    part.step(Progress("x", 1, 10, "the same step"), 30.0)
    assert part.remaining(30.0) == pytest.approx(70.0)


def test_a_line_tells_of_the_whole_and_of_the_innermost_part(capsys):
    lines = Lines()
    whole = Progress("study", 60.0, 200.0, percent=True)
    tasks = [begun(whole, 0.0, 60.0), begun(Progress("stage"), 1.0, 1.0)]
    tasks.append(begun(Progress("flying", 1, 4, "gusts"), 2.0, 2.0))
    lines.show(tasks, 1.0)
    assert not capsys.readouterr().err
    lines.show(tasks, 60.0)
    said = capsys.readouterr().err
    assert said == "symheli: study: 30 %; flying: 1 of 4 (gusts), about 2:20 min left\n"
    lines.show(tasks, 600.0)
    assert not capsys.readouterr().err  # nothing has changed
    assert duration(7260.0) == "2:01 h"


def test_the_time_a_part_will_take_is_not_said_of_the_whole(capsys):
    whole, part = Progress("study", 1, 100, percent=True), Progress("answers", 3, 4)
    Lines().show([begun(whole, 0.0, 10.0), begun(part, 0.0, 30.0)], 30.0)
    assert capsys.readouterr().err == "symheli: study: 1 %; answers: 3 of 4\n"


def test_the_display_keeps_the_open_tasks_only():
    seen = []

    class Kept:
        def show(self, tasks, now):
            seen.append([one.at.task for one in tasks])

        def close(self):
            seen.append("closed")

    display = Display(Kept())
    with progress.watched(display):
        with task("a"), task("b"):
            assert [one.at.task for one in display._open] == ["a", "b"]
        for _ in tracked("c", range(2)):
            assert [one.at.task for one in display._open] == ["c"]
    assert not display._open
    display.close()
    assert seen[-1] == "closed"
