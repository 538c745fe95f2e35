"""Products and the sums that use them as one operation."""

from __future__ import annotations

from collections.abc import Sequence

from symheli.codegen.program import Builder, ScalarProgram, rewritten

LATENCY = {"add": 3, "sub": 3, "mul": 4, "fma": 4, "div": 13, "sqrt": 20}
"""Latency of an operation in cycles, on current processors; 1 for operations not listed."""


def fused(given: ScalarProgram, varying: Sequence[int]) -> ScalarProgram:
    """The program with a sum or difference of a product as a fused multiply-add, where all users
    of the product are sums: fewer operations, and a shorter way through them.

    Of two products the one that is ready last is fused. A product that does not depend on the
    `varying` inputs stays by itself where the sum does: it is computed once (see
    `ScalarProgram.hoist`).
    """
    depends, ready = given.depends(varying), _ready(given)
    free = _used_in_sums_alone(given)

    def fusable(product: int, total: int) -> bool:
        return free[product] and depends[product] == depends[total]

    def rule(builder: Builder, k: int, arguments: tuple[int, ...]) -> int | None:
        before = given.operations[k]
        if before.name not in ("add", "sub") or before.arguments[0] == before.arguments[1]:
            return None
        products = [i for i, a in enumerate(before.arguments) if fusable(a, k)]
        if not products:
            return None
        chosen = max(products, key=lambda i: ready[before.arguments[i]])
        a, b = builder.operations[arguments[chosen]].arguments
        name = "fma" if before.name == "add" else ("fms", "fnma")[chosen]
        return builder.apply(name, a, b, arguments[1 - chosen])

    return rewritten(given, rule)


def _ready(given: ScalarProgram) -> list[int]:
    """Return when each operation is done if only its arguments delay it, cycles."""
    out: list[int] = []
    for o in given.operations:
        out.append(LATENCY.get(o.name, 1) + max((out[a] for a in o.arguments), default=0))
    return out


def _used_in_sums_alone(given: ScalarProgram) -> list[bool]:
    """Whether each operation is a product that only sums and differences use."""
    out = [o.name == "mul" for o in given.operations]
    for o in given.operations:
        if o.name not in ("add", "sub"):
            for a in o.arguments:
                out[a] = False
    for output in given.outputs:
        for a in output:
            out[a] = False
    return out
