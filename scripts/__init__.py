"""The command line, one file per subcommand, and scripts to copy from."""
