"""The lateral loop bracketed from both sides: `python -m evidence.bracket`."""
