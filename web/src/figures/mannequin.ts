/** A mannequin with the proportions of the session's skeleton: one rounded piece a joint, in the joint's frame. */

import { type BufferGeometry, Color, Quaternion, Vector3 } from "three";
import type { Body } from "./body";
import { egg, limb, merged, type Section } from "./shapes";

const SKIN = new Color(1, 1, 1);
const SEAM = new Color(0.72, 0.7, 0.68);
const SIDE = new Vector3(1, 0, 0);
const BACK = new Vector3(0, 0, -1);

/** A piece of the mannequin and the joint that carries it. */
export interface Piece {
  joint: number;
  geometry: BufferGeometry;
}

export function mannequinOf(body: Body): Piece[] {
  const offset = (joint: number): Vector3 => new Vector3().fromArray(body.offsets, joint * 3);
  const end = (joint: number): Vector3 | null => {
    const found = body.ends.find((tip) => tip.joint === joint);
    return found ? new Vector3(...found.offset) : null;
  };
  const role = (name: string): number | undefined => body.roles[name];
  const leg = ["left_shin", "left_foot"].reduce((sum, name) => {
    const joint = role(name);
    return sum + (joint === undefined ? 0.43 : offset(joint).length());
  }, 0);
  const s = leg / 0.86; // sizes below are of a person with legs of 86 cm
  const size = (sections: Section[]): Section[] =>
    sections.map(([t, w, d, sw = 0, sd = 0]) => [t, w * s, d * s, sw * s, sd * s]);
  const pieces = new Map<number, BufferGeometry[]>();
  const put = (joint: number | undefined, ...parts: BufferGeometry[]): void => {
    if (joint === undefined) return;
    pieces.set(joint, [...(pieces.get(joint) ?? []), ...parts]);
  };
  const v = (x: number, y: number, z: number): Vector3 => new Vector3(x, y, z).multiplyScalar(s);

  // trunk
  const hips = role("hips") ?? 0;
  put(
    hips,
    limb(
      v(0, -0.012, -0.004),
      v(0, 0.085, -0.005),
      size([
        [0, 0.156, 0.104],
        [0.4, 0.152, 0.106],
        [0.75, 0.138, 0.098],
        [1, 0.118, 0.085],
      ]),
      SIDE,
      SKIN,
      28,
    ),
  );
  const trunk = ["spine", "spine1", "chest"].map(role).filter((joint): joint is number => joint !== undefined);
  for (const [i, joint] of trunk.entries()) {
    const next = trunk[i + 1];
    if (next === undefined) continue;
    const w = 0.12 + 0.014 * i;
    put(
      joint,
      limb(
        v(0, -0.012, 0),
        offset(next).add(v(0, 0.012, 0)),
        size([
          [0, w, 0.088],
          [0.5, w + 0.005, 0.093],
          [1, w + 0.012, 0.096],
        ]),
        SIDE,
        SKIN,
        28,
      ),
    );
  }
  const neck = role("neck");
  const chest = role("chest") ?? trunk[trunk.length - 1] ?? hips;
  const neckAt = neck === undefined ? v(0, 0.2, 0) : offset(neck);
  put(
    chest,
    limb(
      v(0, 0, 0.002),
      neckAt.clone().multiplyScalar(0.93),
      size([
        [0, 0.137, 0.098],
        [0.28, 0.158, 0.114, 0, -0.006],
        [0.58, 0.168, 0.112, 0, -0.004],
        [0.84, 0.122, 0.078, 0, 0.006],
        [1, 0.062, 0.052, 0, 0.006],
      ]),
      SIDE,
      SKIN,
      28,
    ),
  );
  const head = role("head");
  if (neck !== undefined) {
    const top = head === undefined ? v(0, 0.1, 0.01) : offset(head);
    put(
      neck,
      limb(
        v(0, -0.035, 0),
        top,
        size([
          [0, 0.056, 0.056],
          [0.5, 0.049, 0.05],
          [1, 0.05, 0.052],
        ]),
        SIDE,
        SEAM,
        18,
      ),
    );
  }
  if (head !== undefined) {
    put(
      head,
      egg(v(0, 0.098, 0.012), v(0.076, 0.114, 0.094), SKIN, new Quaternion(), 28),
      egg(v(0, 0.05, 0.03), v(0.056, 0.07, 0.066), SKIN, new Quaternion(), 22),
    );
  }

  for (const which of ["left", "right"]) {
    const sign = which === "left" ? 1 : -1;
    const at = (name: string): number | undefined => role(`${which}_${name}`);
    const between = (from: string, to: string): Vector3 | null => {
      const a = at(from);
      const b = at(to);
      return a === undefined || b === undefined ? null : offset(b);
    };
    // leg
    const thigh = between("thigh", "shin");
    if (thigh) {
      put(
        at("thigh"),
        limb(
          v(0, 0, 0),
          thigh,
          size([
            [0, 0.082, 0.084],
            [0.25, 0.084, 0.09],
            [0.7, 0.062, 0.068],
            [1, 0.051, 0.053],
          ]),
          SIDE,
          SKIN,
        ),
      );
    }
    const shin = between("shin", "foot");
    if (shin) {
      put(
        at("shin"),
        egg(new Vector3(), v(0.054, 0.056, 0.056), SEAM),
        limb(
          v(0, -0.012, 0),
          shin,
          size([
            [0, 0.048, 0.05],
            [0.27, 0.052, 0.061, 0, 0.009],
            [0.65, 0.039, 0.043, 0, 0.006],
            [1, 0.031, 0.036],
          ]),
          SIDE,
          SKIN,
        ),
      );
    }
    const foot = between("foot", "toe");
    if (foot) {
      const floor = soleOf(body, at("foot")!, at("toe")!);
      const heel = new Vector3(0, floor + 0.036 * s, -0.052 * s);
      const ball = new Vector3(foot.x, floor + 0.026 * s, foot.z);
      put(
        at("foot"),
        egg(new Vector3(), v(0.037, 0.038, 0.038), SEAM),
        limb(
          heel,
          ball,
          size([
            [0, 0.033, 0.035],
            [0.3, 0.036, 0.043, 0, -0.008],
            [0.62, 0.042, 0.037, 0, -0.007],
            [1, 0.046, 0.025],
          ]),
          SIDE,
          SKIN,
        ),
      );
      const toe = at("toe")!;
      const tip = end(toe) ?? v(0, 0, 0.07);
      const length = Math.max(0.03 * s, tip.length() - 0.012 * s);
      const toeFloor = floor - foot.y;
      put(
        toe,
        limb(
          new Vector3(0, toeFloor + 0.025 * s, 0),
          new Vector3(0, toeFloor + 0.018 * s, length),
          size([
            [0, 0.046, 0.024],
            [0.6, 0.044, 0.02],
            [1, 0.032, 0.016],
          ]),
          SIDE,
          SKIN,
        ),
      );
    }
    // arm
    const clavicle = between("shoulder", "upper_arm");
    if (clavicle)
      put(
        at("shoulder"),
        limb(
          clavicle.clone().multiplyScalar(0.1),
          clavicle,
          size([
            [0, 0.05, 0.052],
            [1, 0.05, 0.05],
          ]),
          BACK,
          SKIN,
        ),
      );
    const upper = between("upper_arm", "forearm");
    if (upper) {
      put(
        at("upper_arm"),
        limb(
          upper.clone().multiplyScalar(0.02),
          upper,
          size([
            [0, 0.05, 0.054],
            [0.3, 0.047, 0.05],
            [1, 0.037, 0.039],
          ]),
          BACK,
          SKIN,
        ),
      );
    }
    const fore = between("forearm", "hand");
    if (fore) {
      put(
        at("forearm"),
        egg(new Vector3(), v(0.04, 0.04, 0.04), SEAM),
        limb(
          new Vector3(),
          fore,
          size([
            [0, 0.037, 0.037],
            [0.28, 0.04, 0.039],
            [1, 0.025, 0.022],
          ]),
          BACK,
          SKIN,
        ),
      );
      const along = fore.clone().normalize();
      const turn = new Quaternion().setFromUnitVectors(new Vector3(1, 0, 0).multiplyScalar(sign), along);
      const palm = new Vector3(sign * 0.062, -0.002, 0.004).multiplyScalar(s).applyQuaternion(turn);
      const fingers = new Vector3(sign * 0.125, -0.008, 0.004).multiplyScalar(s).applyQuaternion(turn);
      const thumb = new Vector3(sign * 0.055, -0.006, 0.038).multiplyScalar(s).applyQuaternion(turn);
      put(
        at("hand"),
        egg(new Vector3(), v(0.026, 0.024, 0.026), SEAM, turn),
        egg(palm, v(0.056, 0.019, 0.041), SKIN, turn),
        egg(fingers, v(0.052, 0.014, 0.034), SKIN, turn),
        egg(
          thumb,
          v(0.036, 0.013, 0.015),
          SKIN,
          turn.clone().multiply(new Quaternion().setFromAxisAngle(new Vector3(0, 1, 0), -sign * 0.7)),
        ),
      );
    }
  }
  return [...pieces].map(([joint, parts]) => ({ joint, geometry: merged(parts) }));
}

/** Height of the sole below the ankle in the rest pose. */
function soleOf(body: Body, foot: number, toe: number): number {
  const toeHeight = body.offsets[3 * toe + 1]!;
  const tip = body.ends.find((end) => end.joint === toe)?.offset[1] ?? 0;
  const ankle = heightOf(body, foot) + body.standing;
  return Math.max(-ankle, Math.min(toeHeight, toeHeight + tip) - 0.03);
}

function heightOf(body: Body, joint: number): number {
  let height = 0;
  for (let j = joint; j > 0; j = body.parents[j]!) height += body.offsets[3 * j + 1]!;
  return height;
}
