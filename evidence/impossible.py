"""Twenty designs that cannot be: what `symheli synthesize` says of each, and the time it takes.

python -m evidence.impossible
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

import symheli
from studies.controllers.design_choices import CONTROLS, GUST, GUSTS, NOISE, SIZES, DesignChoices
from studies.controllers.synthesized import synthesized
from symheli.errors import SynthesisError
from symheli.values.signal import signals

LIMIT = 5.0
"""Processor time within which each must be answered, s."""


def sized(factor: float) -> dict[str, float]:
    """Return the usual sizes, those of the commands times a factor."""
    commands = {u: factor * SIZES[u] for u in CONTROLS}
    return {**dict.fromkeys(GUSTS, GUST), **SIZES, **commands}


CASES: dict[str, dict[str, Any]] = {
    "d_lon from q": {"controls": ("d_lon",), "measurements": ("q",)},
    "d_lon from everything": {"controls": ("d_lon",)},
    "d_lon from u, theta": {"controls": ("d_lon",), "measurements": ("u", "theta")},
    "d_lat from phi": {"controls": ("d_lat",), "measurements": ("phi",)},
    "d_lat from p, phi": {"controls": ("d_lat",), "measurements": ("p", "phi")},
    "d_col from w": {"controls": ("d_col",), "measurements": ("w",)},
    "d_ped from r": {"controls": ("d_ped",), "measurements": ("r",)},
    "all from q": {"measurements": ("q",)},
    "all from p, q, r": {"measurements": ("p", "q", "r")},
    "all from w, r": {"measurements": ("w", "r")},
    "noise thirty times": {"noise": {y: 30 * size for y, size in NOISE.items()}},
    "commands a hundredth": {"sizes": sized(0.01)},
    "1.5 s late": {"delay": 1.5},
    "all from r": {"measurements": ("r",)},
    "d_lon, d_col from w, q": {"controls": ("d_lon", "d_col"), "measurements": ("w", "q")},
    "d_lat, d_ped from r": {"controls": ("d_lat", "d_ped"), "measurements": ("r",)},
    "Kahn-Hudson, d_lon from q": {
        "vehicle": "xcell_kahn_hudson",
        "controls": ("d_lon",),
        "measurements": ("q",),
    },
    "Yamaha R-50, d_lat from p": {
        "vehicle": "yamaha_r50",
        "controls": ("d_lat",),
        "measurements": ("p",),
    },
    "two lags, one control": {"controls": ("d_lat",), "measurements": ("v",)},
    "two lags, one measured": {"controls": ("d_lat", "d_lon"), "measurements": ("v",)},
}
"""Choices beside the defaults; without a vehicle the model is `lags`."""


def lags() -> symheli.LinearFamily:
    """u and v over airspeed, each unstable and driven by its own control: nothing couples them."""
    names = signals(("u", "v")), signals(("d_lon", "d_lat", "u_w", "v_w")), signals(("u", "v"))
    B = np.array([[5.0, 0.0, 1.0, 0.0], [0.0, 5.0, 0.0, 1.0]])
    models = [
        symheli.LinearModel(np.diag([0.3 - 0.1 * V, 0.2]), B, np.eye(2), np.zeros((2, 4)), *names)
        for V in (0.0, 1.0, 2.0)
    ]
    return symheli.LinearFamily.from_models([0.0, 1.0, 2.0], models)


def answers() -> Iterator[tuple[str, str, float]]:
    """Yield the name of each case, the refusal ("" for none), and processor time, s."""
    for name, changes in CASES.items():
        begin = time.process_time()
        yield name, refusal(name, changes), time.process_time() - begin


def refusal(name: str, changes: Mapping[str, Any]) -> str:
    """Return what the command says; "" where it goes on to design."""
    given = None
    if name.startswith("two lags"):
        given = lags()
        own = {"vehicle": "", "model": "lags", "airspeeds": (0.0, 2.0), "degree": 1}
        changes = {**own, "disturbances": ("u_w", "v_w"), "sizes": sized(40.0), **changes}
    try:
        synthesized(DesignChoices(**changes), given)
    except SynthesisError as error:
        return "\n".join(error.reasons)
    return ""


def main() -> None:
    """Print the table."""
    slowest = 0.0
    for name, said, seconds in answers():
        slowest = max(slowest, seconds)
        print(f"{name}: {seconds:.1f} s")
        print("\n".join(f"    {line}" for line in (said or "DESIGNED").splitlines()))
    print(f"{len(CASES)} cases; slowest {slowest:.1f} s of processor, limit {LIMIT:g} s")


if __name__ == "__main__":
    main()
