"""`python -m evidence.logs --folder DIR`: public flight logs, fetched, and identified or refused.

The files are taken from `--folder` where they are there, else fetched from their repositories; each
is held against its checksum. None of them belongs to this project: licences are in the table.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evidence.public_files import PublicFile, fetched
from evidence.tables import DOCS, keep, markdown
from identification.judge.scores import percent
from studies import cli
from symheli.errors import InputError


@dataclass(frozen=True)
class PublicLog(PublicFile):
    """A log with its licence, what wrote it, and whether it is expected to be identified."""

    licence: str
    writer: str
    identified: bool


LOGS = (
    PublicLog(
        "arducopter-2014.bin",
        "dronekit/dronekit-la-testdata",
        "62408712e9af63311fa6760b4a6d29b3455e04af",
        "log171.bin",
        "a4a3883fa13f28d55878c041cb4cc14deb3e5335aad6b9091f235c9b4e0d95f0",
        "CC BY-SA 3.0",
        "ArduPilot DataFlash, copter, 2014",
        identified=True,
    ),
    PublicLog(
        "arducopter-failure.bin",
        "BeastAyyG/ardupilot-log-diagnosis",
        "79fad4ee5963c830f90ebad199a4c592ab26022b",
        "data/clean_imports/background_expert_01/benchmark_ready/dataset/"
        "log_0036_mechanical_failure.bin",
        "d9464b12aaed79a5ea7f7c626bd96d83037db37018deff5c2399d078a9d155fe",
        "MIT (by its badge)",
        "ArduPilot DataFlash, copter",
        identified=True,
    ),
    PublicLog(
        "sample.bin",
        "BeastAyyG/ardupilot-log-diagnosis",
        "79fad4ee5963c830f90ebad199a4c592ab26022b",
        "sample.bin",
        "33c535f6f0edb143bb85909901be52bd73542206e3116ae9ddf22b1c42606cfb",
        "MIT (by its badge)",
        "ArduPilot DataFlash, copter, with units",
        identified=True,
    ),
    PublicLog(
        "ardupilot-bench.bin",
        "ArduPilot/pymavlink",
        "b4c7ca298cfac46aa841994d5d3288143e2fa7e5",
        "tests/test.BIN",
        "a51f040b2ad7f55185c1da5705f226f51469b86562c4ff76d05c99e0e52c2bf4",
        "LGPL-3.0",
        "ArduPilot DataFlash",
        identified=False,
    ),
    PublicLog(
        "arducopter-2014-b.bin",
        "joeydouglas/dataflash_logs",
        "5830c9fe8498fccf2531cc80be12ee847496a72e",
        "2014-10-18 20-04-24.bin",
        "314ce5d710663e277c0dc7700c8f76c4bac7bab01be5445eaeef268b92442059",
        "none stated",
        "ArduPilot DataFlash, copter, 2014",
        identified=False,
    ),
    PublicLog(
        "px4-sample.ulg",
        "PX4/pyulog",
        "3cf17793f14709713ab297d3743314c658874068",
        "test/sample.ulg",
        "81952e6059bc095717e7911c010e07f85749d6b04d332a5ffc51575a3fd0a558",
        "BSD-3-Clause",
        "PX4 ULog",
        identified=False,
    ),
    PublicLog(
        "px4-events.ulg",
        "PX4/pyulog",
        "3cf17793f14709713ab297d3743314c658874068",
        "test/sample_px4_events.ulg",
        "4b43a23a7b7f649004facba5c7835d800bbc8cc13e71cbc96678d971451e3d7e",
        "BSD-3-Clause",
        "PX4 ULog, simulated",
        identified=True,
    ),
    PublicLog(
        "px4-tagged.ulg",
        "PX4/pyulog",
        "3cf17793f14709713ab297d3743314c658874068",
        "test/sample_logging_tagged_and_default_params.ulg",
        "32f564608d46caf5a4cbb1cb0cd0dc839fb9512b06c6d1384fb96ec3d6c9173d",
        "BSD-3-Clause",
        "PX4 ULog",
        identified=False,
    ),
    PublicLog(
        "px4-1khz.ulg",
        "kd0aij/impulse-response",
        "361dc5c284452224e3cd94c3085bab86aa740401",
        "sample_ulogs/1KHz/S250/flight3/log1.ulg",
        "bba1e4c1bcfab2a48ce81ad551fe3af162bd4fa1ada9359a5aca26846aec2ef4",
        "GPL-3.0",
        "PX4 ULog",
        identified=False,
    ),
    PublicLog(
        "sess005.px4log",
        "dronefreak/system-identification-helicopter",
        "c5cf1ae4936f1bbbbef6456a796d1e8376344f1e",
        "data/logs/flight_logs/sess005/log001.px4log",
        "1af12b74feabed319e89aafc88639ed11d4948644f398905c69bac00573c51c1",
        "MIT",
        "PX4 sdlog2",
        identified=True,
    ),
    PublicLog(
        "Forward.txt",
        "dronefreak/system-identification-helicopter",
        "c5cf1ae4936f1bbbbef6456a796d1e8376344f1e",
        "data/flight_data/raw/Forward.txt",
        "c6bf9f3a9d92fe28e5baa53e9433529941c9f50a7472d671a256bf6e162a1059",
        "MIT",
        "X-Plane, simulated helicopter",
        identified=True,
    ),
    PublicLog(
        "Data.txt",
        "dronefreak/system-identification-helicopter",
        "c5cf1ae4936f1bbbbef6456a796d1e8376344f1e",
        "data/flight_data/raw/Data.txt",
        "a9ca459f50f3a42eccad9664e425e034aafabaf767d69ffbe36eec2eb361a8a5",
        "MIT",
        "X-Plane, simulated helicopter",
        identified=True,
    ),
    PublicLog(
        "btfl_002.bbl",
        "ilya-epifanov/fc-blackbox",
        "de08350b2bd95f7af93b1b4adf0f27dc3dfd227a",
        "src/test-data/btfl_002.bbl",
        "601784ddf8653166a95a7ac762e422535ab201b0859a40279b205f15c244bd70",
        "MIT or Apache-2.0",
        "Betaflight Blackbox, 4.2.8",
        identified=True,
    ),
    PublicLog(
        "gg_001.bbl",
        "gimbal-ghost/gimbal-ghost",
        "701fb13d459b901503bd9e9fa84e8b8d73d60d1c",
        "test/btfl_001.bbl",
        "e2467d76e314d54d01b5eb5faac3c1a2538fe5161e20fd5428f4422d6c317520",
        "GPL-3.0-or-later",
        "Betaflight Blackbox, 4.2.9",
        identified=True,
    ),
    PublicLog(
        "rf-clean.bbl",
        "hillbilly1975/Blackbox_Lab",
        "687af43cb4487322e6c0f8b5bdf3797673e02433",
        "samples/sample-clean-tuned.bbl",
        "ddf647472fc324f3f3f8088f6b37671929c84e8c3c5659ccb80b6ee4f8169023",
        "MIT",
        "Rotorflight Blackbox, generated, not flown",
        identified=True,
    ),
)
"""A writer is what stands before the first comma."""


@dataclass(frozen=True)
class Verdict:
    """What became of a log: the reason where it was refused, else what was used and the fits on the
    part held out, in percent, by model: one step, 1 s ahead, free run.
    """

    reason: str = ""
    used: float = 0.0
    airspeed: tuple[float, float] | None = None
    output: str = ""
    fits: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    @property
    def identified(self) -> bool:
        """Whether a model came out and was scored."""
        return not self.reason


def judged(file: Path) -> Verdict:
    """Survey a log and run the command that the survey suggests.

    A suggested command that fails raises `InputError`: none may.
    """
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        seen = _answer("identify", str(file))
        if isinstance(seen, str):
            return Verdict(reason=seen)
        if seen.get("suggested_command"):
            if seen["suggested_map"]:
                Path("aircraft.toml").write_text(seen["suggested_map"], encoding="utf-8")
            command = seen["suggested_command"][1:]
            seen = _answer(*command)
            if isinstance(seen, str):
                raise InputError(f"{file.name}: the suggested command failed: {seen}")
        elif "models" not in seen:
            return Verdict(reason=seen["refused"])
    read = seen["read"]
    judged_models = [(label, seen["models"][label]) for label in seen["judged"]]
    held = {label: model["fit_percent"]["held_out"] for label, model in judged_models}
    output = next(iter(next(iter(next(iter(held.values())).values()))))
    return Verdict(
        used=read["dt"] * read["samples"],
        airspeed=tuple(read["scheduling_range"]) if read["scheduling"] != "constant" else None,
        output=output,
        fits={
            label: tuple(float(f[output]) for f in fits.values()) for label, fits in held.items()
        },
    )


def _answer(*words: str) -> Any:
    """What a command answers with --json, or the sentence of its error."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = cli.main([*words, "--json"])
    if code:
        return err.getvalue().strip().splitlines()[-1].removeprefix("symheli: ")
    return json.loads(out.getvalue())


def rows(folder: Path) -> Iterator[tuple[PublicLog, Verdict]]:
    """Each log with its verdict; one that is not there has the reason for it."""
    for log in LOGS:
        try:
            file = fetched(log, folder)
        except InputError as error:
            yield log, Verdict(reason=f"absent: {error}")
            continue
        yield log, judged(file.resolve())


def table(found: list[tuple[PublicLog, Verdict]]) -> str:
    """The table in Markdown."""
    head = ["log", "writer", "licence", "used", "held out: one step, 1 s, free run; else why not"]
    return markdown(head, [[*_about(log), _used(v), _score(v)] for log, v in found])


def _about(log: PublicLog) -> list[str]:
    return [
        f"`{log.path.rsplit('/', 1)[-1]}` of {log.repository}",
        log.writer,
        log.licence,
    ]


def _score(verdict: Verdict) -> str:
    if not verdict.identified:
        return f"refused, missing: {verdict.reason}"
    fits = (f"{label} {' / '.join(map(percent, f))}" for label, f in verdict.fits.items())
    return f"{verdict.output}: {'; '.join(fits)}"


def _used(verdict: Verdict) -> str:
    if not verdict.identified:
        return ""
    over = "" if verdict.airspeed is None else ", {:.1f} to {:.1f} m/s".format(*verdict.airspeed)
    return f"{verdict.used:.0f} s{over}"


def main() -> None:
    """Print the table, or keep it in docs/identify.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, required=True, help="where the logs are, or go to")
    parser.add_argument("--fetch-only", action="store_true", help="fetch and verify them")
    parser.add_argument("--write", action="store_true", help="keep the table in docs/identify.md")
    given = parser.parse_args()
    os.environ.setdefault("SYMHELI_PROGRESS", "0")
    if given.fetch_only:
        for log in LOGS:
            try:
                print(fetched(log, given.folder), log.licence, flush=True)
            except InputError as error:
                parser.exit(1, f"{error}\n")
        return
    found = []
    for log, verdict in rows(given.folder):
        print(log.name, verdict.reason or "identified", flush=True)
        found.append((log, verdict))
    surprising = [log.name for log, v in found if v.identified != log.identified]
    if given.write and not surprising:
        command = "python -m evidence.logs --folder DIR"
        keep(DOCS / "identify.md", "public logs", table(found), command=command)
    else:
        print(table(found))
    if surprising:
        parser.exit(1, f"not as expected: {', '.join(surprising)}\n")


if __name__ == "__main__":
    main()
