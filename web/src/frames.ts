/** Binary frames of the server, decoded into typed arrays (docs/protocol.md, "Binary frames"). */

import {
  ALIGNMENT,
  ARRAYS,
  HEADER,
  HEADER_BYTES,
  LEVELS,
  PLAYING,
  REPLAYED,
  STEERING,
  WALK,
  WALK_ARRAYS,
} from "./protocol";

type Steering = Record<(typeof STEERING)[number], number>;
type Playing = Record<(typeof PLAYING)[number], number>;

/** What one frame shows. */
export interface Frame {
  kind: number;
  replayed: boolean;
  number: number;
  time: number;
  /** Time stamp of the newest input that this frame has used; 0 for none. */
  echo: number;
  count: number;
  full: number;
  joints: number;
  ids: Uint32Array;
  /** x, z, heading a figure. */
  places: Float32Array;
  speeds: Float32Array;
  rules: Uint8Array;
  /** Of the first `full` figures: x, y, z. */
  roots: Float32Array;
  /** `w x y z` a joint and figure. */
  rotations: Float32Array;
  planted: Uint8Array;
  movers: Float32Array;
  steering: Steering | null;
  playing: Playing | null;
}

/** Thrown when bytes are no frame. */
export class FrameError extends Error {}

const QUOTIENTS = Float32Array.from({ length: 2 * LEVELS + 2 }, (_, v) =>
  Math.tan(((v - LEVELS) * Math.PI) / (4 * LEVELS)),
);

const SIZES: Record<string, number> = { u1: 1, u2: 2, u4: 4, f4: 4 };

export function decode(buffer: ArrayBuffer): Frame {
  if (buffer.byteLength < HEADER_BYTES) throw new FrameError(`${buffer.byteLength} bytes are less than a header`);
  const view = new DataView(buffer);
  const header = {
    kind: view.getUint8(HEADER.kind[1]),
    flags: view.getUint8(HEADER.flags[1]),
    count: view.getUint16(HEADER.count[1], true),
    frame: view.getUint32(HEADER.frame[1], true),
    time: view.getFloat64(HEADER.time[1], true),
    echo: view.getFloat64(HEADER.echo[1], true),
    full: view.getUint16(HEADER.full[1], true),
    joints: view.getUint16(HEADER.joints[1], true),
    movers: view.getUint16(HEADER.movers[1], true),
  };
  const rows: Record<string, number> = { count: header.count, full: header.full, movers: header.movers, "1": 1 };
  const found = new Map<string, { at: number; length: number }>();
  let at: number = HEADER_BYTES;
  for (const column of [...ARRAYS, ...(header.kind === WALK ? WALK_ARRAYS : [])]) {
    const length = rows[column.rows]! * column.width * (column.joints ? header.joints : 1);
    found.set(column.name, { at, length });
    at += Math.ceil((length * SIZES[column.kind]!) / ALIGNMENT) * ALIGNMENT;
  }
  if (at !== buffer.byteLength) throw new FrameError(`a frame of this kind has ${at} bytes, not ${buffer.byteLength}`);
  const part = (name: string): { at: number; length: number } => found.get(name)!;
  const floats = (name: string): Float32Array => new Float32Array(buffer, part(name).at, part(name).length);
  const bytes = (name: string): Uint8Array => new Uint8Array(buffer, part(name).at, part(name).length);
  const words = (name: string): Uint32Array => new Uint32Array(buffer, part(name).at, part(name).length);
  const packed = part("rotations");
  return {
    kind: header.kind,
    replayed: (header.flags & REPLAYED) !== 0,
    number: header.frame,
    time: header.time,
    echo: header.echo,
    count: header.count,
    full: header.full,
    joints: header.joints,
    ids: words("ids"),
    places: floats("places"),
    speeds: floats("speeds"),
    rules: bytes("rules"),
    roots: floats("roots"),
    rotations: unpack(new Uint16Array(buffer, packed.at, packed.length)),
    planted: bytes("planted"),
    movers: floats("movers"),
    steering: header.kind === WALK ? (named(STEERING, floats("steering")) as Steering) : null,
    playing: header.kind === WALK ? (named(PLAYING, words("playing")) as Playing) : null,
  };
}

/** Three numbers a rotation to four: the greatest component is 1 before they are made unit length. */
export function unpack(packed: Uint16Array): Float32Array {
  const count = packed.length / 3;
  const out = new Float32Array(count * 4);
  for (let i = 0; i < count; i++) {
    const a = packed[3 * i]!;
    const b = packed[3 * i + 1]!;
    const c = packed[3 * i + 2]!;
    const greatest = ((a >> 15) << 1) | (b >> 15);
    const x = QUOTIENTS[a & 0x7fff]!;
    const y = QUOTIENTS[b & 0x7fff]!;
    const z = QUOTIENTS[c & 0x7fff]!;
    const scale = 1 / Math.sqrt(1 + x * x + y * y + z * z);
    let o = 4 * i;
    out[o + greatest] = scale;
    if (greatest === 0) o++;
    out[o++] = x * scale;
    if (greatest === 1) o++;
    out[o++] = y * scale;
    if (greatest === 2) o++;
    out[o] = z * scale;
  }
  return out;
}

function named(names: readonly string[], values: ArrayLike<number>): Record<string, number> {
  return Object.fromEntries(names.map((name, i) => [name, values[i]!]));
}
