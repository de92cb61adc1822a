"""How many cables a least angle allows in a cone: ``python docs/figures/how_many.py``."""

import math

from colift.allocation._feasibility import most_cables

CONES = (45, 60, 75)

print("| least angle | " + " | ".join(f"cone {cone}°" for cone in CONES) + " |")
print("|---|" + "---|" * len(CONES))
for angle in (15, 20, 30, 40, 60):
    row = (most_cables(math.radians(angle), math.radians(cone)) for cone in CONES)
    print(f"| {angle}° | " + " | ".join(f"{found} ({bound})" for found, bound in row) + " |")
