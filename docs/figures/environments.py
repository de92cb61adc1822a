"""How fast the environments for learners are: ``python docs/figures/environments.py [--fly]``.

Writes the table of ``docs/learn.md`` from ``environments.json`` beside this file. With ``--fly`` it is measured first, by
``colift bench --env``; needs the package mujoco.
"""

from pages import fill, stored, table

from colift.learn import throughput


def main():
    result = stored(__file__, throughput.run)
    names = list(result["rows"][0]["us"])
    rates = [
        [str(row["n"]), *(f"{1e3 / row['us'][name]:.0f}" for name in names)]
        for row in result["rows"]
    ]
    first, last = (result["rows"][k]["us"] for k in (0, -1))
    text = [
        table(["drones", *names], rates),
        f"Thousands of steps of a team a second and core; {result['machine']['processor']}. Over MuJoCo's RK4, rods are "
        f"{first['MuJoCo RK4'] / first['rods']:.0f} (one drone) to {last['MuJoCo RK4'] / last['rods']:.0f} times "
        f"({result['rows'][-1]['n']} drones) as fast, over its Euler {first['MuJoCo Euler'] / first['rods']:.1f} to {last['MuJoCo Euler'] / last['rods']:.1f} times. "
        f"Two threads take {result['two_threads']['processor']:.2f} times the processor time of one for the same teams.",
    ]
    fill("learn.md", "environments", "\n\n".join(text))


if __name__ == "__main__":
    main()
