"""The closed loop: recordings are recognised, varied into edge cases, checked, run and shown; failures feed the next search."""
