"""How much of the airspeed range the LFT tests can prove."""
