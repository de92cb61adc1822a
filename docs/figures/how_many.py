"""Write how many cables a least angle allows in a cone (docs/theory/safe.md): ``python docs/figures/how_many.py [--fly]``.

From ``how_many.json`` beside this file; ``--fly`` searches anew.
"""

import math

from pages import fill, stored, table

from colift.control.allocation.limits.feasibility import most_cables

CONES = (45, 60, 75)
ANGLES = (15, 20, 30, 40, 60)


def search():
    return {
        angle: [most_cables(math.radians(angle), math.radians(cone)) for cone in CONES]
        for angle in ANGLES
    }


def main():
    rows = [
        [f"{angle}°", *(f"{found} ({bound})" for found, bound in counts)]
        for angle, counts in stored(__file__, search).items()
    ]
    header = ["least angle", *(f"cone {cone}°" for cone in CONES)]
    fill("theory/safe.md", "how-many", table(header, rows))


if __name__ == "__main__":
    main()
