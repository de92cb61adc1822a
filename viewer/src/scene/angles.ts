// Pairs of cables closer than the safe angle: a filled sector at the first one's end, with the angle written.

import { BufferGeometry, DoubleSide, Float32BufferAttribute, Group, LineBasicMaterial, LineSegments, Mesh, MeshBasicMaterial, Vector3 } from "three";
import { angleBetween, cableEnd } from "../data";
import { MOST_PAIRED } from "../tables";
import type { Maker } from "./element";

/** Most pairs drawn: the closest. */
const MOST = 12;
const STEPS = 10;

export const angles: Maker = (flight) => {
  const object = new Group();
  const sectors = new Mesh(
    new BufferGeometry(),
    new MeshBasicMaterial({ transparent: true, opacity: 0.4, side: DoubleSide, depthWrite: false }),
  );
  const edges = new LineSegments(new BufferGeometry(), new LineBasicMaterial());
  sectors.frustumCulled = edges.frustumCulled = false;
  object.add(sectors, edges);

  const end = new Vector3();
  const [a, b, p, q] = [new Vector3(), new Vector3(), new Vector3(), new Vector3()];
  const radius = 0.5 * Math.min(...flight.info.cable_lengths);
  return {
    object,
    paint(palette) {
      sectors.material.color.set(palette.warn);
      edges.material.color.set(palette.warn);
    },
    update(frame, shown, labels) {
      const least = flight.info.safe_angle_deg ?? 0;
      const close: [number, number, number][] = [];
      if (shown.angles && frame.n <= MOST_PAIRED) {
        for (let i = 0; i < frame.n; i++) {
          for (let j = i + 1; j < frame.n; j++) {
            const angle = angleBetween(frame.directions, i, j);
            if (angle < least) close.push([angle, i, j]);
          }
        }
        close.sort((one, other) => one[0] - other[0]).splice(MOST);
      }
      object.visible = close.length > 0;
      if (!object.visible) return;
      const triangles: number[] = [];
      const rims: number[] = [];
      for (const [angle, i, j] of close) {
        end.fromArray(cableEnd(frame, i));
        a.fromArray(frame.directions, 3 * i).multiplyScalar(-radius);
        b.fromArray(frame.directions, 3 * j).multiplyScalar(-radius);
        for (let k = 0; k < STEPS; k++) {
          p.lerpVectors(a, b, k / STEPS).setLength(radius).add(end);
          q.lerpVectors(a, b, (k + 1) / STEPS).setLength(radius).add(end);
          triangles.push(...end, ...p, ...q);
          rims.push(...p, ...q);
        }
        p.addVectors(a, b).setLength(1.12 * radius).add(end);
        labels.put(`${angle.toFixed(1)}\u00b0`, p, "angle");
      }
      sectors.geometry.setAttribute("position", new Float32BufferAttribute(triangles, 3));
      edges.geometry.setAttribute("position", new Float32BufferAttribute(rims, 3));
    },
  };
};
