"""Terminal of commands: options, help, progress, errors, text that no terminal obeys."""
