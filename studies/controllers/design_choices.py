"""Specification of a controller: the choices of `symheli synthesize`, whose defaults are those of
the study.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from studies.choices import (
    about,
    beside,
    check,
    checked,
    choice,
    commented,
    entries,
    sentence,
    toml,
)
from studies.setup.axes import ALL
from symheli import Servo
from symheli.errors import InputError
from symheli.flight import XCELL_SERVOS
from symheli.lpv.mixing import ERROR
from symheli.lpv.tools import Actuation
from symheli.values.whole_files import write_text
from synthesis.design.plant.parts import DISTURBANCE

TOP, RATE = 13.0, 3.0
"""Highest airspeed, m/s, and largest acceleration, m/s^2."""

PERIOD, DELAY = 0.02, 0.02
"""Sample period of the controller, and delay from a command to its servo, s."""

CONTROLS = ALL.inputs
GUSTS = ("u_w", "v_w", "w_w")
MEASUREMENTS = ALL.outputs

SIZES = {
    **dict.fromkeys(("u", "v", "w"), 2.0),
    **dict.fromkeys(("p", "q"), 2.0),
    "r": 0.3,
    **dict.fromkeys(("phi", "theta"), 0.2),
    **dict.fromkeys(("d_lon", "d_lat", "d_col"), 0.009),
    "d_ped": 0.03,
}
"""A deviation of this size (m/s, rad/s, rad) counts as 1; of a control that of the command."""

GUST = 2.0
"""A gust of this size (m/s) counts as 1."""

NOISE = {
    **dict.fromkeys(("u", "v", "w"), 0.9),
    **dict.fromkeys(("p", "q", "r"), 0.09),
    **dict.fromkeys(("phi", "theta"), 0.03),
}
"""Noise of a measurement (m/s, rad/s, rad) that counts as 1: three times what is flown, or the
controllers become faster than the servos.
"""

POINTS = 27
DEGREE = 3
SAMPLED_DEGREE = 3
"""Airspeeds linearized; degree in airspeed of the model and of the sampled one."""

BACK_OFF = 1.3
BACK_OFFS = (BACK_OFF, 1.6, 2.0)
"""Levels are so much above the least, tried in turn until no pole of the controller is faster than
half the sample frequency: polynomials in airspeed do not follow those that are.
"""

GAIN = 7.0
"""Largest gain worth a design: a gust of its size moves the helicopter by seven sizes."""

SERVO_RATE = 3.0
"""Rate limit of every servo, rad/s of blade pitch; assumed, the source of the servos gives none."""

LIMITED = Actuation(
    {u: replace(servo, rate=SERVO_RATE) for u, servo in XCELL_SERVOS.items()}, DELAY, PERIOD
)
"""Servos so limited, as controllers are flown."""

TURBULENCE = 3.9
"""Turbulence that is flown, m/s: half of light, in which flights keep to the certificate."""

NOISE_SHARE = 1 / 3
"""Share of the noise that counts as 1: the standard deviation that is flown."""


def _numbers(servo: Servo) -> tuple[float, ...]:
    pair = () if servo.zero is None or servo.pole is None else (servo.zero, servo.pole)
    return (round(servo.natural_frequency, 3), servo.damping, *pair)


@dataclass(frozen=True, kw_only=True)
class DesignChoices:
    """Specification of the design, certification and simulation. Raises `InputError` for a wrong
    type, a value out of range, or a signal without a size.
    """

    vehicle: str = choice(
        "xcell60", 'packaged airframe, or a vehicle file; with a model "": no flight', empty=True
    )
    model: str = field(
        default="",
        metadata=about(
            "design for this model (symheli identify --save, or a family of linear models) instead",
            empty=True,
        ),
    )
    out: Path = field(default=Path("controller"), metadata=about("output folder"))
    airspeeds: tuple[float, ...] = choice((0.0, TOP), "lowest and highest, m/s", least=0)
    acceleration: float = choice(RATE, "largest permitted |dV/dt|, m/s^2", least=0)
    points: int = choice(POINTS, "airspeeds at which the vehicle is linearized", least=4)
    degree: int = choice(DEGREE, "degree of the entry-by-entry interpolation", least=1)
    states: tuple[str, ...] = choice(
        (),
        'states of the model to keep, []: all; lateral axis ["v", "p", "r", "phi", "b1"]',
        empty=True,
    )
    controls: tuple[str, ...] = choice(CONTROLS, "outputs of the controller")
    measurements: tuple[str, ...] = choice(MEASUREMENTS, "inputs of the controller")
    references: tuple[str, ...] = choice(
        (),
        'measurements that follow a command, ["theta"]; its size: theta_reference in sizes',
        empty=True,
    )
    disturbances: tuple[str, ...] = choice(
        GUSTS,
        "gusts, m/s; a control: a disturbance added to it, as large as d_lon_disturbance in sizes",
    )
    period: float = choice(PERIOD, "sample period of the controller, s")
    delay: float = choice(DELAY, "delay from a command to its servo, s: whole samples", least=0)
    back_off: tuple[float, ...] = choice(
        BACK_OFFS, "multiples of the least gain for which the controller is computed, tried in turn"
    )
    gain: float = choice(
        GAIN, "largest gain that is worth a design: refused where no controller keeps it", least=0
    )
    order: int = choice(
        0, "order of the controller; 0: the least for at most 3 % more gain", least=0
    )
    knots: int = choice(
        0, "number of airspeeds of its table; 0: the least for at most 3 % more gain", least=0
    )
    flights: int = choice(
        4, "simulated transitions in turbulence, each with its own gusts", least=1
    )
    turbulence: float = choice(
        TURBULENCE, "turbulence level: mean wind at 20 ft (Dryden), m/s; 7.7 is light", least=0
    )
    sizes: Mapping[str, float] = field(
        default_factory=lambda: {**dict.fromkeys(GUSTS, GUST), **SIZES},
        metadata=about(
            "values scaled to 1 (m/s, rad/s, rad): expected disturbances, deviations, commands"
        ),
    )
    noise: Mapping[str, float] = field(
        default_factory=lambda: dict(NOISE),
        metadata=about("noise of each measurement scaled to 1; the simulation has a third of it"),
    )
    servos: Mapping[str, tuple[float, ...]] = field(
        default_factory=lambda: {u: _numbers(servo) for u, servo in XCELL_SERVOS.items()},
        metadata=about(
            "natural frequency (rad/s), damping; zero and pole (rad/s) if any; left out: none"
        ),
    )

    def __post_init__(self) -> None:
        check(self)
        wrong = []
        if not (self.vehicle or self.model):
            wrong.append("vehicle: expected a name or a file, or a model")
        if len(self.airspeeds) != 2 or not self.airspeeds[0] < self.airspeeds[1]:
            wrong.append(f"airspeeds: expected [LOW, HIGH], got {list(self.airspeeds)}")
        if not self.period > 0:
            wrong.append(f"period: expected seconds > 0, got {self.period:g}")
        samples = self.delay / self.period if self.period > 0 else 0.0
        if abs(samples - round(samples)) > 1e-6:
            wrong.append(f"delay: {self.delay:g} s are no whole samples of {self.period:g} s")
        if min(self.back_off) <= 1:
            wrong.append(f"back_off: expected numbers > 1, got {list(self.back_off)}")
        for y in self.measurements:
            wrong += [] if self.noise.get(y, 0) > 0 else [f"noise: give {y} a number > 0"]
        for name in (*self.disturbances, *self.measurements, *self.controls):
            wrong += [] if self.sizes.get(name, 0) > 0 else [f"sizes: give {name} a number > 0"]
        missing = [y for y in self.references if y not in self.measurements]
        if missing:
            wrong.append(
                f"references: {', '.join(missing)} not among the measurements,"
                f" {', '.join(self.measurements)}"
            )
        for u, numbers in self.servos.items():
            if len(numbers) not in (2, 4):
                wrong.append(f"servos: {u} expected 2 or 4 numbers, got {list(numbers)}")
        if wrong:
            raise InputError("; ".join(wrong))

    @classmethod
    def read(cls, path: Path | None, options: Mapping[str, Any]) -> DesignChoices:
        """Read the file (None: only defaults) with `options` in place of its entries of these
        names; paths of the file are relative to it.

        Raises `InputError` for a file that cannot be read, or with everything that is wrong in it.
        """
        given = {} if path is None else entries(path, "synthesize")
        complaints: list[str] = []
        found = checked(cls, {**given, **options}, complaints)
        if complaints:
            raise InputError(f"{path or 'options'}: {'; '.join(complaints)}")
        try:
            return cls(**found)
        except InputError as error:
            raise InputError(f"{path or 'options'}: {error}") from None

    def write(self, path: Path) -> Path:
        """Write all choices, defaults too."""
        return write_text(path, self.text(path.parent))

    def text(self, folder: Path) -> str:
        """Return the choices as a TOML file in this folder, with a comment on each."""
        return "\n".join(self._lines(folder)) + "\n"

    def _lines(self, folder: Path) -> Iterator[str]:
        yield "# Specification of a controller for symheli synthesize FILE. SI units and radians."
        yield "# Paths are relative to this file; options of the command line take precedence."
        yield ""
        tables = [f.name for f in fields(self) if isinstance(getattr(self, f.name), Mapping)]
        for f in fields(self):
            if f.name in tables:
                continue
            value = beside(self, f.name, folder)
            mark = "# " if f.name == "model" and not value else ""
            entry = f"{mark}{f.name} = {toml(value or 'model.json' if mark else value)}"
            yield from commented(entry, sentence(type(self), f.name))
        for name in tables:
            yield ""
            yield f"[{name}]  # {sentence(type(self), name)}"
            yield from (f"{key} = {toml(value)}" for key, value in getattr(self, name).items())

    # --- what follows from it --------------------------------------------------------------------

    @property
    def sizes_of_performance(self) -> dict[str, float]:
        """Sizes of measurements, then commands, by their names in the plant."""
        names = (*self.measurements, *self.controls)
        return {self.error(name): self.sizes[name] for name in names}

    @property
    def sizes_of_disturbances(self) -> dict[str, float]:
        """Sizes of the disturbances and references by their names in the plant."""
        own = {}
        for name in self.disturbances:
            within = self.disturbance(name)
            own[within] = self.sizes.get(within, self.sizes[name])
        return own | {f"{y}_reference": self.size_of_reference(y) for y in self.references}

    def size_of_reference(self, name: str) -> float:
        """Return the size of the command that a measurement follows."""
        return self.sizes.get(f"{name}_reference", self.sizes[name])

    def error(self, name: str) -> str:
        """Return the name of a measurement in the plant: one that follows a command is an error."""
        return f"{name}{ERROR}" if name in self.references else name

    def disturbance(self, name: str) -> str:
        """Return the name of a disturbance in the plant, a separate one where it is added to a
        control.
        """
        return f"{name}{DISTURBANCE}" if name in self.controls else name

    @property
    def actuation(self) -> Actuation:
        """Servos of the controls that have one, with the rate limit of the simulation, behind the
        delay of a sampled command.
        """
        servos = {
            u: Servo(**dict(zip(_OF_A_SERVO, numbers, strict=False)), rate=SERVO_RATE)
            for u, numbers in self.servos.items()
        }
        return Actuation(servos, self.delay, self.period)


_OF_A_SERVO = ("natural_frequency", "damping", "zero", "pole")
