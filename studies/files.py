"""Files that are either whole or not there."""

from symheli.lpv.whole_files import write_bytes, write_text

__all__ = ["write_bytes", "write_text"]
