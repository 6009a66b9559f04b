"""Words for numbers in messages and in the text of values."""


def count_of(count: int, noun: str) -> str:
    """A count with its noun, such as "1 contact" or "2 contacts"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
