"""What a cross compiler and an emulator say of exported C on a bare Cortex-M: bits, instructions,
stack, size; calls and loops.

Recursion and dynamic stack are read from the call graph that gcc writes (-fcallgraph-info), loops
from its dumps: a loop is counted where gcc knows the number of iterations as soon as the loop is
entered, or a bound of it.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

TOOLS = ("arm-none-eabi-gcc", "qemu-system-arm", "make")
STRICT = "-Wall -Wextra -Werror -Wvla -Wstack-usage=4096"
CORES = {
    "cortex-m4": ("-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16"),
    "cortex-m7": ("-mcpu=cortex-m7", "-mfpu=fpv5-d16"),
}
FLAGS = ("-std=c99", "-mthumb", "-mfloat-abi=hard", "-ffp-contract=off", *STRICT.split())
MEMORY = {"memset", "memcpy", "memmove", "memcmp"}
"""Functions that every C environment has, and that the compiler may call on its own."""
MATHEMATICS = {"sin", "cos", "tan"}

COUNTED = ("-O2", "-fno-inline", "-fno-tree-vectorize", "-DRLS_NO_VECTORS")
"""How loops are counted: each function by itself."""


def missing() -> str:
    """The tools that are not installed, in words; empty where all are."""
    absent = [tool for tool in TOOLS if shutil.which(tool) is None]
    return f"not installed: {', '.join(absent)}" if absent else ""


def versions() -> str:
    """Compiler and emulator, as they call themselves."""
    lines = (
        subprocess.run([tool, "--version"], check=True, capture_output=True, text=True).stdout
        for tool in TOOLS[:2]
    )
    return "; ".join(text.splitlines()[0] for text in lines)


@dataclass(frozen=True)
class Run:
    """What a check program printed in the emulator, and what a step took.

    `instructions` are the mean and the most of a step, `stack` its deepest in bytes.
    """

    text: str
    passed: bool
    instructions: tuple[int, int]
    stack: int


def checked(folder: Path, target: str, warnings: str = STRICT) -> dict[str, Run]:
    """Compile an exported folder and run its check programs; {name of the program: what it said}.

    Raises `subprocess.CalledProcessError` where the code does not compile.
    """
    make = ("make", "-s", "-C", str(folder), f"TARGET={target}", f"WARNINGS={warnings}")
    subprocess.run([*make, "all"], check=True, capture_output=True, text=True)
    found = {}
    for source in sorted(folder.glob("*_check.c")):
        name = source.stem
        one = [*make, f"CHECKS={name}", "check"]
        done = subprocess.run(one, capture_output=True, text=True, timeout=600)
        found[name] = _run(done.stdout, done.returncode == 0)
    return found


def _run(text: str, passed: bool) -> Run:
    counts = re.search(r"instructions a step: mean (\d+), most (\d+)", text)
    stack = re.search(r"stack of a step: (\d+) bytes", text)
    return Run(
        text,
        passed,
        (int(counts[1]), int(counts[2])) if counts else (0, 0),
        int(stack[1]) if stack else 0,
    )


def size(folder: Path, target: str) -> tuple[int, int]:
    """Bytes of code with constants, and of data, of the library of an exported folder that was
    compiled.
    """
    library = folder / "build" / target / "libonboard.a"
    done = subprocess.run(
        ["arm-none-eabi-size", "-t", str(library)], check=True, capture_output=True, text=True
    )
    text, data, bss = map(int, done.stdout.splitlines()[-1].split()[:3])
    return text, data + bss


@dataclass(frozen=True)
class Calls:
    """The functions of some C files: their own stack (bytes), dynamic objects, and whom they
    call.
    """

    stack: Mapping[str, int]
    dynamic: frozenset[str]
    edges: Mapping[str, frozenset[str]]

    @property
    def recursive(self) -> frozenset[str]:
        """Functions that may be reached from themselves."""
        return frozenset(f for f in self.stack if f in self._reached(f))

    @property
    def outside(self) -> frozenset[str]:
        """Functions that are called and not defined here."""
        return frozenset(g for called in self.edges.values() for g in called) - set(self.stack)

    def deepest(self, function: str) -> int:
        """Bytes of stack of a call and all it calls; functions from outside count 0. Of functions
        that do not call themselves.
        """
        called = self.edges.get(function, frozenset())
        return self.stack.get(function, 0) + max(map(self.deepest, called), default=0)

    def _reached(self, function: str) -> set[str]:
        found: set[str] = set()
        new = set(self.edges.get(function, ()))
        while new:
            found |= new
            new = {g for f in new for g in self.edges.get(f, ())} - found
        return found


def flying(folder: Path) -> list[Path]:
    """The C files of an exported folder that fly."""
    return sorted(f for f in folder.glob("*.c") if not f.stem.endswith("_check"))


def calls(folder: Path, target: str, work: Path) -> Calls:
    """The call graph of what flies, optimised as it flies; `work` is an empty folder."""
    stack: dict[str, int] = {}
    dynamic: set[str] = set()
    edges: dict[str, set[str]] = {}
    for source in flying(folder):
        _compile(source, target, work, "-O2", "-fcallgraph-info=su,da")
        text = (work / f"{source.stem}.ci").read_text(encoding="utf-8")
        # the same name may be local to two files
        for title, label in re.findall(r'node: \{ title: "([^"]+)" label: "([^"]*)"', text):
            if own := re.search(r"(\d+) bytes \((\w+)", label):
                stack[title] = int(own[1])
                objects = re.search(r"(\d+) dynamic objects", label)
                if own[2] != "static" or objects is None or int(objects[1]):
                    dynamic.add(title)
        for a, b in re.findall(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"', text):
            edges.setdefault(a, set()).add(b)
    return Calls(stack, frozenset(dynamic), {f: frozenset(g) for f, g in edges.items()})


def undefined(folder: Path, target: str, work: Path) -> set[str]:
    """Symbols that what flies takes from elsewhere."""
    objects = [str(_compile(source, target, work, "-O2")) for source in flying(folder)]
    lines = subprocess.run(
        ["arm-none-eabi-nm", *objects], check=True, capture_output=True, text=True
    ).stdout.splitlines()
    named = [line.split() for line in lines if line.strip() and not line.endswith(":")]
    return {w[-1] for w in named if w[-2] == "U"} - {w[-1] for w in named if w[-2] != "U"}


def uncounted(source: Path, target: str, work: Path) -> tuple[int, list[str]]:
    """Number of loops of a C file, and the functions of those whose iterations gcc does not know
    when they are entered, one entry each.
    """
    _compile(source, target, work, *COUNTED, *(f"-fdump-tree-{p}-details" for p in DUMPS))
    found = {
        (function, match[1])
        for function, line in _lines(work, source, "loopinit")
        if (match := re.match(r";; Loop ([1-9]\d*)$", line))
    }
    return len(found), sorted(function for function, _ in found - _counted(work, source))


DUMPS = ("loopinit", "sccp", "ivcanon")


def _counted(work: Path, source: Path) -> set[tuple[str, str]]:
    """Function and number of the loops with a number of iterations, or a bound of it."""
    counted, loop, certain = set(), "", True
    for function, line in _lines(work, source, "sccp"):
        if match := re.match(r"Analyzing # of iterations of loop (\d+)", line):
            loop, certain = match[1], True
        certain = certain and "under assumptions" not in line
        if certain and re.match(r"\s+# of iterations .*, bounded by \d+", line):
            counted.add((function, loop))
    for function, line in _lines(work, source, "ivcanon"):
        match = re.match(r"Loop (\d+) iterates at most (\d+) times", line)
        if match and int(match[2]) <= FEW:
            counted.add((function, match[1]))
    return counted


FEW = 10_000
"""Iterations that are a bound; a larger one is only that a counter of the loop may not overflow."""


def _lines(work: Path, source: Path, dump: str) -> Iterator[tuple[str, str]]:
    """Lines of a dump, each with the function it is about."""
    path = next(work.glob(f"{source.stem}.*{dump}"), None)  # none where there is no loop
    function = ""
    text = "" if path is None else path.read_text(encoding="utf-8")
    for line in text.splitlines():
        if match := re.match(r";; Function (\S+) ", line):
            function = match[1]
        yield function, line


def analyzed(source: Path, target: str, work: Path, *flags: str) -> str:
    """What gcc's static analyzer warns of in a C file; empty where it finds nothing."""
    command = _command(source, target, work, "-O2", "-fanalyzer", *flags)
    return subprocess.run(command, capture_output=True, text=True).stderr


def _compile(source: Path, target: str, work: Path, *flags: str) -> Path:
    subprocess.run(_command(source, target, work, *flags), check=True, capture_output=True)
    return work / f"{source.stem}.o"


def _command(source: Path, target: str, work: Path, *flags: str) -> list[str]:
    out = ("-dumpdir", f"{work}/", "-dumpbase", source.stem, "-o", str(work / f"{source.stem}.o"))
    return ["arm-none-eabi-gcc", *CORES[target], *FLAGS, *flags, "-c", str(source), *out]
