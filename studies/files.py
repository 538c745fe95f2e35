"""Files that are either whole or not there."""

from symheli.values.whole_files import write_bytes, write_text

__all__ = ["write_bytes", "write_text"]
