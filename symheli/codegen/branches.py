"""Operations of a program that only one side of a selection needs."""

from __future__ import annotations

from collections import Counter

from symheli.codegen.program import ScalarProgram

Side = tuple[int, bool] | None
"""A side of a selection: its position, and whether it is the one taken where the condition holds.
None: always computed.
"""

COST = {"sqrt": 10, "div": 10}
"""Cost of an operation relative to a multiplication."""
MIN_BRANCH_COST = 20
"""Cost of a side from which a branch is generated; below it computing both sides is faster than a
mispredicted branch.
"""


def branches(program: ScalarProgram) -> list[Side]:
    """Return for each operation the innermost side of a selection that all its users are on; sides
    that are not worth a branch are left out.
    """
    homes = _homes(program)
    cost: Counter[Side] = Counter()
    for home, operation in zip(homes, program.operations, strict=True):
        cost[home] += 0 if operation.name in ("constant", "input") else COST.get(operation.name, 1)
    outer: dict[Side, Side] = {}
    for side in sorted(
        {home for home in homes if home is not None}
    ):  # inner sides first: they come before what they are inside of
        if cost[side] < MIN_BRANCH_COST:
            outer[side] = homes[side[0]]
            cost[homes[side[0]]] += cost[side]

    def kept(side: Side) -> Side:
        while side in outer:
            side = outer[side]
        return side

    return [kept(home) for home in homes]


def _homes(program: ScalarProgram) -> list[Side]:
    """The innermost side that all users of each operation are on, from the last operation to the
    first.
    """
    count = len(program.operations)
    users: list[list[Side]] = [[] for _ in range(count)]
    homes: list[Side] = [None] * count
    for output in program.outputs:
        for a in output:
            users[a].append(None)
    for k in reversed(range(count)):
        homes[k] = _common(users[k], homes)
        operation = program.operations[k]
        for place, a in enumerate(operation.arguments):
            users[a].append(
                (k, place == 1) if operation.name == "select" and place > 0 else homes[k]
            )
    return homes


def _common(sides: list[Side], homes: list[Side]) -> Side:
    """The innermost side that contains all of these."""
    around = [_around(side, homes) for side in sides]
    return next(side for side in around[0] if all(side in others for others in around[1:]))


def _around(side: Side, homes: list[Side]) -> list[Side]:
    """A side and those it is inside of, outwards, None last."""
    out = [side]
    while side is not None:
        side = homes[side[0]]
        out.append(side)
    return out
