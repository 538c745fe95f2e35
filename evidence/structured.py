"""`python -m evidence.structured --folder DIR`: static output feedback of COMPleib's aircraft and
helicopters, beside the optimum of controllers of every order.

AC15, AC16, HE1, HE4 and HE5 are written here; the matrices of HE6 and HE7 are taken from `--folder`
where they are there, else fetched from a public repository; each file is held against its checksum.

Source: F. Leibfritz, COMPleib (2004), and what it cites.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import scipy.io

import synthesis
from evidence.public_files import PublicFile, fetched
from evidence.tables import DOCS, keep, markdown
from symheli import LinearModel, LPVStateSpace
from symheli.values.arrays import Array
from symheli.values.signal import signals
from synthesis import Plant
from synthesis.structures import TunableController
from synthesis.structures.design import StructuredController

COMPLEIB = "xi1ngang/Hinf-structured-output-Feedback", "76873b794055d828a2b042ff8efed98c4aa1f752"
FILES = {
    name: PublicFile(f"{name.lower()}.mat", *COMPLEIB, f"COMPlib_r1_1/{name.lower()}.mat", sha256)
    for name, sha256 in (
        ("HE6", "5dd4e496f2d7de7a306dd1a2553324a226299501b35f51c2e2e9f8ea968651be"),
        ("HE7", "8f23172cd1c04764137dc9922fb4183e9f72235347cee5686a31f5d2e14e7bc5"),
    )
}
"""Models that are not written here."""

KNOWN = {
    "AC15": (15.1725, "15.2919 (HIFOO), 15.2 (hinfstruct)"),
    "AC16": (14.8781, ""),
    "HE1": (0.153821, ""),
    "HE4": (22.8382, "22.8382 (HIFOO), 22.8 (hinfstruct)"),
    "HE5": (8.8952, ""),
    "HE6": (192.366, ""),
    "HE7": (192.388, ""),
}
"""Levels that a descent of another program reached, an upper bound on the least, and printed ones.
"""
STARTS = 8


def _rows(text: str) -> Array:
    return np.array([[float(v) for v in row.split()] for row in text.split(";")])


LYNX_A = _rows(
    "0 0 0 .99857378 .0533842742 0 0 0;"
    "0 0 1 -.00318221934 .0595246553 0 0 0;"
    "0 0 -11.5704956 -2.54463768 -.0636026263 .106780529 -.0949186683 .00710757449;"
    "0 0 .439356565 -1.9981823 0 .0166518837 .018462047 -.00118747074;"
    "0 0 -2.04089546 -.458999157 -.73502779 .0192557573 -.00459562242 .00212036073;"
    "-32.1036072 0 -.503355026 2.29785919 0 -.0212158114 -.021167919 .0158115923;"
    ".102161169 32.0578308 -2.34721756 -.503611565 .834947586 .02122657 -.0378797352 .00035400386;"
    "-1.9109726 1.71382904 -.00400543213 -.0574111938 0 .0139896348 -.000906753354 -.290513515"
)
LYNX_B = _rows(
    "0 0 0 0; 0 0 0 0;"
    ".124335051 .0827858448 -2.75247765 -.0178887695;"
    "-.0363589227 .475095272 .0142907426 0;"
    ".30449152 .0149580166 -.496518373 -.206741929;"
    ".287735462 -.544506073 -.0163793564 0;"
    "-.0190734863 .0163674355 -.544536114 .2348423;"
    "-4.82063293 -.000381469727 0 0"
)
LYNX_C = _rows(
    "0 0 0 0 0 .0595 .05329 -.9968; 1 0 0 0 0 0 0 0; 0 1 0 0 0 0 0 0;"
    "0 0 0 -.05348 1 0 0 0; 0 0 1 0 0 0 0 0; 0 0 0 1 0 0 0 0"
)
TRANSPORT_A = _rows("-.037 .0123 .00055 -1; 0 0 1 0; -6.37 0 -.23 .0618; 1.25 0 .016 -.0457")
TRANSPORT_B = _rows(".00084 .000236; 0 0; .08 .804; -.0862 -.0665")
VTOL_A = _rows(
    "-.0366 .0271 .0188 -.4555; .0482 -1.01 .0024 -4.0208; .1002 .3681 -.707 1.42; 0 0 1 0"
)
VTOL_B = _rows(".4422 .1761; 3.5446 -7.5922; -5.52 4.49; 0 0")
VTOL_B1 = _rows(".04678 0; .04572 .00988; .04369 .00111; -.02179 0")


def plant(name: str, folder: Path | None = None) -> Plant:
    """The design plant of a model, w1.. to z1.., u = K y from y1.. to u1..; raises `InputError`
    where its file is neither in the folder nor can be fetched.
    """
    eye = np.eye(8)
    if name in ("AC15", "AC16"):
        seen = np.eye(4)[1:] if name == "AC15" else np.eye(4)
        rows = np.eye(6)
        return _plant(TRANSPORT_A, np.eye(4), TRANSPORT_B, rows[:, :4], seen, D12=rows[:, 4:])
    if name == "HE1":
        size = 2**-0.5
        C1 = size * _rows("2 0 0 0; 0 1 0 0")
        return _plant(VTOL_A, VTOL_B1, VTOL_B, C1, _rows("0 1 0 0"), D12=size * np.eye(2))
    if name == "HE4":
        rows = np.eye(12)
        return _plant(LYNX_A, eye, LYNX_B, rows[:, :8], LYNX_C, D12=rows[:, 8:])
    if name == "HE5":
        noise = 0.01 * np.eye(2, 3)
        return _plant(LYNX_A, eye[:, 2:5], LYNX_B, LYNX_C[:4], eye[2:4], D12=np.eye(4), D21=noise)
    m = scipy.io.loadmat(fetched(FILES[name], folder or Path()))
    return _plant(
        m["A"], m["B1"], m["B2"], m["C1"], m["C2"], D12=m["D12"], D11=m["D11"], D21=m["D21"]
    )


def _plant(
    A: Array,
    B1: Array,
    B2: Array,
    C1: Array,
    C2: Array,
    *,
    D12: Array,
    D11: Array | None = None,
    D21: Array | None = None,
) -> Plant:
    sizes = {"x": len(A), "w": B1.shape[1], "u": B2.shape[1], "z": len(C1), "y": len(C2)}
    x, w, u, z, y = (signals(f"{s}{i + 1}" for i in range(n)) for s, n in sizes.items())
    D11 = np.zeros((len(z), len(w))) if D11 is None else D11
    D21 = np.zeros((len(y), len(w))) if D21 is None else D21
    D = np.block([[D11, D12], [D21, np.zeros((len(y), len(u)))]])
    model = LinearModel(A, np.hstack([B1, B2]), np.vstack([C1, C2]), D, x, (*w, *u), (*z, *y))
    return Plant(LPVStateSpace.constant(model), w, z, u, y)


def tuned(name: str, folder: Path | None = None, starts: int = STARTS) -> StructuredController:
    """Static output feedback of a model from so many starts."""
    given = plant(name, folder)
    return synthesis.structured(given, TunableController.pid(given), starts=starts)


def row(name: str, made: StructuredController) -> list[str]:
    """A row of the table."""
    level, printed = KNOWN[name]
    least = "" if made.optimum is None else f"{made.optimum:.6g}"
    measure, radius = made.stationarity
    return [
        name,
        str(len(made.plant.states)),
        str(made.structure.numbers),
        f"{made.promised:.7g}",
        f"{level:.6g}",
        printed,
        least,
        f"{measure:.0e} within {radius:.0e}",
    ]


def main() -> None:
    """Print the table, or keep it in docs/structured.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("compleib"), help="where files are")
    parser.add_argument("--fetch-only", action="store_true", help="fetch and verify them")
    parser.add_argument("--write", action="store_true", help="keep the table in docs/structured.md")
    given = parser.parse_args()
    if given.fetch_only:
        for file in FILES.values():
            print(fetched(file, given.folder), flush=True)
        return
    rows = []
    for name in KNOWN:
        rows.append(row(name, tuned(name, given.folder)))
        print(*rows[-1], flush=True)
    head = ["model", "states", "gains", "found", "known", "printed", "every order", "stationary"]
    text = markdown(head, rows)
    if given.write:
        command = "python -m evidence.structured"
        keep(DOCS / "structured.md", "static output feedback", text, command=command)
    else:
        print(text)


if __name__ == "__main__":
    main()
