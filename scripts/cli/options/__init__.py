"""Options that commands share, or that are too many for their command's file: each a dataclass, checked and read."""
