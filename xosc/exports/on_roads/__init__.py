"""What exports say differently once they know the roads: starts, places, ways and arrivals."""
