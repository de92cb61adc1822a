// The load, and where it should be: a point as a stone and a ring, a rigid load as a box and its edges, with a knob where a cable ends.

import {
  BoxGeometry,
  EdgesGeometry,
  Group,
  IcosahedronGeometry,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  MeshLambertMaterial,
  SphereGeometry,
  TorusGeometry,
} from "three";
import type { Maker } from "./element";

/** Thinnest edge of a box that can be seen, over the size of a drone. */
const THIN = 0.06;

export const load: Maker = (flight, { drone }) => {
  const object = new Group();
  const rigid = flight.info.body;
  const [x, y, z] = (rigid?.size ?? [0, 0, 0]).map((edge) => Math.max(edge, THIN * drone)) as [number, number, number];
  const stone = new MeshLambertMaterial({ flatShading: true });
  const body = new Mesh(rigid ? new BoxGeometry(x, y, z) : new IcosahedronGeometry(0.42 * drone, 1), stone);
  const wanted = rigid
    ? new LineSegments(new EdgesGeometry(new BoxGeometry(x, y, z)), new LineBasicMaterial())
    : new Mesh(new TorusGeometry(0.62 * drone, 0.035 * drone, 6, 40), new MeshBasicMaterial());
  const hooks = new MeshBasicMaterial();
  for (const place of rigid?.attachments ?? []) {
    const hook = new Mesh(new SphereGeometry(0.11 * drone, 12, 8), hooks);
    hook.position.fromArray(place);
    body.add(hook);
  }
  object.add(body, wanted);
  return {
    object,
    paint(palette) {
      body.material.color.set(palette.load);
      hooks.color.set(palette.ink);
      wanted.material.color.set(palette.reference);
    },
    update(frame, shown) {
      body.position.fromArray(frame.load);
      body.visible = Number.isFinite(frame.load[0]);
      wanted.position.fromArray(frame.reference);
      wanted.visible = shown.paths && Number.isFinite(frame.reference[0]);
      if (!rigid) return;
      const [w, a, b, c] = frame.load_attitude as unknown as [number, number, number, number];
      body.quaternion.set(a, b, c, w);
      const [wd, ad, bd, cd] = frame.reference_attitude as unknown as [number, number, number, number];
      wanted.quaternion.set(ad, bd, cd, wd);
    },
  };
};
