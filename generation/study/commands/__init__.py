"""The experiments as subcommands of `python -m generation.study`, one module each: its function `command`."""
