"""Many flights or many numbers: where scheduling pays, which flight to fly, what was printed."""
