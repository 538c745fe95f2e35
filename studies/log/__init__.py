"""From the log of somebody's flight to a fitted model and an honest table."""
