"""Where places of the plane are on the roads, one by one and as arrays."""
