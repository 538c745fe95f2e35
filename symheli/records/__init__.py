"""Flight records: what was measured, and what is done to it before it is fitted."""

from symheli.records.conditioning import decimate, low_pass, smooth, split, with_norm
from symheli.records.flight_record import FlightRecord

__all__ = ["FlightRecord", "decimate", "low_pass", "smooth", "split", "with_norm"]
