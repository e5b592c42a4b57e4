"""The command line, `baryscope`: one file for each command, which parses, calls baryscope.study and prints."""
