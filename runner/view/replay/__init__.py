"""Views of runs: pages that play them in a browser, reports of batches, pictures, animations,
SUMO's own window."""
