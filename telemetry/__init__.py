"""The vehicle's side: readers of recorded drives, replay, recorder, estimator, the stand-in car."""
