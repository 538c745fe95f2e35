"""Identification while the vehicle flies: sources of samples, their clock, the record, what is
known; and a simulated vehicle that speaks the same protocols.
"""
