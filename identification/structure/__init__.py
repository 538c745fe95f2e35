"""Structures that are sought: outputs, inputs, lags, basis; sensors, actuators and wind around the
vehicle.
"""

from symheli.lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
