"""The record of what comes, written as it comes: a killed process loses nothing, a full disk is
waited for.
"""

from __future__ import annotations

import math
import os
from collections import deque
from collections.abc import Sequence
from pathlib import Path

from studies.live.sample import Sample
from symheli.errors import InputError
from symheli.values.signal import Signal

SYNC = 1.0
"""Seconds after which what was written is on the disk, not only with the operating system."""
MOST = 1_000_000
"""Samples that wait for a disk, at most: five hours at 50 Hz."""


class Recorder:
    """Samples as a CSV file with units in its header, a line a sample, as they came.

    `FlightRecord.from_csv(path, ...)` reads it; a last line that was cut is left out there. While
    the disk takes nothing, samples wait in memory and `problem` says so.

    Parameters
    ----------
    path : Path
        File, which must not be there.
    signals : sequence of str
        Columns, after the time and the sender's name.

    Raises
    ------
    InputError
        For a file that is there already, or cannot be made.
    """

    def __init__(self, path: Path, signals: Sequence[str]):
        self.path, self.signals = Path(path), tuple(signals)
        self.problem: str | None = None
        self.written = 0
        self._waiting: deque[bytes] = deque(maxlen=MOST)
        self._good = 0
        self._synced = -math.inf
        try:
            self._file = open(self.path, "xb", buffering=0)
        except FileExistsError:
            raise InputError(f"{path} is there already: name another file") from None
        except FileNotFoundError:
            raise InputError(f"{path}: make the folder {self.path.parent} first") from None
        except OSError as error:
            raise InputError(f"{path} cannot be written: {error}") from error
        names = (f"{name} [{Signal(name).unit}]" for name in self.signals)
        self._waiting.append((",".join(["t [s]", *names]) + "\n").encode())
        self._write()

    def add(self, sample: Sample, now: float) -> None:
        """Write a sample, and what waited before it; `now` (s) decides when the disk is asked."""
        cells = (sample.time, *(sample.values.get(name, math.nan) for name in self.signals))
        text = ",".join("" if math.isnan(v) else repr(float(v)) for v in cells)
        self._waiting.append(f"{text}\n".encode())
        self._write()
        self.written += 1
        if now - self._synced > SYNC and self.problem is None:
            self._synced = now
            try:
                os.fsync(self._file.fileno())
            except OSError as error:
                self.problem = str(error)

    def _write(self) -> None:
        """Write what waits; what the disk takes in part is taken back, so that lines are whole."""
        while self._waiting:
            line = self._waiting[0]
            try:
                done = self._file.write(line)
                if done != len(line):
                    raise OSError("no space left on the disk")
            except OSError as error:
                self.problem = f"{error}; {len(self._waiting)} samples wait in memory"
                self._take_back()
                return
            self._good += len(line)
            self._waiting.popleft()
            self.problem = None

    def _take_back(self) -> None:
        try:
            self._file.truncate(self._good)
            self._file.seek(self._good)
        except OSError:
            pass

    def close(self) -> None:
        """Write what waits and close the file; without a sample there is none."""
        self._write()
        self._file.close()
        if not self.written:
            self.path.unlink()
