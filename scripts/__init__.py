"""What is run: the command line, programs to copy, and benchmarks."""
