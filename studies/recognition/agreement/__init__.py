"""Agreement of labels with other knowledge of real recordings, as a report with plots."""
