"""How long the operations of a program wait for one another, and how many a point takes: at points
that are given, for both depend on the sides that the selections take there.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from symheli.codegen import ScalarProgram, evaluate
from symheli.codegen.branches import Side, branches

SELECTIONS = ("select", "min", "max")


class Waiting:
    """A program at N points; `inputs[i][j]` (N,) is entry j of input i."""

    def __init__(self, program: ScalarProgram, *inputs: np.ndarray):
        self.program, self.points = program, inputs[0].shape[1]
        self._taken = self._first_taken(inputs)

    def _first_taken(self, inputs: Sequence[np.ndarray]) -> dict[int, np.ndarray]:
        """For each selection whether its first number is taken (N,)."""
        operations = self.program.operations
        chosen = {k: o.arguments for k, o in enumerate(operations) if o.name in SELECTIONS}
        wanted = tuple(a for arguments in chosen.values() for a in arguments)
        asked = ScalarProgram(self.program.name, self.program.sizes, operations, (wanted,))
        values, out = iter(evaluate(asked, *inputs)[0]), {}
        for k, arguments in chosen.items():
            a = [np.broadcast_to(next(values), self.points) for _ in arguments]
            match operations[k].name:
                case "select":
                    out[k] = a[0] != 0
                case "min":
                    out[k] = ~(a[1] < a[0])
                case "max":
                    out[k] = ~(a[0] < a[1])
        return out

    def ready(
        self, wait: Mapping[str, float], inputs: Mapping[int, Sequence[np.ndarray]]
    ) -> list[np.ndarray]:
        """When the entries of the first output are ready at the earliest (N,), s: each operation
        takes `wait` once its arguments are there, a selection is foreseen and takes none. Entry j
        of input i is there at `inputs[i][j]`, an input that is not named from the start.
        """
        wait = dict(wait) | {"sub": wait["add"], "fms": wait["fma"], "fnma": wait["fma"]}
        out: list[np.ndarray] = []
        start = np.zeros(self.points)
        for k, o in enumerate(self.program.operations):
            a = [out[i] for i in o.arguments]
            if o.name == "input":
                given = inputs.get(o.element[0])
                out.append(start if given is None else given[o.element[1]])
            elif o.name in SELECTIONS:
                out.append(np.where(self._taken[k], a[-2], a[-1]))
            else:
                out.append(np.max([start, *a], axis=0) + wait.get(o.name, 0.0))
        return [out[a] for a in self.program.outputs[0]]

    def count(self) -> Counter[str]:
        """Operations of each name that a point takes, on the average, where only the side of a
        selection that is taken is computed.
        """
        homes = branches(self.program)

        def computed(side: Side) -> np.ndarray:
            if side is None:
                return np.ones(self.points, bool)
            position, first = side
            return (self._taken[position] == first) & computed(homes[position])

        out: Counter[str] = Counter()
        for home, o in zip(homes, self.program.operations, strict=True):
            if o.name not in ("input", "constant"):
                out[o.name] += float(computed(home).mean())  # type: ignore[assignment]
        return out
