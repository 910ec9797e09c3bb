"""The geometry of roads from the borders of lanelets: polylines, where roads begin and end, smooth curves."""
