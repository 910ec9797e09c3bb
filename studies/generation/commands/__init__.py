"""The experiments as subcommands of `python -m studies.generation`, one module each: its function
`command`."""
