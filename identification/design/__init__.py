"""Design of experiments: what a record determines, and which experiment is most informative."""
