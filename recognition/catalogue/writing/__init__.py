"""Files of a catalogue: scenarios, index, page."""
