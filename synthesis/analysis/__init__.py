"""The questions one can ask: gains, stability and decay of a model, from search to certificate."""
