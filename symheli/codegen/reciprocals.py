"""Quotients by the same divisor as products by its reciprocal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from symheli.codegen.program import Builder, ScalarProgram, rewritten


def reciprocals(given: ScalarProgram, varying: Sequence[int]) -> ScalarProgram:
    """Return the program with divisors that are constant, used more than once, or independent of
    the `varying` inputs inverted once.
    """
    uses, depends = (
        Counter(o.arguments[1] for o in given.operations if o.name == "div"),
        given.depends(varying),
    )

    def rule(builder: Builder, k: int, arguments: tuple[int, ...]) -> int | None:
        before = given.operations[k]
        if before.name != "div":
            return None
        divisor = given.operations[before.arguments[1]]
        if divisor.name == "constant" and divisor.value != 0.0:
            return builder.apply("mul", arguments[0], builder.constant(1.0 / divisor.value))
        if uses[before.arguments[1]] > 1 or not depends[before.arguments[1]]:
            return builder.apply(
                "mul",
                arguments[0],
                builder.apply("div", builder.constant(1.0), arguments[1]),
            )
        return None

    return rewritten(given, rule)
