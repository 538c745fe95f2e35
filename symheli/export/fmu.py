"""Models as FMUs of FMI 3.0 for co-simulation: description, C sources, and the library of this
platform where a C compiler is there.
"""

from __future__ import annotations

import hashlib
import io
import os
import platform
import re
import subprocess
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from xml.sax.saxutils import quoteattr

import numpy as np

from symheli.errors import InputError, SymheliError
from symheli.export.c_program import filled
from symheli.export.c_text import define, literals, require_identifier, table
from symheli.values.signal import Signal, signals
from symheli.values.whole_files import write_bytes

HERE = Path(__file__).parent
"""fmi3_interface.h lies here."""

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")
PLATFORMS = {
    ("Linux", "x86_64"): ("x86_64-linux", "so"),
    ("Linux", "aarch64"): ("aarch64-linux", "so"),
    ("Darwin", "x86_64"): ("x86_64-darwin", "dylib"),
    ("Darwin", "arm64"): ("aarch64-darwin", "dylib"),
}
"""Folder and suffix of a library, by system and processor, as FMI 3.0 names them."""

NOT_XML = "[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"
"""A character that no XML document may have."""

Kind = Literal["output", "input", "state", "whole"]


@dataclass(frozen=True)
class Variable:
    """A variable of an FMU: a signal; an input, an output, an output that may be given a start
    value, or a whole number.
    """

    signal: Signal
    kind: Kind
    start: float = 0.0
    about: str = ""
    steps: bool = False
    """Whether it changes at samples only."""


@dataclass(frozen=True)
class Fmu:
    """An FMU: a model of `variables`, time before them, in C.

    `source` is the model around the interface, with a marked place for its variables; `parts` are
    the files that it includes or calls, by name. Raises `InputError` for a name that is no C
    identifier, two variables of one name, and a name that cannot be printed or has " or \\ in it.
    """

    name: str
    about: str
    variables: Sequence[Variable]
    source: Path
    parts: Mapping[str, str]
    constants: Mapping[str, float]
    step: float

    def __post_init__(self) -> None:
        require_identifier(self.name)
        for name in signals(["time", *(v.signal for v in self.variables)]):
            if not name.isprintable() or set(name) & set('"\\'):
                raise InputError(f"signal {name!r}: an FMU needs a name without such characters")
        if any(v.kind == "whole" for v in self.variables[: len(self._reals)]):
            raise ValueError("whole numbers come last: their references follow those of the others")

    @property
    def files(self) -> dict[str, str]:
        """Texts of the archive by their paths."""
        code = {
            **self.parts,
            "fmi3_interface.h": (HERE / "fmi3_interface.h").read_text(encoding="utf-8"),
            "fmu.c": filled(self.source, {"variables": self._tables}),
        }
        return {
            "modelDescription.xml": self._description,
            "sources/buildDescription.xml": self._build,
            **{f"sources/{name}": text for name, text in code.items()},
        }

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write the archive, its library in it where a C compiler is found; raises `InputError`
        unless the path ends in .fmu, `SymheliError` where it cannot be written or compiled.
        """
        path = Path(path)
        if path.suffix != ".fmu":
            raise InputError(f"{path}: expected a name that ends in .fmu")
        contents = {name: text.encode() for name, text in self.files.items()} | self._library()
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in contents.items():
                archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
        return write_bytes(path, packed.getvalue())

    @property
    def _reals(self) -> list[Variable]:
        return [v for v in self.variables if v.kind != "whole"]

    @property
    def _token(self) -> str:
        """Another for every other model."""
        said = [repr((self.name, self.about, self.constants)), *map(repr, self.variables)]
        own = [self.source.read_text(encoding="utf-8"), *self.parts.values()]
        return f"{{{hashlib.sha256(chr(0).join(said + own).encode()).hexdigest()[:32]}}}"

    @property
    def _compiled(self) -> list[str]:
        """Files that a compiler is given: those that no other includes."""
        text = self.source.read_text(encoding="utf-8")
        return ["fmu.c", *(n for n in self.parts if n.endswith(".c") and f'"{n}"' not in text)]

    @property
    def _tables(self) -> str:
        kinds = {"output": "GIVEN", "input": "INPUT", "state": "STARTED"}
        starts = literals([0.0, *(v.start for v in self._reals)], np.float64)
        return "\n".join(
            [
                define("N_REAL", len(self._reals) + 1),
                define("N_WHOLE", len(self.variables) - len(self._reals)),
                define("TOKEN", f'"{self._token}"'),
                "enum { GIVEN, INPUT, STARTED };",
                table("char *const", "names", [f'"{n}"' for n in ("time", *self._names)]),
                table("int", "kinds", ["GIVEN", *(kinds[v.kind] for v in self._reals)]),
                table("double", "starts", starts),
                *(
                    f"static const double {name} = {literals([value], np.float64)[0]};"
                    for name, value in self.constants.items()
                ),
            ]
        )

    @property
    def _names(self) -> list[str]:
        return [str(v.signal) for v in self._reals]

    @property
    def _description(self) -> str:
        units = sorted({v.signal.unit for v in self.variables} - {"1"})
        about = re.sub(NOT_XML, "?", self.about)
        lines = [
            '<?xml version="1.0" encoding="UTF-8"?>',
            f'<fmiModelDescription fmiVersion="3.0" modelName={quoteattr(self.name)}'
            f" instantiationToken={quoteattr(self._token)} description={quoteattr(about)}"
            ' generationTool="symheli" variableNamingConvention="flat">',
            f"  <CoSimulation modelIdentifier={quoteattr(self.name)}"
            ' canHandleVariableCommunicationStepSize="true" canGetAndSetFMUState="true"/>',
        ]
        if units:
            named = "".join(f"<Unit name={quoteattr(u)}/>" for u in units)
            lines.append(f"  <UnitDefinitions>{named}</UnitDefinitions>")
        lines += [
            '  <LogCategories><Category name="logStatusError"/></LogCategories>',
            f'  <DefaultExperiment startTime="0" stopTime="10" stepSize="{self.step!r}"/>',
            "  <ModelVariables>",
            '    <Float64 name="time" valueReference="0" causality="independent"'
            ' variability="continuous"/>',
            *(f"    {_element(i, v)}" for i, v in enumerate(self.variables, 1)),
            "  </ModelVariables>",
            "  <ModelStructure>",
        ]
        numbered = list(enumerate(self.variables, 1))
        given = [i for i, v in numbered if v.kind != "input"]
        unknown = [i for i, v in numbered if v.kind in ("output", "whole")]
        lines += [f'    <Output valueReference="{i}"/>' for i in given]
        lines += [f'    <InitialUnknown valueReference="{i}"/>' for i in unknown]
        return "\n".join([*lines, "  </ModelStructure>", "</fmiModelDescription>", ""])

    @property
    def _build(self) -> str:
        named = "".join(f"<SourceFile name={quoteattr(name)}/>" for name in self._compiled)
        return (
            '<?xml version="1.0" encoding="UTF-8"?>\n<fmiBuildDescription fmiVersion="3.0">\n'
            f"  <BuildConfiguration modelIdentifier={quoteattr(self.name)}>\n"
            f'    <SourceFileSet language="C99" compilerOptions="-ffp-contract=off">{named}'
            "</SourceFileSet>\n"
            '    <Library name="m"/>\n  </BuildConfiguration>\n</fmiBuildDescription>\n'
        )

    def _library(self) -> dict[str, bytes]:
        """The library of this platform by its path; nothing without a compiler."""
        from symheli.codegen.compile import compiler

        known = PLATFORMS.get((platform.system(), platform.machine()))
        cc = compiler()
        if cc is None or known is None:
            return {}
        folder, suffix = known
        with tempfile.TemporaryDirectory(prefix="symheli-") as scratch:
            for name, text in self.files.items():
                if name.startswith("sources/"):
                    (Path(scratch) / Path(name).name).write_text(text, encoding="utf-8")
            built = Path(scratch) / f"{self.name}.{suffix}"
            command = [cc, *FLAGS, *self._compiled, "-o", str(built), "-lm"]
            done = subprocess.run(command, cwd=scratch, capture_output=True, text=True)
            if done.returncode:
                raise SymheliError(f"the FMU does not compile: {done.stderr[-300:].strip()}")
            return {f"binaries/{folder}/{self.name}.{suffix}": built.read_bytes()}


def _element(reference: int, v: Variable) -> str:
    """A variable as an element of the description."""
    given = {"name": str(v.signal), "valueReference": str(reference)}
    given["causality"] = "input" if v.kind == "input" else "output"
    given["variability"] = "discrete" if v.steps or v.kind == "whole" else "continuous"
    if v.kind == "state":
        given["initial"] = "exact"
    if v.kind in ("input", "state"):
        given["start"] = repr(float(v.start))
    if v.kind != "whole" and v.signal.unit != "1":
        given["unit"] = v.signal.unit
    if v.about:
        given["description"] = v.about
    words = " ".join(f"{key}={quoteattr(value)}" for key, value in given.items())
    return f"<{'Int32' if v.kind == 'whole' else 'Float64'} {words}/>"
