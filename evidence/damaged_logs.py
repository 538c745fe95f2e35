"""`python -m evidence.damaged_logs`: what `symheli identify` makes of 200 damaged versions of five
logs, 40 of each.

A run ends in a traceback, in one sentence, or in a model. A model is wrong where more than a tenth
of its coefficients lie outside their 95 % bands around those of the undamaged log, or a frozen
model is further from it than a nu-gap of .15. It is silent where nothing is said beyond what is
said of the undamaged log.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path

import numpy as np

import symheli
from evidence.tables import DOCS, keep, markdown
from identification.model import LPVARXModel
from studies import cli
from studies.log.accuracy import OPEN
from symheli.lpv import nu_gap

FAR, OUTSIDE = OPEN, 0.1
"""nu-gap, and share of the coefficients outside their bands, beyond which a model is wrong."""

Rows = list[list[str]]
Damage = Callable[[Rows, np.random.Generator], tuple[Rows, str]]
"""A function from rows (the header first) to damaged ones and the separator of their cells."""

Change = Callable[[np.ndarray, int], np.ndarray]
"""A function from stamps (n,), ms, and a row to damaged stamps."""


@dataclass(frozen=True)
class Log:
    """Rows as text, the header first, and the options that identify a model; `rate` and `angle` are
    columns that kinematics ties.
    """

    name: str
    rows: Rows
    options: tuple[str, ...]
    rate: str
    angle: str
    where: str = "simulated"


@dataclass
class Outcome:
    """The end of a run: "traceback", "refused", "wrong", "warned" or "sound", and the words."""

    kind: str
    words: str = ""
    notes: set[str] = field(default_factory=set)
    open_to: float = 0.0
    model: LPVARXModel | None = None


def simulated(
    vehicle: str, top: float, outputs: str, inputs: str, seed: int, *, rate: str, angle: str
) -> Log:
    """A transition to `top` (m/s) and back with an excitation of the inputs."""
    heli = symheli.Helicopter.load(vehicle, governor="ideal")
    flight = symheli.fly(
        heli,
        symheli.AirspeedSchedule.transition(0.0, top, acceleration=1.5, laps=2),
        excitation=symheli.Excitation(dict.fromkeys(inputs.split(","), 0.012), seed=seed),
        noise_db=40,
        seed=seed,
    )
    names = [*outputs.split(","), *inputs.split(","), "airspeed_command"]
    table = np.column_stack([1e3 * flight.time, flight.columns(names)])
    cells = [[f"{row[0]:.0f}", *(f"{v:.7g}" for v in row[1:])] for row in table]
    options = (
        *("--outputs", outputs, "--inputs", inputs, "--scheduling", "airspeed_command"),
        *("--na", "2", "--nb", "2", "--degree", "1", "--time-unit", "ms"),
    )
    return Log(f"{vehicle}, {outputs}", [["t", *names], *cells], options, rate, angle)


def pitch_with_lost_rows(seed: int = 7, lost: int = 60, seconds: float = 120.0) -> Log:
    """Pitch of a linear model with coefficients that move with airspeed, `lost` rows missing."""
    rng, dt = np.random.default_rng(seed), 0.005
    f = np.array([0.1, 0.2, 0.35, 0.5, 0.8, 1.2, 1.7, 2.3, 3.1])
    phase, x, rows = rng.uniform(0, 2 * np.pi, len(f)), np.zeros(3), []
    for k in range(int(seconds / dt)):
        t = k * dt
        V = 5 + 5 * np.sin(2 * np.pi * t / 30 - np.pi / 2)
        if k % 4 == 0:
            q, theta = x[:2] + rng.normal(0, [0.006, 0.002])
            lon = -0.12 * theta - 0.03 * q + 0.004 * np.sum(np.sin(2 * np.pi * f * t + phase))
            rows.append([f"{1e3 * t + 12345:.0f}", *(f"{v:.6g}" for v in (q, theta, lon, V))])
        q, theta, a = x
        Mq, Ma = -0.5 - 0.03 * V, 120.0 + 1.5 * V
        x = x + dt * np.array([Mq * q + Ma * a, q, (lon - a) / 0.055 - q])
    kept = np.sort(rng.choice(len(rows), len(rows) - lost, replace=False))
    options = (
        *("--outputs", "q,theta", "--inputs", "d_lon", "--scheduling", "airspeed_command"),
        *("--na", "2", "--nb", "2", "--degree", "1", "--time-unit", "ms"),
    )
    head = ["t", "q", "theta", "d_lon", "airspeed_command"]
    return Log("60 rows lost", [head, *(rows[k] for k in kept)], options, "q", "theta")


def trex(stop: int = 6000) -> Log:
    """The real flight of tests/data, with a clock of 8.4 ms."""
    path = DOCS.parent / "tests" / "data" / "trex550" / "flight.csv"
    head, *rows = (line.split(",") for line in path.read_text("utf-8").splitlines())
    cells = [[f"{8.4 * k:.1f}", *row] for k, row in enumerate(rows[:stop])]
    options = (
        *("--outputs", "q_radps,theta_rad", "--inputs", "lon", "--degree", "0", "--decimate", "3"),
        *("--units", "q_radps=rad/s", "theta_rad=rad", "lon=1", "--time-unit", "ms"),
    )
    return Log("T-REX 550", [["t", *head], *cells], options, "q_radps", "theta_rad", "real")


@cache
def logs() -> tuple[Log, ...]:
    """The five logs."""
    return (
        simulated("xcell60", 8.0, "q,theta", "d_lon", 1, rate="q", angle="theta"),
        simulated("xcell_kahn_hudson", 8.0, "p,phi,r", "d_lat,d_ped", 2, rate="p", angle="phi"),
        simulated("yamaha_r50", 6.0, "u,w,q,theta", "d_lon,d_col", 3, rate="q", angle="theta"),
        pitch_with_lost_rows(),
        trex(),
    )


# --- damages --------------------------------------------------------------------------------------


def _kept(rows: Rows, rng: np.random.Generator, share: float) -> tuple[Rows, str]:
    body = rows[1:]
    lost = set(rng.choice(len(body), max(round(share * len(body)), 1), replace=False).tolist())
    return [rows[0], *(row for k, row in enumerate(body) if k not in lost)], ","


def _without_burst(rows: Rows, rng: np.random.Generator) -> tuple[Rows, str]:
    k = int(rng.integers(len(rows) // 4, len(rows) // 2))
    return [*rows[:k], *rows[k + 150 :]], ","


def _doubled(rows: Rows, rng: np.random.Generator, share: float, block: int) -> tuple[Rows, str]:
    out = list(rows)
    for k in sorted(rng.integers(1, len(rows) - block, max(int(share * len(rows)), 1)))[::-1]:
        out[k + block : k + block] = rows[k : k + block]
    return out, ","


def _shuffled(rows: Rows, rng: np.random.Generator, places: int, block: int) -> tuple[Rows, str]:
    out = list(rows)
    for k in rng.integers(1, len(rows) - block, places):
        order = rng.permutation(block)
        out[k : k + block] = [out[k + i] for i in order]
    return out, ","


def _late(rows: Rows, rng: np.random.Generator, places: int, by: int) -> tuple[Rows, str]:
    out = list(rows)
    for k in rng.integers(1, len(rows) - by - 1, places):
        out.insert(int(k) + by, out.pop(int(k)))
    return out, ","


def _cells(rows: Rows, rng: np.random.Generator, word: str, share: float) -> tuple[Rows, str]:
    out = [list(row) for row in rows]
    for k in rng.integers(1, len(rows), max(int(share * len(rows)), 1)):
        out[k][int(rng.integers(1, len(rows[0])))] = word
    return out, ","


def _without_times(rows: Rows, rng: np.random.Generator) -> tuple[Rows, str]:
    out = [list(row) for row in rows]
    for k in rng.integers(1, len(rows), 20):
        out[k][0] = ""
    return out, ","


def _line_of_words(rows: Rows, rng: np.random.Generator) -> tuple[Rows, str]:
    k = int(rng.integers(1, len(rows)))
    return [*rows[:k], ["logger restarted"], *rows[k:]], ","


def _second_header(rows: Rows, rng: np.random.Generator) -> tuple[Rows, str]:
    return [*rows[: len(rows) // 2], rows[0], *rows[len(rows) // 2 :]], ","


def _clock(rows: Rows, rng: np.random.Generator, change: Change) -> tuple[Rows, str]:
    time = np.array([float(row[0]) for row in rows[1:]])
    k = int(rng.integers(len(time) // 4, len(time) // 2))
    stamps = [f"{t:.3f}" for t in change(time, k)]
    return [rows[0], *([t, *row[1:]] for t, row in zip(stamps, rows[1:], strict=True))], ","


def _from(ms: float) -> Change:
    return lambda t, k: t + ms * (np.arange(len(t)) >= k)


def _reset(t: np.ndarray, k: int) -> np.ndarray:
    return np.where(np.arange(len(t)) < k, t, t - t[k])


def _stray(t: np.ndarray, k: int) -> np.ndarray:
    return np.where(np.arange(len(t)) == k, t + 1e6, t)


def _coarse(t: np.ndarray, _: int) -> np.ndarray:
    return 10.0 * np.round(t / 10.0)


def _jittered(rows: Rows, rng: np.random.Generator, share: float) -> tuple[Rows, str]:
    def change(t: np.ndarray, _: int) -> np.ndarray:
        return t + share * np.median(np.diff(t)) * rng.uniform(-0.5, 0.5, len(t))

    return _clock(rows, rng, change)


def _scaled(rows: Rows, _: np.random.Generator, column: str, factor: float) -> tuple[Rows, str]:
    i = rows[0].index(column)
    return [
        rows[0],
        *([*r[:i], f"{factor * float(r[i]):.7g}", *r[i + 1 :]] for r in rows[1:]),
    ], ","


def _separated(rows: Rows, _: np.random.Generator, by: str) -> tuple[Rows, str]:
    if by == ";":
        return [[cell.replace(".", ",") for cell in row] for row in rows], by
    return rows, by


def damages(log: Log) -> list[tuple[str, str, Damage]]:
    """40 of them: kind, what it is, and the damage."""
    degrees = float(np.degrees(1.0))
    made: dict[str, list[tuple[str, Damage]]] = {
        "rows dropped": [
            *((f"{share:.1%}", partial(_kept, share=share)) for share in (0.0005, 0.01, 0.05)),
            ("150 in a row", _without_burst),
        ],
        "rows doubled": [
            ("one", partial(_doubled, share=0.0, block=1)),
            ("1 %", partial(_doubled, share=0.01, block=1)),
            ("10 %", partial(_doubled, share=0.1, block=1)),
            ("20 in a row", partial(_doubled, share=0.0, block=20)),
        ],
        "rows reordered": [
            (f"{n} times {b}", partial(_shuffled, places=n, block=b))
            for n, b in ((1, 2), (10, 3), (20, 5), (5, 12))
        ],
        "rows late": [
            (f"{n} by {b}", partial(_late, places=n, by=b))
            for n, b in ((1, 3), (20, 2), (20, 8), (5, 30))
        ],
        "NaN": [
            ("1 % empty", partial(_cells, word="", share=0.01)),
            ("5 % NaN", partial(_cells, word="NaN", share=0.05)),
            ("20 % nan", partial(_cells, word="nan", share=0.2)),
            ("20 times", _without_times),
        ],
        "text": [
            ("one cell", partial(_cells, word="ERR", share=0.0)),
            ("1 % of the rows", partial(_cells, word="#VALUE!", share=0.01)),
            ("a line", _line_of_words),
            ("a second header", _second_header),
        ],
        "clock": [
            ("5 s on", partial(_clock, change=_from(5e3))),
            ("0.3 s back", partial(_clock, change=_from(-3e2))),
            ("begins again", partial(_clock, change=_reset)),
            ("one stamp astray", partial(_clock, change=_stray)),
        ],
        "steps uneven": [
            ("5 %", partial(_jittered, share=0.05)),
            ("40 %", partial(_jittered, share=0.4)),
            ("stamps to 10 ms", partial(_clock, change=_coarse)),
            ("5 s back", partial(_clock, change=_from(-5e3))),
        ],
        "unit": [
            ("rate in deg/s", partial(_scaled, column=log.rate, factor=degrees)),
            ("angle in deg", partial(_scaled, column=log.angle, factor=degrees)),
            ("rate divided by 57.3", partial(_scaled, column=log.rate, factor=1 / degrees)),
            ("time in us", partial(_scaled, column="t", factor=1e3)),
        ],
        "separator": [
            (name, partial(_separated, by=by))
            for name, by in (("semicolon", ";"), ("tab", "\t"), ("bar", "|"), ("blanks", " "))
        ],
    }
    return [(kind, what, damage) for kind, cases in made.items() for what, damage in cases]


# --- judging --------------------------------------------------------------------------------------


def run(log: Log, rows: Rows, separator: str, folder: Path) -> Outcome:
    """Identify a model from these rows and return the outcome."""
    file, saved = folder / "log.csv", folder / "model.json"
    saved.unlink(missing_ok=True)
    file.write_text("\n".join(separator.join(row) for row in rows) + "\n", "utf-8")
    words = ["identify", str(file), *log.options, "--offset-rate", "no"]
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("default")
                status = cli.main([*words, "--save", str(saved), "--json"])
        except Exception:
            return Outcome("traceback", traceback.format_exc())
    said = error.getvalue().replace(str(file), "LOG")
    if status:
        return Outcome("refused", said.strip().splitlines()[-1])
    data = json.loads(out.getvalue())
    notes = {line for line in said.splitlines() if "note:" in line}
    notes |= set(data["read"]["units_contradict"]) | {f"diverges: {y}" for y in data["diverges"]}
    rows_of_kinematics = data["kinematics"] or ()
    notes |= {
        f"{r['signal']}: {r['verdict']}" for r in rows_of_kinematics if r["verdict"][0] == "i"
    }
    left_open = (data["open_to"] or {"gap": 0.0})["gap"]
    return Outcome("sound", "", notes, left_open, LPVARXModel.load(saved))


def distance(model: LPVARXModel, whole: LPVARXModel, log: Log) -> tuple[float, float]:
    """Share of the coefficients outside their 95 % bands (NaN: of another structure), and the
    largest nu-gap at the ends and in the middle of the range.
    """
    outside = np.nan
    if model.theta.shape == whole.theta.shape and model.structure.delay == whole.structure.delay:
        error = np.sqrt(sum(np.einsum("iaia->ia", m.covariance) for m in (model, whole)))  # type: ignore[arg-type]
        same = model.structure.basis.ranges == whole.structure.basis.ranges
        if same:
            outside = float(np.mean(np.abs(model.theta - whole.theta).T > 1.96 * error))
    low, high = whole.structure.basis.ranges[0]
    own_low, own_high = model.structure.basis.ranges[0]
    gaps = []
    for share in (0.1, 0.5, 0.9):
        p = low + share * (high - low)
        q = float(np.clip(p, own_low, own_high))
        first, second = whole.at(p), model.at(q)
        if abs(first.dt / second.dt - 1) > 1e-3:  # type: ignore[operator]
            return outside, 1.0
        gaps.append(nu_gap(first, replace(second, dt=first.dt), points=200, **_sizes(whole, log)))
    return outside, max(gaps)


def _sizes(model: LPVARXModel, log: Log) -> dict[str, np.ndarray]:
    """The standard deviations of the signals of the undamaged log, all in SI."""
    table = dict(zip(log.rows[0], np.array(log.rows[1:], float).T, strict=True))
    return {
        "input_scale": np.array([table[str(u)].std() for u in model.inputs]),
        "output_scale": np.array([table[str(y)].std() for y in model.outputs]),
    }


def judged(log: Log, kind: str, damage: Damage, seed: int, whole: Outcome, folder: Path) -> Outcome:
    """The outcome of a damaged version beside that of the whole log."""
    rows, separator = damage(log.rows, np.random.default_rng(seed))
    found = run(log, rows, separator, folder)
    if found.model is None or whole.model is None:
        return found
    outside, gap = distance(found.model, whole.model, log)
    wrong = gap > FAR or outside > OUTSIDE
    said = found.notes - whole.notes
    unsure = wrong and found.open_to > OPEN
    found.kind = "warned" if said or unsure else "wrong" if wrong else "sound"
    found.words = f"gap {gap:.2g}, outside {outside:.2g}; {'; '.join(sorted(said))}"
    return found


def all_of(
    kinds: Collection[str] = (), every: int = 1, *, seed: int = 0, tell: bool = False
) -> list[tuple[str, str, str, Outcome]]:
    """Return (log, kind, what, outcome) of each damaged version, of some kinds only where these are
    given, or of every so many.
    """
    out = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for i, log in enumerate(logs()):
            whole = run(log, log.rows, ",", folder)
            if whole.model is None:
                raise RuntimeError(f"{log.name}: the undamaged log ends in {whole.words}")
            for k, (kind, what, damage) in enumerate(damages(log)):
                if k % every == i % every and (not kinds or kind in kinds):
                    found = judged(log, kind, damage, seed + 40 * i + k, whole, folder)
                    out.append((log.name, kind, what, found))
                    if tell:
                        print(log.name, kind, what, found.kind, found.words[:400], flush=True)
    return out


HEAD = ("damage", "runs", "tracebacks", "silent wrong", "warned", "refused", "sound, not warned")
COMMAND = "python -m evidence.damaged_logs"
KINDS = ("traceback", "wrong", "warned", "refused", "sound")


def table(found: Sequence[tuple[str, str, str, Outcome]]) -> str:
    """The table in Markdown, one row a kind of damage."""
    rows = []
    for kind in dict.fromkeys(one[1] for one in found):
        counted = Counter(outcome.kind for _, k, _, outcome in found if k == kind)
        rows.append([kind, str(counted.total()), *(str(counted[k]) for k in KINDS)])
    total = Counter(outcome.kind for *_, outcome in found)
    rows.append(["all", str(total.total()), *(str(total[k]) for k in KINDS)])
    return markdown(HEAD, rows)


def main() -> None:
    """Print the table, or keep it in docs/identify.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="keep the table in docs/identify.md")
    parser.add_argument("--tell", action="store_true", help="print each run")
    parser.add_argument("--seed", type=int, default=0, help="of the damages")
    given = parser.parse_args()
    found = all_of(seed=given.seed, tell=given.tell)
    if given.write:
        keep(
            DOCS / "identify.md",
            "damaged logs",
            table(found),
            command="python -m evidence.damaged_logs",
        )
    print(table(found))
    if bad := [one[:3] for one in found if one[3].kind in ("traceback", "wrong")]:
        sys.exit(f"not as expected: {bad}")


if __name__ == "__main__":
    main()
