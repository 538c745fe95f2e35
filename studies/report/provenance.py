"""Provenance of the numbers of a report: date, source, command, machine."""

from __future__ import annotations

import datetime
import os
import platform
import re
import shutil
import subprocess
import sys
from functools import cache
from importlib.metadata import version
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def provenance() -> dict[str, str]:
    """Date of writing (UTC), source (commit where this is a git checkout, else version), command,
    processor, system.
    """
    now = datetime.datetime.now(datetime.UTC)
    return {
        "date": now.strftime("%Y-%m-%d %H:%M UTC"),
        "source": source(ROOT),
        "command": command(),
        "processor": processor(),
        "system": f"{platform.system()} {platform.machine()}",
    }


@cache
def source(root: Path) -> str:
    """Return the commit checked out in root, and whether files differ from it; the version without
    one.
    """
    git = shutil.which("git")
    if git is None or not (root / ".git").exists():
        return f"version {version('symheli')}"
    try:
        commit, changed = (
            subprocess.run(
                [git, "-C", str(root), *words],
                check=True,
                capture_output=True,
                text=True,
                timeout=10,
            ).stdout.strip()
            for words in (("rev-parse", "HEAD"), ("status", "--porcelain", "-uno"))
        )
    except (OSError, subprocess.SubprocessError):
        return f"version {version('symheli')}"
    return f"commit {commit[:12]}{', with changes' if changed else ''}"


def command() -> str:
    """Return the command that started this process."""
    return " ".join([Path(sys.argv[0]).name, *sys.argv[1:]])


def processor() -> str:
    """Return the name of the processor and the number of its cores."""
    try:
        found = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text(encoding="utf-8"))
        name = found[1] if found else ""
    except OSError:
        name = ""
    return f"{name or platform.processor() or platform.machine()}, {os.cpu_count()} cores"
