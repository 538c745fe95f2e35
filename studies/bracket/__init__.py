"""The lateral loop bracketed from both sides: `python -m studies.bracket`."""
