"""Assessment of batches by published test protocols: `xosc-run --assess PROFILE`."""
