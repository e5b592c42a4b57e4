"""Numbers in messages."""


def counted(number: int, noun: str, plural: str | None = None) -> str:
    """A number and what it counts: "1 cluster", "2 clusters"; the plural, unless given, with an s."""
    return f"{number} {noun if number == 1 else plural or noun + 's'}"
