"""Bands of frequency responses by the calibrated helicopter beside those by no parameters, from the
same flights with the controller on: which are narrower, and which hold the exact responses.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import symheli
from evidence.marks.calibrated import start_of
from evidence.responses import BAND, INPUTS, ON_AXIS, OUTPUTS, WINDOWS, flights_at
from evidence.seeds import over_seeds, parser_of, seeds_of
from evidence.tables import DOCS, keep, markdown, parsed
from identification import calibrate, frequency_response
from identification.judge.frequency_response import FrequencyResponse
from studies.autopilot.tuned import DEVIATIONS
from studies.known_kinematics.models import PAIRS
from studies.output import as_json
from symheli import Helicopter
from symheli.errors import TrimError
from symheli.values.arrays import Array
from symheli.values.drawing import plain
from symheli.values.whole_files import write_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TRUTH, AIRSPEED = "xcell60", 8.0
DRAWS = 20
"""Helicopters drawn from the calibration."""

OFF_AXIS = ("r", "d_col")
"""Drawn beside the responses that are on-axis."""


@dataclass(frozen=True, kw_only=True)
class Bands:
    """Of one seed: the response by no parameters, the exact one, that of the calibrated helicopter
    and the half width (`DEVIATIONS` standard deviations of those drawn) of its band.
    """

    seed: int
    measured: FrequencyResponse
    exact: Array
    calibrated: Array
    half_width: Array

    @property
    def held(self) -> dict[str, Array]:
        """Which bands hold the exact response, (n, ny, nu)."""
        radius = self.measured.radius()
        centre = self.measured.G
        wider = np.where(self.half_width < radius, radius, self.half_width)
        return {
            "calibrated": np.abs(self.calibrated - self.exact) <= self.half_width,
            "no parameters": np.abs(centre - self.exact) <= radius,
            "calibrated, the wider width": np.abs(self.calibrated - self.exact) <= wider,
        }


def of_seed(seed: int) -> Bands:
    """Fly at one airspeed, estimate both ways; the calibration uses the first of the flights."""
    heli = Helicopter.load(TRUTH, governor="ideal")
    other = Helicopter.load(PAIRS[TRUTH], governor="ideal")
    records = flights_at(heli, AIRSPEED, seed)
    measured = frequency_response(
        records,
        OUTPUTS,
        INPUTS,
        window=WINDOWS,
        band=BAND,
        references=tuple(f"e_{u}" for u in INPUTS),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = calibrate(start_of(heli, other, seed), records[0])

    def response(one: Helicopter) -> Array:
        model = symheli.linearize(one, symheli.trim(one, airspeed=AIRSPEED))
        sampled = model.discretize(records[0].dt).select(inputs=INPUTS, outputs=OUTPUTS)
        return sampled.frequency_response(measured.omega)

    drawn = []
    for one in found.draws(DRAWS, seed):
        try:
            drawn.append(response(one))
        except (
            TrimError
        ):  # as `studies.autopilot.tuned` leaves it out: the one that flew has a trim
            continue
    calibrated = response(found.heli)
    spread = np.sqrt(np.mean(np.abs(np.array(drawn) - calibrated) ** 2, axis=0))
    return Bands(
        seed=seed,
        measured=measured,
        exact=response(heli),
        calibrated=calibrated,
        half_width=DEVIATIONS * spread,
    )


def table(found: Sequence[Bands]) -> str:
    """Shares over all usable responses, on-axis and all."""
    on = np.zeros((len(OUTPUTS), len(INPUTS)), bool)
    for y, u in ON_AXIS:
        on[OUTPUTS.index(y), INPUTS.index(u)] = True
    usable = {"on-axis": [b.measured.usable & on for b in found]}
    usable["all usable"] = [b.measured.usable for b in found]
    rows = []
    for name in found[0].held:
        shares = [
            np.concatenate([b.held[name][use] for b, use in zip(found, some, strict=True)]).mean()
            for some in usable.values()
        ]
        rows.append((name, *(f"{share:.1%}" for share in shares)))
    ratios = [
        np.concatenate(
            [(b.half_width / b.measured.radius())[use] for b, use in zip(found, some, strict=True)]
        )
        for some in usable.values()
    ]
    rows.append(
        ("calibrated band the narrower one", *(f"{np.mean(ratio < 1):.1%}" for ratio in ratios))
    )
    rows.append(("ratio of their widths, median", *(f"{np.median(r):.2g}" for r in ratios)))
    return "\n".join(
        [
            f"Flights of {TRUTH} at {AIRSPEED:g} m/s, seeds {found[0].seed} to {found[-1].seed};"
            f" {', '.join(OUTPUTS)} from {', '.join(INPUTS)}, {BAND[0]:g} to {BAND[1]:g} rad/s;"
            f" bands of {DEVIATIONS:g} standard deviations of {DRAWS} drawn helicopters, and of"
            " 95 % by no parameters.",
            "",
            markdown(("bands that hold the exact response", *usable), rows),
        ]
    )


def figure(bands: Bands) -> Figure:
    """Magnitudes over frequency: both with their bands, and the exact one."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    pairs = (*ON_AXIS, OFF_AXIS)
    drawn, grid = plt.subplots(1, len(pairs), figsize=(3 * len(pairs), 3), sharex=True)
    omega = bands.measured.omega
    for ax, (y, u) in zip(grid, pairs, strict=True):
        at = (slice(None), OUTPUTS.index(y), INPUTS.index(u))
        use = bands.measured.usable[at]
        for G, radius, color, word in (
            (bands.measured.G[at], bands.measured.radius()[at], "0.5", "no parameters"),
            (bands.calibrated[at], bands.half_width[at], "C0", "calibrated"),
        ):
            size = np.abs(G)
            ax.loglog(omega[use], size[use], color=color, label=word)
            low = np.maximum(size - radius, 1e-3 * size)[use]
            ax.fill_between(omega[use], low, (size + radius)[use], color=color, alpha=0.3, lw=0)
        ax.loglog(omega, np.abs(bands.exact[at]), "k--", lw=0.8, label="exact")
        ax.set_title(f"{y} from {u}")
        ax.set_xlabel("rad/s")
        plain(ax)
    grid[0].legend(fontsize=7)
    drawn.tight_layout()
    return drawn


def main() -> None:
    """Print which bands hold the truth, keep it in docs/identified.md, and draw the first seed."""
    parser = parser_of(__doc__, "0-9", quick=1)
    parser.add_argument("--figure", type=Path, help="where the bands of the first seed are drawn")
    options = parsed(parser, "identified.md", timed=False)
    found = list(over_seeds(options, [partial(of_seed, s) for s in seeds_of(options)]))
    text = table(found)
    shares = [{"seed": b.seed, **{k: float(v.mean()) for k, v in b.held.items()}} for b in found]
    print(as_json(shares) if options.json else text)
    if options.figure:
        picture = io.BytesIO()
        figure(found[0]).savefig(picture, format=options.figure.suffix.lstrip("."))
        write_bytes(options.figure, picture.getvalue())
    if options.write:
        keep(DOCS / "identified.md", "two bands", text)


if __name__ == "__main__":
    from evidence import two_bands  # under its own name: its results are handed on and stored by it

    two_bands.main()
