"""Classical measures of one loop: margins, bandwidth, phase delay."""
