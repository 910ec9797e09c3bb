"""ASAM OSI traces: reading `.osi` and `.mcap` files that may be anything, and the published rules for ground truth."""
