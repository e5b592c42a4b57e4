"""Numbers in messages."""


def counted(number: int, noun: str, plural: str | None = None) -> str:
    """A number and what it counts: "1 cluster", "2 clusters"; the plural, unless given, with an s."""
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def length(metres: float) -> str:
    """A length with its unit: metres from 0.1 m on, else millimetres."""
    return f"{metres:.2f} m" if metres >= 0.1 else f"{1000 * metres:.2f} mm"
