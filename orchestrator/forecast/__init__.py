"""How far the car will get in the next seconds: learnt from drives, calibrated while driving."""
