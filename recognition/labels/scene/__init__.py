"""What the rules ask of a recording: rows of all vehicles with their leads, lane changes and ways through junctions."""
