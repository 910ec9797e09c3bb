"""Pages and pictures of runs: replays, reports, rehearsals, assessments."""
