"""Pages in a browser on this machine: a flight that is watched, sizes that are moved."""
