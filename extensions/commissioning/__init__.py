"""A robot on a bench: bring-up, calibration, identification, motor drift, reach."""
