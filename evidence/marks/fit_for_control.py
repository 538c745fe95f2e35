"""How often the verdict "fit for control" is wrong: flights under real conditions, identified
rightly and with what users get wrong, judged from the flight alone for several loops, and compared
with the exact linear models that the verdict has not seen.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from evidence.marks.coverage import at_points
from evidence.seeds import by_name, parser_of
from evidence.tables import DOCS, keep, markdown, parsed
from identification import KinematicARX, Polynomial
from identification import fit_for_control as judge
from identification.judge import structure_bias
from identification.judge.fit_for_control import FitForControl, added
from studies.known_kinematics.conditions import ALL, CONDITIONS, Instruments, RealCondition
from studies.known_kinematics.models import PAIRS, SCHEDULING
from studies.known_kinematics.truth import AXES, Truth
from studies.loops.robust_lateral import FEEDBACK, SIZES
from studies.output import as_json
from studies.setup.flights import TOP
from symheli import FlightRecord, Wind
from symheli.errors import DataWarning, SymheliError
from symheli.flight import SimulatedFlight
from symheli.lpv.tools import Actuation

JUDGED = (0, 2, 4, 8, 12, 16, 20, 26)
"""Of the airspeeds of a truth those that are judged at: 0, 1, 2, 4, 6, 8, 10, 13 m/s."""

DRAWS, HORIZON = 25, 2.0
"""Of each verdict; seconds of its predictions."""


@dataclass(frozen=True)
class Loop:
    """Gains that are asked about, the axis that is their plant, and sizes that count as 1."""

    axis: str
    gains: Mapping[tuple[str, str], float]
    sizes: Mapping[str, float]

    def named(self, inputs: Mapping[str, str]) -> Loop:
        """The same with the inputs of a model in the place of the controls."""
        gains = {(inputs[u], y): gain for (u, y), gain in self.gains.items()}
        return replace(
            self, gains=gains, sizes={inputs.get(name, name): s for name, s in self.sizes.items()}
        )


LOOPS = {
    "lateral": Loop("lateral", FEEDBACK, SIZES),
    "all axes": Loop(
        ALL,
        {
            ("d_lat", "v"): -0.006,
            ("d_lat", "phi"): -0.045,
            ("d_ped", "r"): -0.114,
            ("d_lon", "u"): 0.0043,
            ("d_lon", "theta"): -0.075,
            ("d_col", "w"): -0.0002,
        },
        AXES[ALL].sizes,
    ),
    "all axes, gentle": Loop(
        ALL,
        {**FEEDBACK, ("d_lon", "u"): 0.002, ("d_lon", "theta"): -0.03, ("d_col", "w"): -0.002},
        AXES[ALL].sizes,
    ),
}
"""Their margins around the exact models are .33 to .45, .15 to .17 and .07 to .09, in sizes of
their own.
"""


@dataclass(frozen=True)
class Case:
    """What was flown, what its identification takes it for, and how it changes the structure."""

    about: str
    flown: RealCondition
    believed: RealCondition
    changed: Callable[[KinematicARX], KinematicARX] = replace

    def log(self, record: FlightRecord) -> FlightRecord:
        """What is known of a flight: where servos, a delay or a wind are not believed in, neither
        the plan nor the simulator has them, and commands stand for deflections.
        """
        if self.flown is self.believed:
            return record
        plan = replace(record.meta["plan"], servos=None, delay=0.0, wind=Wind())
        inputs = AXES[ALL].inputs
        if f"{inputs[0]}_command" in record.signals:
            commands = {u: record[f"{u}_command"] for u in inputs}
            record = record.with_signals(dict.fromkeys(inputs, "rad"), **commands)
        return replace(record, meta={**record.meta, "plan": plan})


ALIKE = ("bandwidth", "airspeed")
"""Conditions that are left out: what another one has, with one thing more or less to be found."""

IDEAL, SERVOS = CONDITIONS["ideal"], CONDITIONS["servos"]
NOISY = replace(IDEAL, noise_db=10.0, longest=75.0)
CASES: Mapping[str, Case] = {
    **{name: Case(one.about, one, one) for name, one in CONDITIONS.items() if name not in ALIKE},
    "degree 1": Case(
        "coefficients linear in airspeed, no acceleration",
        IDEAL,
        IDEAL,
        partial(replace, scheduling=SCHEDULING[0], basis=Polynomial(1, 0.0, TOP)),
    ),
    "constant": Case(
        "constant coefficients",
        IDEAL,
        IDEAL,
        partial(replace, scheduling=SCHEDULING[0], basis=Polynomial(0, 0.0, TOP)),
    ),
    "one lag": Case("one lag of every control", IDEAL, IDEAL, partial(replace, nb=1)),
    "10 dB": Case("10 dB of noise, half a flight", NOISY, NOISY),
    "delay untold": Case(
        "commands 40 ms late, taken for deflections",
        CONDITIONS["delay"],
        IDEAL,
    ),
    "20 ms untold": Case(
        "commands 20 ms late, taken for deflections",
        replace(CONDITIONS["delay"], flown=Actuation(delay=0.02)),
        IDEAL,
    ),
    "servos untold": Case(
        "servos, 20 ms, governor; commands taken for deflections of an ideal helicopter",
        SERVOS,
        IDEAL,
    ),
    "no rotor speed": Case(
        "the same; servos and delay known, rotor speed left out",
        SERVOS,
        SERVOS,
        partial(replace, rotor_speed=None),
    ),
    "sensors untold": Case("rates and attitude 40 ms late, not said", CONDITIONS["sensors"], IDEAL),
    "wind untold": Case("steady wind of 5 m/s, not said", CONDITIONS["wind"], IDEAL),
    "turbulence untold": Case(
        "a breeze and light turbulence, not said", CONDITIONS["turbulence"], IDEAL
    ),
}


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """One model and one loop: the verdict, its rows, and what is true.

    `said`, `true`: upper bound of the nu-gap, and the exact one, over the margin, at the worst
    airspeed; `bounds`, `gaps`: both at every airspeed, `margins` too, and what the bound is made
    of, `within` the set and `left` by the structure. `true` is infinite where the estimate's own
    loop is unstable. A structure that the flight does not determine has the verdict "refused" and
    no numbers.
    """

    seed: int
    loop: str
    verdict: str
    rows: dict[str, str]
    said: float = np.nan
    true: float = np.nan
    bounds: tuple[float, ...] = ()
    gaps: tuple[float, ...] = ()
    within: tuple[float, ...] = ()
    left: tuple[float, ...] = ()
    margins: tuple[float, ...] = ()

    @classmethod
    def of(cls, seed: int, loop: str, found: FitForControl) -> Outcome:
        """What was found for one loop, with the truth beside."""
        row = found["nu-gap over margin"]
        truth, gaps, left = row.truth, found.true_gap, found.structure_gap
        assert truth is not None
        assert gaps is not None
        assert left is not None
        return cls(
            seed=seed,
            loop=loop,
            verdict=found.verdict,
            rows={row.name: row.verdict for row in found.criteria if row.decides},
            said=row.value,
            true=truth,
            bounds=tuple(map(float, found.bound)),
            gaps=tuple(map(float, gaps)),
            within=tuple(map(float, np.fmax(found.gap, found.second_gap))),
            left=tuple(map(float, left)),
            margins=tuple(map(float, found.margin)),
        )

    def with_bound(self, bound: np.ndarray) -> Outcome:
        """The same judged by another bound of the nu-gap, the other rows as they are."""
        said = float(np.max(bound / np.array(self.margins)))
        rows = {**self.rows, "nu-gap over margin": "fit" if said <= 1 else "not known"}
        verdict = "fit" if set(rows.values()) == {"fit"} else "not known"
        return replace(self, bounds=tuple(map(float, bound)), said=said, rows=rows, verdict=verdict)

    @property
    def is_fit(self) -> bool:
        """By the exact models: the nu-gap below the margin at every airspeed."""
        return self.true < 1

    @property
    def said_fit(self) -> bool:
        """By the verdict."""
        return self.verdict == "fit"


@cache
def _exact(vehicle: str, name: str, believed: bool) -> Truth:
    """Exact models of a vehicle as it is flown in a case, or as it is believed to be."""
    condition = CASES[name].believed if believed else CASES[name].flown
    return condition.truth(condition.helicopter(vehicle), ALL, "lateral")


def of_seed(name: str, seed: int, truth: str = "xcell60") -> list[Outcome]:
    """Fly, identify, judge for every loop."""
    case = CASES[name]
    flown = case.flown.flights(case.flown.helicopter(truth), seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        try:
            return judged(name, seed, list(map(case.log, flown)), truth)
        except (SymheliError, np.linalg.LinAlgError) as error:
            why = {"refused": f"{type(error).__name__}: {error}"}
            return [Outcome(seed=seed, loop=loop, verdict="refused", rows=why) for loop in LOOPS]


def judged(name: str, seed: int, records: list[FlightRecord], truth: str) -> list[Outcome]:
    """Identify as the case has it, judge for every loop."""
    case, other = CASES[name], PAIRS[truth]
    source = Instruments(SimulatedFlight(case.believed.helicopter(other)))
    kin = case.changed(case.believed.structure(records[0]))
    model = case.believed.identified(kin, records, source)
    inputs = {str(u).removesuffix("_command"): str(u) for u in model.inputs}
    exact, there = _exact(truth, name, False), _exact(other, name, True)
    off = structure_bias(model, records, source, at_points(model, there.models[ALL], JUDGED))
    out = []
    for loop, one in LOOPS.items():
        own = one.named(inputs)
        found = judge(
            model,
            records,
            own.gains,
            scales=own.sizes,
            bias=replace(off, exact=at_points(model, there.models[one.axis], JUDGED)),
            truth=at_points(model, exact.models[one.axis], JUDGED),
            draws=DRAWS,
            horizon=HORIZON,
        )
        out.append(Outcome.of(seed, loop, found))
    return out


HEAD = (
    "flight, and what it is taken for",
    "unfit, called fit",
    "fit, called fit",
    "farthest called fit (seed)",
    "bounds that hold, %",
    "bound over exact, median",
    "refused",
)


def farthest(some: Sequence[Outcome]) -> str:
    """The largest exact nu-gap over the margin that is called fit, and its seed."""
    last = max((o for o in some if o.said_fit), key=lambda o: o.true, default=None)
    return "" if last is None else f"{last.true:.2f} ({last.seed})"


def row(about: str, some: Sequence[Outcome]) -> tuple[str, ...]:
    """Counts of one group."""
    known = [o for o in some if o.verdict != "refused"]
    fit, unfit = ([o for o in known if o.is_fit == which] for which in (True, False))
    bounds, gaps = (np.array([v for o in known for v in getattr(o, k)]) for k in ("bounds", "gaps"))
    called = [f"{sum(o.said_fit for o in group)} of {len(group)}" for group in (unfit, fit)]
    return (
        about,
        *called,
        farthest(known),
        f"{100 * np.mean(bounds >= gaps):.1f}" if len(gaps) else "",
        f"{np.median(bounds / gaps):.2f}" if len(gaps) else "",
        str(len(some) - len(known)),
    )


RIGHT = tuple(name for name in CONDITIONS if name not in (*ALIKE, "25 Hz, untold"))
"""Cases that are identified as they should be."""
CORRELATIONS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Of the gaps by noise and by the structure; see `added`."""


def by_correlation(found: Mapping[str, Sequence[Sequence[Outcome]]]) -> str:
    """What the verdicts would be if the two gaps added with other correlations."""
    known = [
        (name, o)
        for name, of_name in found.items()
        for some in of_name
        for o in some
        if o.verdict != "refused"
    ]
    right = [o for name, o in known if name in RIGHT]
    rows = []
    for correlation in CORRELATIONS:

        def bound(o: Outcome, correlation: float = correlation) -> np.ndarray:
            return added(np.array(o.within), np.array(o.left), correlation)

        fit = [o.with_bound(bound(o)) for _, o in known]
        counts = [[o.said_fit for o in fit if o.is_fit == which] for which in (False, True)]
        holds = np.concatenate([bound(o) >= o.gaps for o in right]) if right else np.zeros(0)
        rows.append(
            [
                f"{correlation:g}",
                *(f"{sum(each)} of {len(each)}" for each in counts),
                f"{100 * holds.mean():.1f}" if len(holds) else "",
            ]
        )
    return markdown(
        ["correlation", *HEAD[1:3], "bounds that hold where identified rightly, %"], rows
    )


def table(truth: str, found: Mapping[str, Sequence[Sequence[Outcome]]]) -> str:
    """A row a case, one a loop, and one of all."""
    flat = {name: [o for some in of_name for o in some] for name, of_name in found.items()}
    every = [o for some in flat.values() for o in some]
    rows = [row(CASES[name].about, some) for name, some in flat.items()]
    rows += [row(f"loop: {loop}", [o for o in every if o.loop == loop]) for loop in LOOPS]
    return markdown(HEAD, [*rows, row("all", every)])


def main() -> None:
    """Count, and keep the table in docs/identified.md."""
    parser = parser_of(__doc__, "0-7")
    parser.add_argument("--truth", default="xcell60", choices=sorted(PAIRS))
    parser.add_argument("--only", nargs="+", choices=CASES, help="default: every case")
    options = parsed(parser, "identified.md", timed=False)
    found = by_name(options, of_seed, options.only or list(CASES))
    text = table(options.truth, found)
    plain = {name: [[vars(o) for o in some] for some in each] for name, each in found.items()}
    print(as_json(plain) if options.json else f"{text}\n\n{by_correlation(found)}")
    if options.write:
        keep(DOCS / "identified.md", f"verdicts {options.truth}", text)


if __name__ == "__main__":
    from evidence.marks import fit_for_control  # under its own name: other processes import it

    fit_for_control.main()
