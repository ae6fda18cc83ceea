"""The `llm-astar` command, one module a subcommand."""
