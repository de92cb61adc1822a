// The ground: a grid of metres with its scale written, axes, and what lies straight below load and drones.

import { BufferGeometry, CircleGeometry, Color, Float32BufferAttribute, Group, InstancedMesh, LineBasicMaterial, LineSegments, Matrix4, MeshBasicMaterial, Vector3 } from "three";
import type { Maker } from "./element";

const HALF = 6;

function grid(every: number, skip: number): BufferGeometry {
  const points: number[] = [];
  for (let k = -HALF; k <= HALF; k += every) {
    if (skip && Math.abs(k % skip) < 1e-9) continue;
    points.push(k, -HALF, 0, k, HALF, 0, -HALF, k, 0, HALF, k, 0);
  }
  return new BufferGeometry().setAttribute("position", new Float32BufferAttribute(points, 3));
}

export const ground: Maker = (flight, { floor, drone }) => {
  const object = new Group();
  const major = new LineBasicMaterial();
  const minor = new LineBasicMaterial({ transparent: true, opacity: 0.45 });
  const lines = [new LineSegments(grid(1, 0), major), new LineSegments(grid(0.25, 1), minor)];
  lines[1]!.visible = flight.n <= 64;
  const axes = new LineSegments(
    new BufferGeometry().setAttribute("position", new Float32BufferAttribute([0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1, 0], 3)),
    new LineBasicMaterial(),
  );
  axes.position.z = 0.002;
  const shade = new MeshBasicMaterial({ transparent: true, opacity: 0.3, depthWrite: false });
  const spots = new InstancedMesh(new CircleGeometry(1, 28), shade, flight.n + 1);
  spots.frustumCulled = false;
  const plumb = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ transparent: true, opacity: 0.55 }));
  plumb.frustumCulled = false;
  object.add(...lines, axes, spots, plumb);
  object.position.z = floor;

  const matrix = new Matrix4();
  const at = new Vector3();
  return {
    object,
    paint(palette) {
      object.position.z = floor;
      major.color.set(palette.line);
      minor.color.set(palette.ground);
      (axes.material as LineBasicMaterial).color.set(palette.soft);
      (plumb.material as LineBasicMaterial).color.set(palette.soft);
      shade.color.copy(new Color(palette.name === "dark" ? "#000000" : "#41505e"));
    },
    update(frame, shown, labels) {
      for (let i = 0; i <= frame.n; i++) {
        const [source, k, size] = i < frame.n ? [frame.positions, 3 * i, drone] : [frame.load, 0, 0.5 * drone];
        const there = Number.isFinite(source[k]);
        matrix.makeScale(there ? size : 0, there ? size : 0, 1);
        matrix.setPosition(source[k] || 0, source[k + 1] || 0, 0.004);
        spots.setMatrixAt(i, matrix);
      }
      spots.instanceMatrix.needsUpdate = true;
      const [x, y, z] = [frame.load[0]!, frame.load[1]!, frame.load[2]!];
      plumb.geometry.setAttribute("position", new Float32BufferAttribute([x, y, z - floor, x, y, 0], 3));
      plumb.visible = Number.isFinite(x);
      if (!shown.labels) return;
      labels.put("1 m", at.set(1.08, 0, floor), "scale");
      labels.put("x", at.set(0.5, -0.09, floor), "scale");
      labels.put("y", at.set(-0.09, 0.5, floor), "scale");
    },
  };
};
