"""Flight records: samples with names and units, and what is done to them before identification.

The examples of this package start from

>>> import numpy as np
>>> from symheli import records
>>> time = 0.02 * np.arange(500)
>>> record = records.FlightRecord.from_arrays(
...     time, {"u": "m/s", "v": "m/s"}, u=3.0 + 0.0 * time, v=4.0 + np.sin(2 * np.pi * 20 * time)
... )
"""

from symheli.records.conditioning import decimate, low_pass, smooth, split, with_norm
from symheli.records.flight_record import FlightRecord
from symheli.records.kinematic_check import KinematicCheck, SensorCheck, check_kinematics
from symheli.records.mending import mended

__all__ = [
    "FlightRecord",
    "KinematicCheck",
    "SensorCheck",
    "check_kinematics",
    "decimate",
    "low_pass",
    "mended",
    "smooth",
    "split",
    "with_norm",
]
