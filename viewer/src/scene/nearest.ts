// Of a rigid load, whose cables need not meet: the two drones and the two cables nearest to each other, with their distances written.

import { BufferGeometry, Group, Line, LineBasicMaterial, Vector3 } from "three";
import { nearest as nearestOf, nearestCables } from "../data";
import { MOST_PAIRED } from "../tables";
import type { Maker } from "./element";

/** Cables that end closer together than this are not told apart, m: they meet. */
const MEET = 1e-3;

export const nearest: Maker = (flight) => {
  const object = new Group();
  const [drones, cables] = [0, 1].map(() => {
    const line = new Line(new BufferGeometry(), new LineBasicMaterial({ transparent: true, opacity: 0.7 }));
    line.frustumCulled = false;
    object.add(line);
    return line;
  }) as [Line<BufferGeometry, LineBasicMaterial>, Line<BufferGeometry, LineBasicMaterial>];
  const [from, to] = [new Vector3(), new Vector3()];
  let colours = { near: "", far: "" };
  return {
    object,
    paint(palette) {
      colours = { near: palette.warn, far: palette.soft };
    },
    update(frame, shown, labels) {
      const n = shown.angles && flight.info.body && frame.n <= MOST_PAIRED ? frame.n : 0;
      const pair = nearestOf(frame.positions, n);
      drones.visible = pair.one >= 0;
      if (drones.visible) {
        from.fromArray(frame.positions, 3 * pair.one);
        to.fromArray(frame.positions, 3 * pair.other);
        drones.geometry.setFromPoints([from, to]);
        const near = pair.distance < (flight.info.safe_distance ?? 0);
        drones.material.color.set(near ? colours.near : colours.far);
        labels.put(`${pair.distance.toFixed(2)} m`, from.lerp(to, 0.5), near ? "angle" : "scale");
      }
      const gap = nearestCables(frame.positions, frame.ends, n);
      cables.visible = gap.distance > MEET;
      if (!cables.visible) return;
      from.fromArray(gap.points[0]);
      to.fromArray(gap.points[1]);
      cables.geometry.setFromPoints([from, to]);
      cables.material.color.set(colours.far);
      labels.put(`cables ${gap.distance.toFixed(2)} m`, from.lerp(to, 0.5), "scale");
    },
  };
};
