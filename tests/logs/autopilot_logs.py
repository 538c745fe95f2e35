"""Small logs as autopilots write them: messages of the tests, and their writers."""

from __future__ import annotations

import numpy as np

from evidence.written_logs import FMT, FMTU, MULT, UNIT, ulog
from evidence.written_logs import dataflash as _dataflash

__all__ = ["BEFORE_2015", "DECLARED", "FORMATS", "SDLOG2", "dataflash", "quaternions", "ulog"]


def quaternions(topic_fields):
    """Fields as PX4 names a vector: {"q": (n, 4)} to q[0] ... q[3], which the log declares as
    float[4].
    """
    return {
        f"{name}[{i}]": column
        for name, columns in topic_fields.items()
        for i, column in enumerate(np.transpose(columns))
    }


FORMATS = {
    "FMT": FMT,
    "UNIT": UNIT,
    "FMTU": FMTU,
    "MULT": MULT,
    "IMU": (140, "QBff", "TimeUS,I,GyrY,T"),
    "ATT": (141, "QcC", "TimeUS,Pitch,Yaw"),
    "RATE": (142, "Qh", "TimeUS,POut"),
    "GPS": (143, "QBIH", "TimeUS,Status,GMS,GWk"),
}
"""Type, letters of the fields and their names, by message."""

DECLARED = {"IMU": ("s#EO", "F---"), "ATT": ("sdh", "FBB"), "RATE": ("sn", "FB")}
"""Letters of unit and multiplier for each field."""

SDLOG2 = {
    "FMT": FORMATS["FMT"],
    "TIME": (129, "Q", "StartTime"),
    "ATT": (2, "ffffff", "Roll,Pitch,Yaw,RollRate,PitchRate,YawRate"),
    "ATTC": (9, "ffff", "Roll,Pitch,Yaw,Thrust"),
}
"""Of PX4's logs before ULog: the time stands in a message of its own, before those of its instant
(src/modules/sdlog2/sdlog2_messages.h).
"""

BEFORE_2015 = {
    "FMT": FORMATS["FMT"],
    "ATT": (1, "IcC", "TimeMS,Pitch,Yaw"),
    "IMU": (2, "Ifff", "TimeMS,GyrX,GyrY,GyrZ"),
    "RATE": (3, "If", "TimeMS,POut"),
    "GPS": (130, "BIfI", "Status,TimeMS,Spd,T"),
    "EV": (4, "IB", "TimeMS,Id"),
}
"""Of ArduPilot until 2014: TimeMS is the autopilot's, but of GPS that of the week, with the
autopilot's in T.
"""


def dataflash(rows, *, text=False, units=True, formats=FORMATS):
    """A DataFlash log of [(message, (field, ...)), ...], values as the log stores them (an angle of
    type c in 1/100 degrees); `units`: with the messages that declare them.
    """
    declared = DECLARED if units and "UNIT" in formats else None
    return _dataflash(rows, formats, declared, text=text)
