"""The compiler is ended with all that it has started."""

import os
import time

import pytest

from symheli.codegen import compile as compiling
from symheli.errors import CompilerWarning


@pytest.fixture
def slow_compiler(tmp_path, monkeypatch):
    """A compiler that starts another process, as gcc starts cc1, and writes its number."""
    path = tmp_path / "cc"
    path.write_text(f"#!/bin/sh\nsleep 60 &\necho $! > {tmp_path}/child\nwait\n")
    path.chmod(0o755)
    monkeypatch.setattr(compiling, "compiler", lambda: str(path))
    monkeypatch.setenv("SYMHELI_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(compiling, "LONGEST", 0.5)
    return tmp_path / "child"


def gone(process):
    """Whether a process has ended, or is only waited for by whoever has taken it over."""
    for _ in range(100):
        try:
            with open(f"/proc/{process}/stat") as file:
                if file.read().split()[2] == "Z":
                    return True
        except FileNotFoundError:
            return True
        time.sleep(0.02)
    return False


@pytest.mark.skipif(not os.path.isdir("/proc"), reason="asks /proc")
def test_a_compilation_that_takes_too_long_leaves_no_process(slow_compiler):
    with pytest.warns(CompilerWarning, match="compiling f failed"):
        assert compiling.library("int f(void) { return 1; }", "f") is None
    assert gone(int(slow_compiler.read_text()))


def test_what_the_compiler_says_is_said(tmp_path, monkeypatch):
    path = tmp_path / "cc"
    path.write_text("#!/bin/sh\necho no such thing >&2\nexit 1\n")
    path.chmod(0o755)
    with pytest.raises(compiling.subprocess.CalledProcessError) as failed:
        compiling._run([str(path)])
    assert failed.value.stderr == b"no such thing\n"
