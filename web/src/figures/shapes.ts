/** Solids of which a mannequin is made: rounded pieces along an axis, in the frame of a joint. */

import { BufferAttribute, BufferGeometry, Color, Matrix4, Quaternion, SphereGeometry, Vector3 } from "three";
import { mergeGeometries } from "three/addons/utils/BufferGeometryUtils.js";

/** A cross-section: how far along (0 to 1), half width, half depth, and a shift of its middle. */
export type Section = readonly [along: number, wide: number, deep: number, shiftWide?: number, shiftDeep?: number];

const ROUND = 20;

/** A closed skin over cross-sections from `a` to `b`; `side` is the direction in which widths are measured. */
export function limb(
  a: Vector3,
  b: Vector3,
  sections: readonly Section[],
  side: Vector3,
  colour: Color,
  round = ROUND,
): BufferGeometry {
  const axis = b.clone().sub(a);
  const length = axis.length();
  axis.normalize();
  const wide = side.clone().addScaledVector(axis, -side.dot(axis)).normalize();
  const deep = new Vector3().crossVectors(wide, axis);
  const first = sections[0]!;
  const last = sections[sections.length - 1]!;
  // rounded ends: a few smaller sections beyond the first and the last
  const cap = (section: Section, way: number): Section[] =>
    [0.98, 0.87, 0.62, 0.3, 0].map((size) => {
      const [along, w, d, sw = 0, sd = 0] = section;
      const beyond = (Math.sqrt(1 - size * size) * Math.min(w, d)) / length;
      return [along + way * beyond, w * size, d * size, sw, sd] as const;
    });
  const all = [...cap(first, -1).reverse(), ...smooth(sections), ...cap(last, 1)];
  const positions: number[] = [];
  const index: number[] = [];
  for (const [along, w, d, sw = 0, sd = 0] of all) {
    for (let k = 0; k < round; k++) {
      const angle = (k / round) * Math.PI * 2;
      const x = Math.cos(angle) * w + sw;
      const z = Math.sin(angle) * d + sd;
      const point = a
        .clone()
        .addScaledVector(axis, along * length)
        .addScaledVector(wide, x)
        .addScaledVector(deep, z);
      positions.push(point.x, point.y, point.z);
    }
  }
  for (let i = 0; i + 1 < all.length; i++) {
    for (let k = 0; k < round; k++) {
      const k2 = (k + 1) % round;
      const p = i * round + k;
      const q = i * round + k2;
      index.push(p, p + round, q, q, p + round, q + round);
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(positions), 3));
  geometry.setIndex(index);
  geometry.computeVertexNormals();
  return painted(geometry, colour);
}

/** More sections between the given ones, along a curve through them. */
function smooth(sections: readonly Section[]): Section[] {
  const full = sections.map(([t, w, d, sw = 0, sd = 0]) => [t, w, d, sw, sd]);
  const out: Section[] = [];
  const steps = 4;
  for (let i = 0; i + 1 < full.length; i++) {
    const p0 = full[Math.max(0, i - 1)]!;
    const p1 = full[i]!;
    const p2 = full[i + 1]!;
    const p3 = full[Math.min(full.length - 1, i + 2)]!;
    for (let s = 0; s < steps; s++) {
      const t = s / steps;
      out.push(
        p1.map((_, k) => {
          const m1 = (p2[k]! - p0[k]!) / 2;
          const m2 = (p3[k]! - p1[k]!) / 2;
          if (k === 0) return p1[k]! + (p2[k]! - p1[k]!) * t;
          return (
            (2 * t ** 3 - 3 * t ** 2 + 1) * p1[k]! +
            (t ** 3 - 2 * t ** 2 + t) * m1 +
            (-2 * t ** 3 + 3 * t ** 2) * p2[k]! +
            (t ** 3 - t ** 2) * m2
          );
        }) as unknown as Section,
      );
    }
  }
  out.push(sections[sections.length - 1]!);
  return out;
}

/** An ellipsoid. */
export function egg(
  centre: Vector3,
  radii: Vector3,
  colour: Color,
  turn = new Quaternion(),
  round = 18,
): BufferGeometry {
  const geometry = new SphereGeometry(1, round, Math.ceil(round * 0.75));
  geometry.applyMatrix4(new Matrix4().compose(centre, turn, radii));
  geometry.deleteAttribute("uv");
  return painted(geometry, colour);
}

function painted(geometry: BufferGeometry, colour: Color): BufferGeometry {
  const count = geometry.attributes.position!.count;
  const colours = new Float32Array(count * 3);
  for (let i = 0; i < count; i++) colours.set([colour.r, colour.g, colour.b], i * 3);
  geometry.setAttribute("color", new BufferAttribute(colours, 3));
  return geometry;
}

export function merged(parts: BufferGeometry[]): BufferGeometry {
  const geometry = mergeGeometries(parts);
  if (!geometry) throw new Error("the pieces of a figure do not fit together");
  return geometry;
}
