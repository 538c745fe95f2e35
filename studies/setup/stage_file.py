"""Results of a stage as a file: arrays as .npy members of a ZIP archive (npz), everything else as
one JSON member. Reading such a file runs none of its content: it names classes of this project's
packages only, whose instances get back the attributes they had.
"""

from __future__ import annotations

import dataclasses
import enum
import importlib
import io
import json
import math
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np

PACKAGES = ("symheli", "identification", "synthesis", "studies", "evidence")
"""Classes of other packages are neither written nor read."""
TREE = "tree.json"
ALLOWED = (int, float, str, bool, type(None))


class UnreadableError(ValueError):
    """The bytes are not those of such a file; the message says where they differ."""


def written(value: Any) -> bytes:
    """The bytes of a file that holds the value. Raises `TypeError` for a value of a class that
    cannot be stored, with its name.
    """
    tree = _Writer()
    root = tree.node(value)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(zipfile.ZipInfo(TREE), json.dumps({"root": root, "objects": tree.objects}))
        for k, array in enumerate(tree.arrays):
            with archive.open(zipfile.ZipInfo(f"{k}.npy"), "w") as member:
                np.lib.format.write_array(member, array, allow_pickle=False)
    return buffer.getvalue()


def read(content: bytes) -> Any:
    """The value of such a file. Raises `UnreadableError` for anything else."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            tree = json.loads(archive.read(TREE))
            arrays = []
            for k in range(len(archive.namelist()) - 1):
                with archive.open(f"{k}.npy") as member:
                    arrays.append(np.lib.format.read_array(member, allow_pickle=False))
        return _TreeReader(tree["objects"], arrays).value(tree["root"])
    except (
        *(zipfile.BadZipFile, KeyError, IndexError, TypeError, ValueError, AttributeError),
        *(ImportError, OSError, EOFError, RecursionError),
    ) as error:
        raise UnreadableError(f"{type(error).__name__}: {error}") from error


class _Writer:
    """The tree of a value. An object that occurs twice is written once and referred to, so that
    what was one object is one object again.
    """

    def __init__(self) -> None:
        self.objects: list[Any] = []
        self.arrays: list[np.ndarray] = []
        self._known: dict[int, tuple[int, Any]] = {}

    def node(self, value: Any) -> Any:
        if type(value) in ALLOWED:
            finite = not isinstance(value, float) or math.isfinite(value)
            return value if finite else {"float": repr(value)}
        if id(value) in self._known:
            return {"object": self._known[id(value)][0]}
        place = len(self.objects)
        self.objects.append(None)
        self._known[id(value)] = (place, value)  # holds the value, so that its id stays its own
        self.objects[place] = self._written(value)
        return {"object": place}

    def _written(self, value: Any) -> dict[str, Any]:
        kind = type(value)
        if isinstance(value, np.ndarray) and value.dtype != object:
            self.arrays.append(value)
            return {"array": len(self.arrays) - 1, "fixed": not value.flags.writeable}
        if isinstance(value, np.generic):
            self.arrays.append(np.asarray(value))
            return {"scalar": len(self.arrays) - 1}
        if isinstance(value, complex):
            return {"complex": [repr(value.real), repr(value.imag)]}
        if kind in (list, tuple):
            return {kind.__name__: [self.node(each) for each in value]}
        if isinstance(value, dict) and kind is dict:
            return {"dict": [[self.node(k), self.node(v)] for k, v in value.items()]}
        if not _ours(kind):
            raise TypeError(f"a value of {kind.__module__}.{kind.__qualname__} cannot be stored")
        if isinstance(value, enum.Enum):
            return {"class": _name(kind), "member": value.name}
        if isinstance(value, tuple):
            return {"class": _name(kind), "tuple": [self.node(each) for each in value]}
        if dataclasses.is_dataclass(value):
            state = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
        elif hasattr(value, "__dict__"):
            state = vars(value)
        else:
            names = (name for each in kind.__mro__ for name in getattr(each, "__slots__", ()))
            state = {name: getattr(value, name) for name in names if hasattr(value, name)}
        out = {"class": _name(kind), "state": {n: self.node(each) for n, each in state.items()}}
        return out | {"text": str.__str__(value)} if isinstance(value, str) else out


class _TreeReader:
    """The value of a tree, each object of it made once."""

    def __init__(self, objects: list[Any], arrays: list[np.ndarray]):
        self._objects, self._arrays = objects, arrays
        self._made: dict[int, Any] = {}

    def value(self, node: Any) -> Any:
        if not isinstance(node, dict):
            return node
        if "float" in node:
            return float(node["float"])
        place = node["object"]
        if place not in self._made:
            self._made[place] = self._read(self._objects[place])
        return self._made[place]

    def _read(self, node: Mapping[str, Any]) -> Any:
        if "array" in node:
            array = self._arrays[node["array"]]
            array.flags.writeable = not node["fixed"]
            return array
        if "scalar" in node:
            return self._arrays[node["scalar"]][()]
        if "complex" in node:
            return complex(*map(float, node["complex"]))
        if "dict" in node:
            return {self.value(k): self.value(v) for k, v in node["dict"]}
        for make in (list, tuple):
            if make.__name__ in node and "class" not in node:
                return make(self.value(each) for each in node[make.__name__])
        kind = _named(node["class"])
        if "member" in node:
            return kind[node["member"]]
        if "tuple" in node:
            return tuple.__new__(kind, (self.value(each) for each in node["tuple"]))
        state = {name: self.value(each) for name, each in node["state"].items()}
        fields = getattr(kind, "__dataclass_fields__", {})
        if fields and kind.__init__ is not object.__init__:
            given = {name for name, field in fields.items() if field.init}
            found = kind(**{name: state.pop(name) for name in given & state.keys()})
        else:
            found = str.__new__(kind, node["text"]) if "text" in node else object.__new__(kind)
        for name, each in state.items():
            object.__setattr__(found, name, each)
        return found


def _named(name: str) -> Any:
    """The class of this name; `ValueError` for one of another package."""
    module, _, path = name.partition(":")
    if module.split(".")[0] not in PACKAGES:
        raise ValueError(f"{name} is no class of this project")
    found: Any = importlib.import_module(module)
    for part in path.split("."):
        found = getattr(found, part)
    if not (isinstance(found, type) and _ours(found)):
        raise ValueError(f"{name} is no class of this project")
    return found


def _name(kind: Any) -> str:
    return f"{kind.__module__}:{kind.__qualname__}"


def _ours(kind: type) -> bool:
    return kind.__module__.split(".")[0] in PACKAGES
