"""Motion of recorded tracks: observations with noise, models of vehicles and pedestrians, the
smoother."""
