"""The specification sheet of a vehicle: the study's controllers and others, frozen, proven, flown."""
