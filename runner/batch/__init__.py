"""Many runs: jobs, processes, clusters, and what is done so far."""
