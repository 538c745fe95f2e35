"""The specification sheet of a vehicle, for the controllers of the study and others."""
