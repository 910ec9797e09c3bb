"""How labels agree with what else is known of real recordings, as a report with plots."""
