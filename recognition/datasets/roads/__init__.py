"""Roads made from what data sets have instead of OpenDRIVE."""
