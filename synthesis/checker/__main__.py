"""Runs the checker: as a folder, as a copy of it, or as a module of the package."""

import importlib.util
import sys
from pathlib import Path

if not __package__:
    # the folder was run by its path: load it as the package `checker`, wherever it lies
    start = Path(__file__).resolve().with_name("__init__.py")
    spec = importlib.util.spec_from_file_location(
        "checker", start, submodule_search_locations=[str(start.parent)]
    )
    assert spec is not None  # noqa: S101 - the file is there
    sys.modules["checker"] = importlib.util.module_from_spec(spec)
    __package__ = "checker"

from .report import main

sys.exit(main(sys.argv[1:]))
