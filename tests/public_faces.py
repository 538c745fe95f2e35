"""The modules that users import names from: the packages, and what stands one level lower."""

import importlib
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TOP = ("symheli", "identification", "synthesis")
NEW = ("synthesis.regions", "synthesis.tubes")
"""Modules with names that never stood at the top: all of them are public."""


def moved(package):
    """Paths of the names that stood at the top of a package and stand lower now."""
    table = ROOT / package.replace(".", "/") / "former.toml"
    paths = tomllib.loads(table.read_text(encoding="utf-8"))["names"].values()
    public = (path.rpartition(".") for path in paths if path.startswith(f"{package}."))
    return {(m, name) for m, _, name in public if name in getattr(module(m), "__all__", (name,))}


def lower(package):
    """The modules below a package to which names of it have gone."""
    found = {m for m, _ in moved(package)} | {m for m in NEW if m.startswith(f"{package}.")}
    return sorted(m for m in found if hasattr(module(m), "__all__") or m.count(".") == 1)


def names(face):
    """Public names of a package, or of a module that only names again what rooms hold; of another
    module below a package those that stood at the top.
    """
    house = tomllib.loads((ROOT / "evidence" / "house.toml").read_text(encoding="utf-8"))
    if face in (*TOP, "symheli.lpv", "symheli.lpv.tools", *house["faces"], *NEW):
        return list(module(face).__all__)
    packages = [package for package in (*TOP, "symheli.lpv") if face.startswith(f"{package}.")]
    return sorted({name for p in packages for m, name in moved(p) if m == face})


def module(path):
    return importlib.import_module(path)


def faces(packages=TOP):
    """Every package with the modules below it, in order, each once."""
    return tuple(dict.fromkeys(m for package in packages for m in (package, *lower(package))))


def root_of(face):
    """The package whose docstring has the beginning of the examples."""
    if ">>> " in (module(face).__doc__ or ""):
        return face
    parts = face.split(".")
    return "symheli.lpv" if parts[:2] == ["symheli", "lpv"] else parts[0]
