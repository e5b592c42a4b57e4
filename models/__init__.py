"""The truth model as CasADi symbols, the table of its variables, and the scenarios that give them values."""
