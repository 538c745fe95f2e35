"""What a caller may give instead of a good value: strategies of (kind of change, changed value).

Kinds are the words of docs/checks.md. "another type" is the only kind that Python itself may
answer (see verdict.py).
"""

from __future__ import annotations

import dataclasses
import inspect
import math
import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from hypothesis import strategies as st

from symheli.errors import SymheliError

Change = tuple[str, Any]
ANOTHER = "another type"
NUMBERS: tuple[Change, ...] = (
    ("NaN", math.nan),
    ("infinite", math.inf),
    ("infinite", -math.inf),
    ("zero", 0.0),
    ("huge", 1e300),
    ("huge", -1e300),
    ("tiny", 1e-300),
    ("tiny", 5e-324),
    (ANOTHER, "3"),
    (ANOTHER, "fast"),
    (ANOTHER, None),
    (ANOTHER, 1j),
    (ANOTHER, object()),
    (ANOTHER, (1.0, 2.0)),
    (ANOTHER, np.ones((2, 2))),
    (ANOTHER, ()),
)
FACTORS = {"units": (57.29577951308232, 0.3048, 1e3, 1e-3, 1e6), "sign": (-1.0,)}
COUNTS: tuple[Change, ...] = (
    ("zero", 0),
    ("sign", -1),
    ("huge", 10**12),
    ("huge", -(10**30)),
    ("fraction", 1.5),
    ("NaN", math.nan),
    ("infinite", math.inf),
    (ANOTHER, "3"),
    (ANOTHER, None),
    (ANOTHER, 1j),
    (ANOTHER, object()),
    (ANOTHER, (1, 2)),
)
OBJECTS: tuple[Change, ...] = (
    (ANOTHER, None),
    (ANOTHER, "airspeed"),
    (ANOTHER, 3.0),
    (ANOTHER, object()),
    (ANOTHER, ()),
)
OPTIONAL: tuple[Change, ...] = (
    (ANOTHER, math.nan),
    (ANOTHER, math.inf),
    (ANOTHER, -1.0),
    (ANOTHER, 0),
    (ANOTHER, 1e300),
    (ANOTHER, ()),
    (ANOTHER, "no such"),
    (ANOTHER, object()),
)
"""In the place of a default None: what type belongs there is not known."""
DEPTH = 3
OPAQUE = ("RLSState", "KernelConfiguration", "Helicopter", "LinearModels", "OperatingPoints")
"""Taken as they were made: by a reader that checks (fuzzed by itself), or by `init` of a recursion
whose updates must be quick.
"""


def altered(value: Any, depth: int = 0, annotation: object = "") -> st.SearchStrategy[Change]:
    """Changes of a value, by what it is; of a container or record also one of its parts; of None by
    what else is annotated.
    """
    if value is None:
        known = re.split(r"[^\w.]+", str(annotation))
        many = {"tuple", "list", "Sequence", "Mapping", "dict", "Array"} & set(known)
        one = NUMBERS if "float" in known else COUNTS if "int" in known else OPTIONAL
        return st.sampled_from(OPTIONAL if many else one)
    if isinstance(value, bool | np.bool_):
        return st.just(("flag", not value))
    if isinstance(value, int | np.integer):
        return st.sampled_from(COUNTS) | st.integers(-3, 6).map(lambda n: ("another count", n))
    if isinstance(value, float | np.floating):
        return _numbers(float(value))
    if isinstance(value, str):
        return _texts(value)
    if isinstance(value, np.ndarray):
        return _arrays(value)
    if isinstance(value, Mapping):
        return _mappings(value, depth)
    if isinstance(value, list | tuple) and not hasattr(value, "_fields"):
        return _sequences(value, depth)
    if type(value).__module__.startswith("pandas") and hasattr(value, "iloc"):
        return _frames(value)
    if inspect.isfunction(value) or inspect.ismethod(value):
        return st.sampled_from(
            (("NaN", lambda *_, **__: math.nan), (ANOTHER, None), (ANOTHER, 3.0), (ANOTHER, "f"))
        )
    parts = _parts(value) if depth < DEPTH and type(value).__name__ not in OPAQUE else {}
    if not parts:
        return st.sampled_from(OBJECTS)
    return st.sampled_from(OBJECTS) | _remade(value, parts, depth)


def _numbers(value: float) -> st.SearchStrategy[Change]:
    scaled = [(kind, value * factor) for kind, fs in FACTORS.items() for factor in fs]
    any_number = st.floats(allow_nan=False, allow_infinity=False, width=32)
    return st.sampled_from([*NUMBERS, *scaled]) | any_number.map(lambda x: ("another number", x))


def _texts(value: str) -> st.SearchStrategy[Change]:
    return st.sampled_from(
        (
            ("empty", ""),
            ("unknown name", value + "x"),
            ("unknown name", value[1:]),
            ("unknown name", value.swapcase()),
            ("unknown name", "no such name"),
            ("unknown name", "../" * 3),
            (ANOTHER, None),
            (ANOTHER, 3),
            (ANOTHER, math.nan),
            (ANOTHER, object()),
            (ANOTHER, (value, value)),
        )
    ) | st.text(max_size=8).map(lambda text: ("unknown name", text))


@st.composite
def _arrays(draw: st.DrawFn, value: np.ndarray) -> Change:
    kind = draw(
        st.sampled_from(
            (
                *("NaN", "infinite", "huge", "tiny", "zero", "sign", "constant", "units"),
                *("empty", "shape", "one sample", "order", "complex", "objects", "text", "None"),
            )
        )
    )
    if kind == "shape":
        ways: list[Callable[[np.ndarray], np.ndarray]] = [
            lambda a: a[..., :-1],
            lambda a: a[:-1],
            lambda a: a[None],
            lambda a: a.ravel(),
            lambda a: a.T,
            lambda a: np.concatenate([a, a]),
            lambda a: a[..., None],
            lambda a: a.sum(),
        ]
        way = draw(st.sampled_from(ways))
        return kind, way(np.atleast_1d(value))
    if kind == "empty":
        return kind, value.reshape(-1)[:0].reshape(0, *value.shape[1:])
    if kind == "one sample":
        return kind, np.atleast_1d(value)[:1].copy()
    if kind == "order":
        return kind, np.atleast_1d(value)[::-1].copy()
    if kind == "constant":
        return kind, np.full(value.shape, value.flat[0] if value.size else 0.0)
    if kind == "complex":
        return kind, value + 1j
    if kind == "objects":
        return ANOTHER, np.full(value.shape, None, dtype=object)
    if kind == "text":
        return ANOTHER, value.astype(str)
    if kind == "None":
        return ANOTHER, None
    if kind == "units":
        return kind, value * draw(st.sampled_from(FACTORS["units"]))
    if kind == "sign":
        return kind, -value if value.dtype.kind != "b" else ~value
    made = value.astype(float) if value.dtype.kind in "biuf" else value.copy()
    number = draw(st.sampled_from([x for k, x in NUMBERS if k == kind]))
    if made.size and draw(st.booleans()):
        made.flat[draw(st.integers(0, made.size - 1))] = number
    else:
        made[...] = number
    return kind, made


def _mappings(value: Mapping[Any, Any], depth: int) -> st.SearchStrategy[Change]:
    whole: list[Change] = [("empty", {}), (ANOTHER, None), (ANOTHER, 3.0), (ANOTHER, [1, 2])]
    if not value:
        return st.sampled_from([*whole, (ANOTHER, {"no such": 1.0})])
    plain = type(value).__module__ in ("builtins", "types")

    @st.composite
    def part(draw: st.DrawFn) -> Change:
        key = draw(st.sampled_from(list(value)))
        way = draw(st.sampled_from(("name", "missing", "value", "value", "value")))
        rest = {k: v for k, v in value.items() if k != key}
        if way == "missing":
            return "missing", rest
        if way == "name":
            kind = "unknown name" if isinstance(key, str) else ANOTHER
            return kind, {**rest, f"{key}x": value[key]}
        kind, new = draw(altered(value[key], depth + 1))
        return kind, {**value, key: new}

    changed = st.sampled_from(whole) | part()
    return changed if plain else changed.map(lambda change: (ANOTHER, change[1]))


def _sequences(value: Any, depth: int) -> st.SearchStrategy[Change]:
    as_given = type(value)
    whole: list[Change] = [
        ("empty", as_given()),
        ("repeated", as_given([*value, *value])),
        ("order", as_given(value[::-1])),
        ("shape", as_given(value[:-1])),
        (ANOTHER, as_given([as_given(value)])),
        (ANOTHER, None),
        (ANOTHER, 3.0),
        (ANOTHER, object()),
    ]
    if not value:
        return st.sampled_from([*whole, (ANOTHER, as_given(["no such"]))])

    @st.composite
    def part(draw: st.DrawFn) -> Change:
        i = draw(st.integers(0, len(value) - 1))
        kind, new = draw(altered(value[i], depth + 1))
        return kind, as_given([*value[:i], new, *value[i + 1 :]])

    return st.sampled_from(whole) | part()


@st.composite
def _frames(draw: st.DrawFn, value: Any) -> Change:
    kind = draw(
        st.sampled_from(("empty", "one sample", "order", "missing", "NaN", "text", "twice"))
    )
    column = draw(st.sampled_from(list(value.columns)))
    if kind == "empty":
        return kind, value.iloc[:0]
    if kind == "one sample":
        return kind, value.iloc[:1]
    if kind == "order":
        return kind, value.iloc[::-1]
    if kind == "missing":
        return kind, value.drop(columns=column)
    if kind == "twice":
        return "repeated", value.iloc[np.repeat(np.arange(len(value)), 2)]
    made = value.copy()
    made[column] = math.nan if kind == "NaN" else "fast"
    return (kind if kind == "NaN" else ANOTHER), made


def _parts(value: Any) -> dict[str, Any]:
    """The fields a value is made of again."""
    if hasattr(value, "_fields"):
        return {name: getattr(value, name) for name in value._fields}
    if dataclasses.is_dataclass(value):
        return {
            f.name: getattr(value, f.name)
            for f in dataclasses.fields(value)
            if f.init and not f.name.startswith("_")
        }
    return {}


class Refused(Exception):
    """A changed part was refused where the value is made again; `error` says how."""

    def __init__(self, error: SymheliError):
        super().__init__(str(error))
        self.error = error


@dataclasses.dataclass(frozen=True)
class Remade:
    """A value with one field changed, to be made when the call is: what is refused there is an
    answer, too.
    """

    value: Any
    field: str
    new: Any

    def made(self) -> Any:
        new = self.new.made() if isinstance(self.new, Remade) else self.new
        try:
            if hasattr(self.value, "_fields"):
                return self.value._replace(**{self.field: new})
            return dataclasses.replace(self.value, **{self.field: new})
        except SymheliError as error:
            raise Refused(error) from error


def _remade(value: Any, parts: dict[str, Any], depth: int) -> st.SearchStrategy[Change]:
    @st.composite
    def part(draw: st.DrawFn) -> Change:
        field = draw(st.sampled_from(list(parts)))
        kind, new = draw(altered(parts[field], depth + 1))
        return kind, Remade(value, field, new)

    return part()


def made(value: Any) -> Any:
    """The value with every `Remade` in it made."""
    if isinstance(value, Remade):
        return value.made()
    if type(value) is dict:
        return {key: made(item) for key, item in value.items()}
    if type(value) in (list, tuple):
        return type(value)(made(item) for item in value)
    return value
