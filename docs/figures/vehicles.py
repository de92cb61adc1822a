"""Tables of the vehicles and of their sources: ``python docs/figures/vehicles.py`` writes them into the page."""

from pages import fill, table

from colift.catalogue import own_vehicle_names
from colift.team.vehicles import NUMBERS, Vehicle, complete, estimated_inertia

GRAVITY = 9.81


def shown(value, digits=3):
    return "?" if value is None else f"{value:.{digits}g}"


def row(name):
    """What the table tells of a vehicle; what is an estimate stands in italics."""
    vehicle = Vehicle.named(name)
    numbers = complete({}, vehicle).numbers
    moments = ", ".join(shown(moment) for moment in numbers["inertia"])
    ratios = "estimated"
    if vehicle.inertia is None:
        moments = f"*{moments}*"
    else:
        guess = estimated_inertia(vehicle.mass, vehicle.arm)
        pairs = zip(vehicle.inertia, guess, strict=True)
        ratios = ", ".join(f"{given / taken:.2f}" for given, taken in pairs)
    lag = None if vehicle.motor_lag is None else 1e3 * vehicle.motor_lag
    hours = None if vehicle.energy is None else vehicle.energy / 3600.0
    cells = [shown(vehicle.mass), shown(vehicle.max_thrust)]
    cells += [f"{vehicle.max_thrust / (vehicle.mass * GRAVITY):.1f}", moments, shown(lag)]
    cells += [shown(vehicle.arm), shown(numbers.get("radius")), str(vehicle.rotors)]
    return [f"`{name}`", *cells, shown(hours), ratios]


def main():
    names = own_vehicle_names()
    head = [
        "vehicle",
        "kg",
        "thrust, N",
        "÷ weight",
        "inertia, kg m²",
        "lag, ms",
        "arm, m",
        "radius, m",
    ]
    head += ["rotors", "battery, Wh", "inertia ÷ estimate"]
    fill("your-drones.md", "vehicles", table(head, map(row, names)))
    parts = []
    for name in names:
        vehicle = Vehicle.named(name)
        values = {field: getattr(vehicle, field) for field in NUMBERS}
        rows = [
            [
                f"`{field}`",
                f"`{list(value) if field == 'inertia' else value}`",
                vehicle.sources[field],
            ]
            for field, value in values.items()
            if field in vehicle.sources
        ]
        text = table(["field", "value", "source"], rows)
        parts.append(f"**`{name}`**: {vehicle.description}\n\n{text}")
    fill("your-drones.md", "vehicle-sources", "\n\n".join(parts))


if __name__ == "__main__":
    main()
