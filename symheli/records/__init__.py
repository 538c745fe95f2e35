"""Flight records: what was measured, and what is done to it before it is fitted."""

from symheli.records.conditioning import cut, decimate, low_pass, smooth, split, with_norm
from symheli.records.flight_record import FlightRecord

__all__ = ["FlightRecord", "cut", "decimate", "low_pass", "smooth", "split", "with_norm"]
