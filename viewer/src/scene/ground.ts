// The ground: a grid of metres that fades out, on a disc where there is ground; its scale, axes, and shadows of load and drones.

import { BufferGeometry, CircleGeometry, Color, DoubleSide, Float32BufferAttribute, Group, InstancedMesh, LineBasicMaterial, LineSegments, Matrix4, Mesh, MeshBasicMaterial, Vector3 } from "three";
import type { Maker } from "./element";

/** Lines `every` metres around a centre, cut into pieces so that each end has a colour of its own. */
function grid(centre: Vector3, half: number, every: number): number[] {
  const points: number[] = [];
  for (let k = -half; k <= half; k += every) {
    for (let s = -half; s < half; s += 1) {
      points.push(k, s, 0, k, s + 1, 0, s, k, 0, s + 1, k, 0);
    }
  }
  return points.map((value, i) => value + (i % 3 === 0 ? centre.x : i % 3 === 1 ? centre.y : 0));
}

/** Colours of points that go from one at the centre to the other at the rim. */
function fade(points: number[], centre: Vector3, half: number, from: Color, to: Color): number[] {
  const colours: number[] = [];
  const mixed = new Color();
  for (let k = 0; k < points.length; k += 3) {
    const distance = Math.hypot(points[k]! - centre.x, points[k + 1]! - centre.y) / half;
    mixed.copy(from).lerp(to, Math.min(distance, 1));
    colours.push(mixed.r, mixed.g, mixed.b);
  }
  return colours;
}

export const ground: Maker = (flight, { floor, drone, centre: middle, radius }) => {
  const object = new Group();
  const centre = new Vector3(Math.round(middle.x), Math.round(middle.y), 0);
  const half = Math.ceil(radius + 2.5);
  const layers = [
    { every: 0.25, colour: "ground" as const },
    { every: 1, colour: "line" as const },
  ].map(({ every, colour }) => {
    const points = grid(centre, half, every);
    const geometry = new BufferGeometry().setAttribute("position", new Float32BufferAttribute(points, 3));
    const lines = new LineSegments(geometry, new LineBasicMaterial({ vertexColors: true }));
    lines.position.z = 0.001 * every;
    return { points, lines, colour };
  });
  const axes = new LineSegments(
    new BufferGeometry().setAttribute("position", new Float32BufferAttribute([0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1, 0], 3)),
    new LineBasicMaterial(),
  );
  axes.position.z = 0.003;
  const soil = new MeshBasicMaterial({ transparent: true, opacity: 0.5, depthWrite: false, side: DoubleSide });
  const disc = new Mesh(new CircleGeometry(half, 64), soil);
  disc.position.set(centre.x, centre.y, -0.002);
  disc.visible = flight.info.ground !== null;
  const shade = new MeshBasicMaterial({ transparent: true, opacity: 0.22, depthWrite: false });
  const spots = new InstancedMesh(new CircleGeometry(1, 28), shade, flight.n + 1);
  const plumb = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ transparent: true, opacity: 0.55 }));
  spots.frustumCulled = plumb.frustumCulled = false;
  object.add(disc, ...layers.map(({ lines }) => lines), axes, spots, plumb);
  object.position.z = floor;

  const matrix = new Matrix4();
  const at = new Vector3();
  return {
    object,
    paint(palette) {
      const back = new Color(palette.back);
      for (const { points, lines, colour } of layers) {
        const colours = fade(points, centre, half, new Color(palette[colour]), back);
        lines.geometry.setAttribute("color", new Float32BufferAttribute(colours, 3));
      }
      axes.material.color.set(palette.soft);
      plumb.material.color.set(palette.soft);
      shade.color.set(palette.shade);
      soil.color.set(palette.ground);
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
      labels.put("1 m", at.set(1.12, 0, floor), "scale");
      labels.put("x", at.set(0.5, -0.09, floor), "scale");
      labels.put("y", at.set(-0.09, 0.5, floor), "scale");
    },
  };
};
