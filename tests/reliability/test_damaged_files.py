"""A damaged file is refused, or read as what it still is; nothing else, and it stays as it was."""

import damaged_files
import good_files
import pytest

from symheli.logs.format import format_of, known_formats

# pyulog leaves a file open that it cannot read
pytestmark = [
    pytest.mark.guard,
    pytest.mark.filterwarnings(
        "ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"
    ),
]


@pytest.fixture(scope="module")
def readers(tmp_path_factory):
    return good_files.readers(tmp_path_factory.mktemp("files"))


def test_no_damage_of_a_file_fails_silently(readers):
    """Every kind of damage once; of `damaged_files.USUAL` files each: benchmarks/fuzz.py."""
    kinds = len(damaged_files.KINDS)
    told = [fault for reader in readers for fault in damaged_files.tally(reader, kinds).faults]
    assert not told, "\n".join(map(str, told))


def test_every_format_of_logs_is_damaged_here(tmp_path):
    for library in ("pyulog", "pymavlink"):
        pytest.importorskip(library)
    ours = {n for n, form in known_formats().items() if type(form).__module__.startswith("symheli")}
    assert {format_of(reader.path) for reader in good_files.logs(tmp_path)} == ours
