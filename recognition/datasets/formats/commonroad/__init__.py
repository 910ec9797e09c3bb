"""CommonRoad XML: files and archives, obstacles, lanelets."""
