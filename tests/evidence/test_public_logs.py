"""Public logs: identified, or refused with a reason, as the table expects.

They belong to others and are not kept here: `python -m evidence.logs --folder DIR --fetch-only`
fetches them, and SYMHELI_PUBLIC_LOGS=DIR names the folder; of the others the
tests are skipped.
"""

import os
from pathlib import Path

import pytest

from evidence import public_files
from evidence.logs import LOGS, PublicLog, Verdict, judged, table
from evidence.public_files import fetched
from symheli.errors import InputError

BESIDE = Path(__file__).resolve().parents[3] / "shared" / "data" / "xplane"
FOLDER = Path(os.environ.get("SYMHELI_PUBLIC_LOGS", BESIDE))
QUICK = ("ardupilot-bench.bin", "Data.txt")
"""One that is refused and one that is identified, small ones."""


def _parameters():
    for log in LOGS:
        marks = [] if log.name in QUICK else [pytest.mark.slow]
        yield pytest.param(log, id=log.name, marks=marks)


@pytest.mark.slow(but="ardupilot-bench.bin")
@pytest.mark.parametrize("log", _parameters())
def test_a_public_log_is_identified_or_refused_as_expected(log):
    if not (FOLDER / log.name).is_file():
        pytest.skip(f"{log.name} is not here: python -m evidence.logs --folder DIR --fetch-only")
    for module in ("pymavlink", "pyulog"):
        pytest.importorskip(module)
    verdict = judged(fetched(log, FOLDER.resolve()))
    assert verdict.identified == log.identified
    if verdict.identified:
        assert verdict.used > 5.0
        one_step, *_ = next(iter(verdict.fits.values()))
        assert one_step < 100.0
    else:
        assert len(verdict.reason) > 20


def test_ten_logs_of_five_writers_each_with_a_licence_and_a_commit():
    assert len(LOGS) >= 10
    assert len({log.writer.partition(",")[0] for log in LOGS}) >= 5
    assert sum(log.identified for log in LOGS) >= 4
    for log in LOGS:
        assert log.licence
        assert len(log.commit) == 40
        assert len(log.sha256) == 64


def test_another_file_of_the_name_is_refused(tmp_path):
    log = LOGS[0]
    (tmp_path / log.name).write_bytes(b"something else")
    with pytest.raises(InputError, match=r"SHA-256 \w+, expected \w+: another file"):
        fetched(log, tmp_path)


def test_a_file_that_is_there_is_not_fetched_and_one_that_cannot_be_is_said(tmp_path, monkeypatch):
    import hashlib

    def no_network(*_, **__):
        raise OSError("no network")

    monkeypatch.setattr(public_files.urllib.request, "urlopen", no_network)
    content = b"a log"
    log = PublicLog(
        "x.bin", "o/r", "0" * 40, "a b.bin", hashlib.sha256(content).hexdigest(), "MIT", "W", True
    )
    assert log.address.endswith("/o/r/" + "0" * 40 + "/a%20b.bin")
    with pytest.raises(InputError, match=r"cannot be fetched \(no network"):
        fetched(log, tmp_path)
    (tmp_path / "x.bin").write_bytes(content)
    assert fetched(log, tmp_path) == tmp_path / "x.bin"


def test_a_row_of_the_table_has_the_fits_or_the_reason():
    rows = table(
        [
            (LOGS[0], Verdict(used=12.0, output="q", fits={"LTI": (50.0, 1.0, -1e9)})),
            (LOGS[1], Verdict(reason="nothing moves")),
        ]
    )
    assert "q: LTI 50.0 / 1.0 / diverges" in rows
    assert "refused, missing: nothing moves" in rows
