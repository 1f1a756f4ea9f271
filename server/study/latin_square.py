"""Orders in which every item comes first, second and so on equally often. Pure."""


def balanced_square(size: int) -> list[list[int]]:
    """Return a Latin square in which every item follows every other equally often (Williams 1949); odd sizes need the
    mirrored rows too, so they have twice as many."""
    zigzag = [0]
    low, high = 1, size - 1
    while len(zigzag) < size:
        zigzag.append(low)
        low += 1
        if len(zigzag) < size:
            zigzag.append(high)
            high -= 1
    rows = [[(cell + shift) % size for cell in zigzag] for shift in range(size)]
    return rows if size % 2 == 0 else rows + [row[::-1] for row in rows]
