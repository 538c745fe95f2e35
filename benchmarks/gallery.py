"""The examples of docs/gallery.md beside open peers: the same problem as a user of cvxpy or
python-control writes it, its number, and the seconds of both.

What the page runs is timed as it stands there, its plants included; a peer is timed on the finished
matrices. What cvxpy is given holds on a grid, nothing is proven there.
"""

from __future__ import annotations

import contextlib
import io
import sys
import time
from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[0] = str(ROOT)  # this folder holds scripts named like the packages they measure
sys.path.insert(1, str(ROOT / "docs" / "site"))

from studies.threads import one_thread  # noqa: E402

one_thread()

import control  # noqa: E402
import executed  # noqa: E402
import numpy as np  # noqa: E402

from benchmarks.opponents import gridded_lmi, gridded_synthesis  # noqa: E402
from benchmarks.race import present, readable, table  # noqa: E402
from benchmarks.timing import arguments  # noqa: E402
from symheli.progress import tracked  # noqa: E402

Page = dict[str, Any]
QUICK = 1
"""Number of examples of a quick run; each needs those before it."""


def lag(page: Page) -> str:
    """Constant X and Y on eleven values."""
    plant = page["made"].plant
    return f"{gridded_synthesis.gain(plant.at, 1.0, 10.0, 0.0, degree=0):.4f}"


def disks(page: Page) -> str:
    """Constant X and Y on three by three values."""
    plant, grid = page["plant"], [*product(np.linspace(0, 9, 3), np.linspace(0, 25, 3))]
    found = gridded_synthesis.gain(
        lambda k: plant.at(*grid[round(k)]), 0.0, len(grid) - 1.0, 0.0, len(grid), degree=0
    )
    return f"{found:.4f}"


def bound(page: Page) -> str:
    """P of degree four in p on 41 values."""
    return f"{gridded_lmi.gain(page['loop'].matrices, 2.0, 7.0, 0.1, degree=4, points=41)[0]:.4f}"


def margins(page: Page) -> str:
    """The symmetric disk of the last loop; python-control has no gap metric."""
    s = page["s"]
    found = control.disk_margins(25 / (s**3 + 10 * s**2 + 10 * s + 10), np.logspace(-2, 2, 2000))
    return f"{found[0]:.2f}"


def mixed(page: Page) -> str:
    """`mixsyn` of python-control, by SLICOT."""
    s, plant, gammas = page["s"], page["plant"].to_control(), []
    for bandwidths in ((0.25, 0.25), (0.25, 25), (25, 0.25)):
        W1 = control.append(*(control.ss((s / 1.5 + w) / (s + 1e-4 * w)) for w in bandwidths))
        gammas.append(control.mixsyn(plant, w1=W1, w2=control.ss([], [], [], np.eye(2)))[2][0])
    return ", ".join(f"{gamma:.4f}" for gamma in gammas)


PEERS: dict[str, tuple[str, Callable[[Page], str]]] = {
    "A lag whose pole moves": ("cvxpy on 11 values", lag),
    "Spinning disks": ("cvxpy on 3 by 3 values", disks),
    "A bound that a trajectory exceeds": ("cvxpy on 41 values, P of degree 4", bound),
    "Stability margins": ("python-control's `disk_margins`, the last of six", margins),
    "Mixed sensitivity": ("python-control's `mixsyn`", mixed),
}
"""By the heading of the page: the peer, and its number from what the page has made."""


def timed(call: Callable[[], Any]) -> tuple[Any, float]:
    """What it returns, and the seconds it took."""
    begin = time.perf_counter()
    return call(), time.perf_counter() - begin


def examples() -> dict[str, str]:
    """The code of each section of the page that has some, by its heading."""
    text = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    parts = {part.split("\n", 1)[0]: part for part in text.split("\n## ")[1:]}
    codes = {
        name: "".join(b.code for b in executed.blocks(part) if b.kind == "python")
        for name, part in parts.items()
    }
    return {name: code for name, code in codes.items() if code}


def main() -> None:
    options = arguments(__doc__, write=True)
    page: Page = {"__name__": "page"}
    rows = []
    every = [*examples().items()][: QUICK if options.quick else None]
    for name, code in tracked("examples", every):
        with contextlib.redirect_stdout(io.StringIO()):
            _, own = timed(partial(exec, compile(code, name, "exec"), page))
        peer, number, spent = "none in Python", "", ""
        if name in PEERS:
            peer, call = PEERS[name]
            number, seconds = timed(partial(call, page))
            spent = readable(seconds)
        rows.append((name, readable(own), peer, number, spent))
    head = ("example", "here", "peer", "its number", "its time")
    present("gallery", options, [table("### Times", rows, head)], [], [])


if __name__ == "__main__":
    main()
