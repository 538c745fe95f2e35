"""Names of a package that are loaded when they are first used, and former names of them."""

import ast
import importlib
import importlib.util
import sys
import warnings
from collections.abc import Callable, Sequence
from functools import cache
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any


def lazily(
    package: str, file: str
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return `__getattr__`, `__dir__` and `__all__` of a package or module with a stub.

    The stub, the .pyi beside its `file`, imports every public name once, `from module import name
    as name`; a submodule that it imports is no name of `__all__`. former.toml beside it has names
    and modules of the last release: each still works, with a FutureWarning that names the new one.
    """
    stub = ast.parse(Path(file).with_suffix(".pyi").read_text(encoding="utf-8"))
    every = {
        alias.name: node.module
        for node in stub.body
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }
    modules = {name for name, module in every.items() if module == package}
    home = {name: module for name, module in every.items() if name not in modules}

    class Package(ModuleType):
        """A package in which a public name is never hidden by the module of that name."""

        def __setattr__(self, name: str, value: Any) -> None:
            if not (isinstance(value, ModuleType) and (name in home or name in former())):
                super().__setattr__(name, value)

    sys.modules[package].__class__ = Package
    table = Path(file).with_name("former.toml")
    if Path(file).name == "__init__.py" and table.exists():
        sys.meta_path.append(FormerModules(package, table))

    def former() -> dict[str, str]:
        return _read(table).get("names", {}) if Path(file).name == "__init__.py" else {}

    def find(name: str) -> Any:
        if name in modules:
            return importlib.import_module(f"{package}.{name}")
        if name not in home:
            return _former_name(package, former(), name)
        value = getattr(importlib.import_module(home[name]), name)
        setattr(sys.modules[package], name, value)
        return value

    def names() -> list[str]:
        own = {name for name in vars(sys.modules[package]) if name.startswith("__")}
        return sorted(own | {*home, *modules})

    return find, names, sorted(home)


@cache
def _read(table: Path) -> dict[str, dict[str, str]]:
    import tomllib

    return tomllib.loads(table.read_text(encoding="utf-8")) if table.exists() else {}


def _former_name(package: str, former: dict[str, str], name: str) -> Any:
    """Return what a former name stands for; raise `AttributeError` for no such name."""
    new = former.get(name)
    if new is None:
        raise AttributeError(f"module {package!r} has no attribute {name!r}")
    warnings.warn(
        f"{package}.{name} is {new} now; the old name goes with the next release",
        FutureWarning,
        stacklevel=3,
    )
    module, _, own = new.rpartition(".")
    return getattr(importlib.import_module(module), own)


def former_attribute(old: str, new: str) -> property:
    """Return a property for the former name of an attribute: it warns, and gives the new one."""

    def found(self: Any) -> Any:
        now = f"{type(self).__name__}.{old} is .{new} now; the old name goes with the next release"
        warnings.warn(now, FutureWarning, stacklevel=2)
        return getattr(self, new)

    return property(found, doc=f"Former name of `{new}`, for this release.")


class FormerModules(MetaPathFinder, Loader):
    """Finder of modules that have moved: the module of a former path has the names of the new one.

    It is asked last, for modules of one package that are not there.
    """

    def __init__(self, package: str, table: Path) -> None:
        self.package, self.table = package, table

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the specification of a module that has moved; None for any other."""
        if not fullname.startswith(f"{self.package}."):
            return None
        for old, new in _read(self.table).get("modules", {}).items():
            if fullname == old or fullname.startswith(f"{old}."):
                now = new + fullname[len(old) :]
                if importlib.util.find_spec(now) is not None:
                    return ModuleSpec(fullname, self, loader_state=now, is_package=True)
        return None

    def create_module(self, spec: ModuleSpec) -> None:
        """Let a module be made as usual."""

    def exec_module(self, module: ModuleType) -> None:
        """Take over the names of the module that it is now."""
        spec = module.__spec__
        now = spec.loader_state if spec is not None else None
        warnings.warn(
            f"{module.__name__} is {now} now; the old path goes with the next release",
            FutureWarning,
            stacklevel=2,
        )
        own = vars(importlib.import_module(str(now)))
        vars(module).update({name: value for name, value in own.items() if name[:2] != "__"})
