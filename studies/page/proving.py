"""The LPV design with its certificate in a process of its own, which can be given up."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from studies.controllers import synthesized_report as report
from studies.controllers.design_choices import DesignChoices
from studies.controllers.synthesized import Given, Synthesized, synthesized
from symheli.errors import SymheliError
from symheli.export import write_controller
from symheli.progress import Progress, watched
from symheli.values.whole_files import write_text
from symheli.worker import ProcessEndedError, Worker, pickled

EVERY = 0.2
"""Seconds between two lines of progress."""
C, SIZES = "c", "sizes.toml"
"""Folder of the C, and the file of choices of which nothing is proven, in that of the design."""


@dataclass(frozen=True)
class Proof:
    """Sentences, tables and numbers of a design, as its report has them."""

    choices: DesignChoices
    verified: bool
    answer: str
    sentences: tuple[str, ...]
    gains: tuple[tuple[str, str, str], ...]
    margins: tuple[tuple[str, ...], ...]
    hypotheses: tuple[str, ...]
    seconds: Mapping[str, float]


class Proving:
    """The latest design: under way, given up, failed or proven.

    Parameters
    ----------
    given : optional
        Model to design for, as of `synthesized`.
    """

    def __init__(self, given: Given | None = None):
        self._given = given
        self._folder = TemporaryDirectory(prefix="symheli-")
        self._worker: Worker | None = None
        self._thread: threading.Thread | None = None
        self._lock = threading.Lock()
        self._given_up = False
        self.proof: Proof | None = None
        self.said = ""
        """Reason why the last one is no proof."""
        self.changes = 0
        """Number of changes of all this."""

    @property
    def running(self) -> bool:
        """Whether a design is under way."""
        return self._thread is not None and self._thread.is_alive()

    @property
    def progress(self) -> str:
        """The line that the design under way has written last."""
        try:
            return self._line.read_text(encoding="utf-8")
        except OSError:
            return "begins"

    def begin(self, choices: DesignChoices) -> None:
        """Design and prove; nothing where one is under way."""
        with self._lock:
            if self.running:
                return
            self.proof, self.said, self._given_up = None, "", False
            self._line.unlink(missing_ok=True)
            self._stop()
            self._worker = Worker()
            self._thread = threading.Thread(
                target=self._prove, args=(self._worker, choices), daemon=True, name="proof"
            )
            self._thread.start()
            self.changes += 1

    def cancel(self) -> None:
        """Give up what is under way, at once."""
        with self._lock:
            worker = self._worker if self.running else None
        if worker is not None:
            self._given_up = True
            worker.kill()

    def save(self, choices: DesignChoices) -> list[Path]:
        """Write the choices, and where they are the proven ones everything that `synthesize` writes
        and the C. Raises `OSError` and what the report raises.
        """
        worker = self._worker
        if self.proof is None or self.proof.choices != choices or worker is None or self.running:
            choices.out.mkdir(parents=True, exist_ok=True)
            return [choices.write(choices.out / SIZES)]
        return worker(pickled(write))

    def close(self) -> None:
        """End the process."""
        self.cancel()
        self._stop()
        self._folder.cleanup()

    @property
    def _line(self) -> Path:
        return Path(self._folder.name) / "progress.txt"

    def _stop(self) -> None:
        if self._worker is not None:
            self._worker.__exit__(None, None, None)
            self._worker = None

    def _prove(self, worker: Worker, choices: DesignChoices) -> None:
        try:
            self.proof = worker(pickled(prove, choices, self._given, self._line))
        except ProcessEndedError as error:
            self.said = "given up: nothing is proven" if self._given_up else str(error)
        except SymheliError as error:
            self.said = str(error)
        except Exception as error:
            self.said = repr(error)
        self.changes += 1


_kept: dict[str, Synthesized] = {}
"""The last design of this process, for `write`."""


def prove(choices: DesignChoices, given: Given | None, line: Path) -> Proof:
    """Design, certify and fly; the progress goes into the file `line`. Errors as of
    `synthesized`.
    """
    with watched(_Written(line)):
        found = _kept["last"] = synthesized(choices, given)
    return Proof(
        choices=choices,
        verified=found.sampled.certificate.verified,
        answer=report.answer(found),
        sentences=tuple(report.sentences(found)),
        gains=tuple(report.gains(found)),
        margins=tuple(map(tuple, report.margins(found))),
        hypotheses=tuple(map(str, found.sampled.certificate.hypotheses)),
        seconds=dict(found.seconds),
    )


def write() -> list[Path]:
    """Write the last design of this process: what `symheli synthesize` writes, and the C."""
    found = _kept["last"]
    return [*report.write(found), *write_controller(found.table, found.choices.out / C)]


class _Written:
    """A listener that keeps the open tasks in a file."""

    def __init__(self, line: Path):
        self._path, self._open, self._next = line, list[Progress](), 0.0

    def __call__(self, progress: Progress) -> Any:
        """Note where a task is."""
        self._open = [*self._open[: progress.depth], *([] if progress.over else [progress])]
        if self._open and time.monotonic() >= self._next:
            self._next = time.monotonic() + EVERY
            ends = dict.fromkeys(map(str, [self._open[0], self._open[-1]]))
            write_text(self._path, "; ".join(ends))
