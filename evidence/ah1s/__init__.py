"""A helicopter from elsewhere: the AH-1S that the flight dynamics program JSBSim ships, flown,
identified, and compared with its own linear models.

JSBSim (LGPL) and the file of the aircraft (T. Kreitler, GPL or CC BY-NC-SA) are run where they are
installed; nothing of them is part of this package.
"""
