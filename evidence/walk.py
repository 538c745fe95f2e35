"""The way of a parameter through static calls: which modules it enters, or a value that carries it.

Followed are arguments of calls to functions and classes of the packages: a name that is bound to
the parameter, a value that was made from it (a class called with it, `replace` of one), and
attributes of such a value that were filled with it. Calls of the value's own methods and what is
left out (`LEFT_OUT`) do not count.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass, field

from evidence.house import House

LEFT_OUT = ("symheli.values", "symheli.errors", "symheli.progress", "symheli.threads")
"""Rooms of values, errors and progress: who enters them learns nothing of the way."""

COPIES = ("_replace", "with_", "to_", "scaled", "select")
"""Beginnings of methods that return a value changed."""

Function = tuple[str, str]
"""Module and qualified name."""


@dataclass
class Walk:
    """The walk of one parameter of a function through a house."""

    house: House
    entered: dict[str, list[str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Find the functions and classes of every module."""
        self.definitions: dict[Function, ast.AST] = {}
        self.fields: dict[Function, list[str]] = {}
        self.names: dict[str, dict[str, Function]] = {}
        self.filled: set[str] = set()
        self.done: set[tuple[Function, frozenset[str]]] = set()
        self.returning: set[Function] = set()
        self.carrying: set[Function] = set()
        for module, path in self.house.files.items():
            own: dict[str, Function] = {}
            for node in ast.walk(tree := ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ImportFrom) and node.module:
                    for alias in node.names:
                        home, name = self.house.home(node.module, alias.name)
                        if name is not None:
                            own[alias.asname or alias.name] = (home, name)
            for node in tree.body:
                if isinstance(node, ast.FunctionDef | ast.ClassDef):
                    own[node.name] = (module, node.name)
                    self.definitions[module, node.name] = node
                if isinstance(node, ast.ClassDef):
                    self.fields[module, node.name] = [
                        item.target.id
                        for item in node.body
                        if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name)
                    ]
                    for item in node.body:
                        if isinstance(item, ast.FunctionDef):
                            self.definitions[module, f"{node.name}.{item.name}"] = item
            self.names[module] = own

    def follow(self, start: Function, parameter: str) -> dict[str, list[str]]:
        """Return the functions entered, by module; again until no more is found on the way."""
        before = -1
        while before != (before := len(self.returning) + len(self.carrying) + len(self.filled)):
            self.done.clear()
            self._once(start, parameter)
        return self.entered

    def _once(self, start: Function, parameter: str) -> None:
        todo = [(start, frozenset({parameter}))]
        while todo:
            (module, name), carried = todo.pop()
            if ((module, name), carried) in self.done:
                continue
            self.done.add(((module, name), carried))
            if not any(module == room or module.startswith(f"{room}.") for room in LEFT_OUT):
                known = self.entered.setdefault(module, [])
                if name not in known:
                    known.append(name)
            todo += self._calls(module, name, set(carried))

    def _calls(
        self, module: str, name: str, carried: set[str]
    ) -> Iterator[tuple[Function, frozenset[str]]]:
        node = self.definitions.get((module, name))
        if not isinstance(node, ast.FunctionDef):
            return
        owner = name.rpartition(".")[0]
        for _ in range(2):  # what is bound below may be used above, in a loop
            for child in ast.walk(node):
                if isinstance(child, ast.Assign | ast.AnnAssign | ast.NamedExpr) and child.value:
                    if self._carries(module, child.value, carried):
                        targets = child.targets if isinstance(child, ast.Assign) else [child.target]
                        for target in targets:
                            carried |= set(_bound(target, self.filled))
        for child in ast.walk(node):
            if isinstance(child, ast.Return | ast.Yield) and child.value is not None:
                if self._carries(module, child.value, carried):
                    self.returning.add((module, name))
            if isinstance(child, ast.Call):
                yield from self._call(module, owner, child, carried)

    def _call(
        self, module: str, owner: str, call: ast.Call, carried: set[str]
    ) -> Iterator[tuple[Function, frozenset[str]]]:
        if isinstance(call.func, ast.IfExp):
            for func in (call.func.body, call.func.orelse):
                either = ast.Call(func, call.args, call.keywords)
                yield from self._call(module, owner, either, carried)
            return
        target = self._target(module, owner, call.func)
        if isinstance(call.func, ast.Attribute) and (
            target is None or ast.unparse(call.func.value) == "self"
        ):
            if self._carries(module, call.func.value, carried):
                for home, name in sorted(self.carrying):
                    own = (home, f"{name}.{call.func.attr}")
                    if own in self.definitions:
                        yield own, frozenset({"self"})
        positional = [self._carries(module, a, carried) for a in call.args]
        named = {k.arg for k in call.keywords if k.arg and self._carries(module, k.value, carried)}
        if target is None or not (any(positional) or named):
            return
        definition = self.definitions.get(target)
        if isinstance(definition, ast.ClassDef):
            fields = self.fields[target]
            first = f"{target[1]}.__init__"
            made = self.definitions.get((target[0], first))
            if isinstance(made, ast.FunctionDef):
                fields = [a.arg for a in made.args.args[1:]]
                target = (target[0], first)
            held = {f for f, there in zip(fields, positional, strict=False) if there} | named
            self.filled |= held
            self._carry((target[0], target[1].partition(".")[0]))
            yield target, frozenset(held)
        elif isinstance(definition, ast.FunctionDef):
            arguments = [a.arg for a in definition.args.args]
            if "." in target[1] and arguments[:1] in (["self"], ["cls"]):
                arguments = arguments[1:]
            held = {a for a, there in zip(arguments, positional, strict=False) if there} | named
            yield target, frozenset(held)

    def _carry(self, kind: Function) -> None:
        """Count a class and those that it derives from among what carries the parameter."""
        node = self.definitions.get(kind)
        if isinstance(node, ast.ClassDef) and kind not in self.carrying:
            self.carrying.add(kind)
            for base in node.bases:
                name = base.value if isinstance(base, ast.Subscript) else base
                if isinstance(name, ast.Name) and name.id in self.names[kind[0]]:
                    self._carry(self.names[kind[0]][name.id])

    def _target(self, module: str, owner: str, func: ast.expr) -> Function | None:
        if isinstance(func, ast.Name):
            return self.names[module].get(func.id)
        if isinstance(func, ast.Attribute) and isinstance(func.value, ast.Name):
            if func.value.id in ("self", "cls") and owner:
                kinds = [(module, owner), *sorted(self.carrying)]
                own = ((home, f"{name}.{func.attr}") for home, name in kinds)
                return next((each for each in own if each in self.definitions), None)
            base = self.names[module].get(func.value.id)
            if base is not None and (base[0], f"{base[1]}.{func.attr}") in self.definitions:
                return base[0], f"{base[1]}.{func.attr}"
            whole = self.house.home(func.value.id, func.attr)
            return whole if whole in self.definitions else None  # type: ignore[return-value]
        return None

    def _carries(self, module: str, value: ast.expr, carried: set[str]) -> bool:
        """Whether an expression is the parameter, or a value made from it."""
        if isinstance(value, ast.Name):
            return value.id in carried
        if isinstance(value, ast.Attribute):
            inner = carried | {"self"}
            return value.attr in self.filled and self._carries(module, value.value, inner)
        if isinstance(value, ast.Starred | ast.Await):
            return self._carries(module, value.value, carried)
        if isinstance(value, ast.Tuple | ast.List):
            return any(self._carries(module, item, carried) for item in value.elts)
        if isinstance(value, ast.IfExp):
            return any(self._carries(module, v, carried) for v in (value.body, value.orelse))
        if isinstance(value, ast.Call):
            if isinstance(value.func, ast.IfExp):
                first = ast.Call(value.func.body, value.args, value.keywords)
                return self._carries(module, first, carried)
            target = self._target(module, "", value.func)
            if isinstance(value.func, ast.Attribute) and value.func.attr.startswith(COPIES):
                if self._carries(module, value.func.value, carried):
                    return True
            made = target is not None and (
                isinstance(self.definitions.get(target), ast.ClassDef) or target in self.returning
            )
            copied = isinstance(value.func, ast.Name) and value.func.id == "replace"
            return (made or copied) and any(
                self._carries(module, a, carried)
                for a in (*value.args, *(k.value for k in value.keywords))
            )
        return False


def _bound(target: ast.expr, filled: set[str]) -> Iterator[str]:
    if isinstance(target, ast.Name):
        yield target.id
    elif isinstance(target, ast.Attribute):
        filled.add(target.attr)
    elif isinstance(target, ast.Tuple | ast.List):
        for item in target.elts:
            yield from _bound(item, filled)
