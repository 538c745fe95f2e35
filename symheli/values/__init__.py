"""Names, units and arrays: the values that every room shares."""

from symheli.values.named_vector import NamedVector
from symheli.values.operating_point import OperatingPoint
from symheli.values.signal import Signal, signals

__all__ = ["NamedVector", "OperatingPoint", "Signal", "signals"]
