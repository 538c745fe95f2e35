"""Calls that are known to be good: those that the examples of the docstrings make, caught while
they run.

A new name of a package is fuzzed as soon as its docstring shows it, without a line here.
"""

from __future__ import annotations

import doctest
import importlib
import inspect
import os
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, FrameType
from typing import Any, NamedTuple

sys.path.append(str(Path(__file__).resolve().parents[1]))  # also where pytest is not

from public_faces import faces, names

import symheli.threads

PACKAGES = faces()
EXAMPLE = "<doctest"
INSIDE = {
    *("symheli.LFT", "symheli.LinearFamily", "symheli.FlightRecord"),
    *("symheli.values.NamedVector", "symheli.flight.StitchedModel"),
    *("symheli.TableController", "synthesis.analysis.PolynomialMatrix"),
}
"""Values that the examples make by other functions: caught where those make them."""


class ValidCall(NamedTuple):
    """`function(*positional, **named)`, where `arguments` are by name, defaults among them."""

    entry: str
    """`package.function`, `package.Class` (it is made) or `package.Class.method`."""
    function: Callable[..., Any]
    """The function, or the class, or the method of an object."""
    arguments: dict[str, Any]
    kinds: dict[str, inspect.Parameter]

    def repeated(self, changed: dict[str, Any] | None = None) -> Any:
        """What the call returns, with some arguments changed."""
        positional: list[Any] = []
        named: dict[str, Any] = {}
        for name, value in {**self.arguments, **(changed or {})}.items():
            kind = self.kinds[name].kind
            if kind is inspect.Parameter.VAR_POSITIONAL:
                positional.extend(value)
            elif kind is inspect.Parameter.VAR_KEYWORD:
                named.update(value)
            elif kind is inspect.Parameter.KEYWORD_ONLY:
                named[name] = value
            else:
                positional.append(value)
        return self.function(*positional, **named)


def exported() -> Iterator[tuple[str, Any]]:
    """(package.name, thing) of every public callable of the packages."""
    for package in PACKAGES:
        module = importlib.import_module(package)
        for name in names(package):
            thing = getattr(module, name)
            if isinstance(thing, type) or callable(thing):
                yield f"{package}.{name}", thing


def _watched() -> dict[CodeType, tuple[str, str]]:
    """(entry, how it is called) of the code of every public function and method."""
    found: dict[CodeType, tuple[str, str]] = {}
    for entry, thing in exported():
        if not isinstance(thing, type):
            found[inspect.unwrap(thing).__code__] = entry, "function"
            continue
        for owner in thing.__mro__[:-1]:
            for name, member in vars(owner).items():
                if name.startswith("_") and name not in ("__init__", "__new__", "__call__"):
                    continue
                code = getattr(getattr(member, "__func__", member), "__code__", None)
                if code is None:
                    continue
                if name in ("__init__", "__new__"):
                    found.setdefault(code, (entry, "made"))
                else:
                    how = "static" if isinstance(member, staticmethod) else "method"
                    found.setdefault(code, (f"{entry}.{name}", how))
    return found


def caught(entries: Callable[[str], bool] = lambda _: True) -> list[ValidCall]:
    """The calls of the examples of the names that `entries` accepts, in their order, each entry at
    most three times.
    """
    watched, calls, seen = _watched(), list[ValidCall](), dict[str, int]()
    classes = {thing: entry for entry, thing in exported() if isinstance(thing, type)}

    def watch(frame: FrameType, event: str, _: object) -> None:
        if event != "call" or frame.f_code not in watched or frame.f_back is None:
            return
        entry, how = watched[frame.f_code]
        if how == "made":  # an inherited one: of which class?
            first = next(iter(frame.f_locals.values()), None)
            made = first if isinstance(first, type) else type(first)
            entry = classes.get(made, "")
        caller: FrameType | None = frame.f_back
        while caller is not None and caller.f_code.co_filename == symheli.threads.__file__:
            caller = caller.f_back  # a decorator of this project is not who asks
        direct = caller is not None and caller.f_code.co_filename.startswith(EXAMPLE)
        if not entry or not (direct or (entry in INSIDE and not seen.get(entry))):
            return
        seen[entry] = seen.get(entry, 0) + 1
        if seen[entry] <= 3:
            calls.append(_call(frame, entry, how))

    home = os.getcwd()
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        os.chdir(folder)
        try:
            started = {}
            for entry, thing in exported():
                if not entries(entry):
                    continue
                package = entry.partition(".")[0]
                if package not in started:
                    module = importlib.import_module(package)
                    started[package] = _run(module.__doc__ or "", {}, watch)
                own = sys.modules.get(getattr(thing, "__module__", ""))
                names = {**(vars(own) if own else {}), **vars(sys.modules[package])}
                _run(inspect.getdoc(thing) or "", {**names, **started[package]}, watch)
        finally:
            os.chdir(home)
    return calls


def _run(text: str, names: dict[str, Any], watch: Any) -> dict[str, Any]:
    """The names after the examples; what they print is for another test."""
    test = doctest.DocTestParser().get_doctest(text, names, "valid call", None, None)
    before = sys.getprofile()
    sys.setprofile(watch)
    try:
        doctest.DocTestRunner(verbose=False).run(test, out=lambda _: None, clear_globs=False)
    finally:
        sys.setprofile(before)
    return test.globs


def _call(frame: FrameType, entry: str, how: str) -> ValidCall:
    given = dict(frame.f_locals)
    names = list(inspect.getargvalues(frame).args)
    first = given[names[0]] if how in ("method", "made") else None
    if how == "method":
        function = getattr(first, frame.f_code.co_name)
    elif how == "made":
        function = first if isinstance(first, type) else type(first)
    else:
        package, *path = entry.split(".")
        function = importlib.import_module(package)
        for name in path:
            function = getattr(function, name)
    kinds = dict(inspect.signature(function).parameters)
    arguments = {name: given[name] for name in kinds if name in given}
    return ValidCall(entry, function, arguments, kinds)
