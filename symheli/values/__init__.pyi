from symheli.values.named_vector import NamedVector as NamedVector
from symheli.values.operating_point import OperatingPoint as OperatingPoint
from symheli.values.signal import Signal as Signal
from symheli.values.signal import signals as signals
