"""Where the cables' ends lie on a load, and so what moments they can make."""

POINT, LINE, BODY = 0.0, 1.0, 2.0
"""All in one point: none; in one line: none about it; wider: all."""
