/** The skeleton of the session and where its joints are in a pose. */

export interface Body {
  readonly names: readonly string[];
  readonly parents: Int32Array;
  /** Places of the joints in their parents' frames, three numbers a joint. */
  readonly offsets: Float32Array;
  readonly roles: Readonly<Record<string, number>>;
  /** Tips of the last bones. */
  readonly ends: readonly { joint: number; offset: readonly [number, number, number] }[];
  /** Height of the root above the floor in the rest pose. */
  readonly standing: number;
}

export interface SkeletonMessage {
  names: readonly string[];
  parents: readonly number[];
  offsets: readonly (readonly number[])[];
  roles: Readonly<Record<string, number>>;
  end_joints: readonly number[];
  end_offsets: readonly (readonly number[])[];
}

export function bodyOf(skeleton: SkeletonMessage): Body {
  const offsets = new Float32Array(skeleton.offsets.flat());
  const parents = Int32Array.from(skeleton.parents);
  const ends = skeleton.end_joints.map((joint, i) => ({
    joint,
    offset: (skeleton.end_offsets[i] ?? [0, 0, 0]) as unknown as [number, number, number],
  }));
  let lowest = 0;
  const heights = new Float32Array(parents.length);
  for (let j = 1; j < parents.length; j++) {
    heights[j] = heights[parents[j]!]! + offsets[3 * j + 1]!;
    lowest = Math.min(lowest, heights[j]!);
  }
  for (const end of ends) lowest = Math.min(lowest, heights[end.joint]! + end.offset[1]);
  return { names: skeleton.names, parents, offsets, roles: skeleton.roles, ends, standing: -lowest };
}

/** Joints of one pose in the world. */
export class Posture {
  readonly places: Float32Array;
  /** `x y z w`, as three keeps them. */
  readonly turns: Float32Array;

  constructor(readonly body: Body) {
    this.places = new Float32Array(body.parents.length * 3);
    this.turns = new Float32Array(body.parents.length * 4);
  }

  /**
   * Work out where everything is.
   *
   * @param root place of the root, from `at` on
   * @param rotations `w x y z` a joint, joint to parent, from `at` on
   * @param scale of the whole body
   */
  set(root: ArrayLike<number>, rootAt: number, rotations: ArrayLike<number>, rotationsAt: number, scale = 1): void {
    const { places, turns } = this;
    const { parents, offsets } = this.body;
    places[0] = root[rootAt]!;
    places[1] = root[rootAt + 1]!;
    places[2] = root[rootAt + 2]!;
    for (let j = 0; j < parents.length; j++) {
      const r = rotationsAt + 4 * j;
      const w = rotations[r]!;
      const x = rotations[r + 1]!;
      const y = rotations[r + 2]!;
      const z = rotations[r + 3]!;
      if (j === 0) {
        turns[0] = x;
        turns[1] = y;
        turns[2] = z;
        turns[3] = w;
        continue;
      }
      const p = parents[j]!;
      const px = turns[4 * p]!;
      const py = turns[4 * p + 1]!;
      const pz = turns[4 * p + 2]!;
      const pw = turns[4 * p + 3]!;
      turns[4 * j] = pw * x + px * w + py * z - pz * y;
      turns[4 * j + 1] = pw * y - px * z + py * w + pz * x;
      turns[4 * j + 2] = pw * z + px * y - py * x + pz * w;
      turns[4 * j + 3] = pw * w - px * x - py * y - pz * z;
      const ox = offsets[3 * j]! * scale;
      const oy = offsets[3 * j + 1]! * scale;
      const oz = offsets[3 * j + 2]! * scale;
      const tx = 2 * (py * oz - pz * oy);
      const ty = 2 * (pz * ox - px * oz);
      const tz = 2 * (px * oy - py * ox);
      places[3 * j] = places[3 * p]! + ox + pw * tx + py * tz - pz * ty;
      places[3 * j + 1] = places[3 * p + 1]! + oy + pw * ty + pz * tx - px * tz;
      places[3 * j + 2] = places[3 * p + 2]! + oz + pw * tz + px * ty - py * tx;
    }
  }
}
