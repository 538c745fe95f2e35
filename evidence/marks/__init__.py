"""How well identified models stand for the helicopter, on flights of many seeds."""
