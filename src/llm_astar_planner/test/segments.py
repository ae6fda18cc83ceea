"""An exact test of whether two straight segments meet, which shares no code with the planner."""


def crosses(p, q, a, b):
    """Whether the closed segments p-q and a-b meet; the ends (x, y) are whole numbers."""

    def side(o, u, v):
        return (u[0] - o[0]) * (v[1] - o[1]) - (u[1] - o[1]) * (v[0] - o[0])

    def sign(value):
        return (value > 0) - (value < 0)

    def within(u, v, w):
        return all(min(u[i], v[i]) <= w[i] <= max(u[i], v[i]) for i in (0, 1))

    sides = [sign(side(*args)) for args in ((p, q, a), (p, q, b), (a, b, p), (a, b, q))]
    if sides[0] != sides[1] and sides[2] != sides[3]:
        return True
    ends = ((p, q, a), (p, q, b), (a, b, p), (a, b, q))
    return any(s == 0 and within(*args) for s, args in zip(sides, ends))
