"""An allocator in a program of one's own: compiled beforehand, drones that leave and join, uneven time, errors."""

import colift

colift.warm(allocator="safe", progress=lambda share, kernel: print(f"{share:4.0%} {kernel}"))

# A misspelt keyword is an error for a type checker, and at run time one that names the nearest.
try:
    colift.SafeAllocator(n=4, min_angel_deg=30)  # type: ignore[call-arg]
except colift.SettingError as error:
    print(error)

allocator = colift.SafeAllocator(n=4, min_angle_deg=30)
for dt in (0.010, 0.012, 0.009):  # s since the last call, as the clock of your program has it
    answer = allocator.allocate([0.2, 0.0, 2.2], dt=dt)

allocator.lose(1)  # its cable was cut: the others go on from where they are
answer = allocator.allocate([0.2, 0.0, 2.2], dt=0.010)
print(allocator.drones, answer.tensions)  # (0, 2, 3) and three tensions, in that order

allocator.join()  # drone 1 comes back, into the widest gap; join(1, direction=...) says where
answer = allocator.allocate([0.2, 0.0, 2.2], dt=0.010)
print(allocator.drones, answer.status.name)
