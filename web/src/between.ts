/** Smooth pictures between the frames of the server: everybody is drawn on the way from one frame to the next. */

import type { Frame } from "./frames";

export class Between {
  newest: Frame | null = null;
  private before: Frame | null = null;
  private arrived = 0;
  private spacing = 1 / 30;
  private readonly indexBefore = new Map<number, number>();
  /** Where everybody is drawn now: as in a frame, and in the order of the newest. */
  places = new Float32Array(0);
  roots = new Float32Array(0);
  rotations = new Float32Array(0);
  /** Draw what was last told at once, less smooth and a frame sooner. */
  direct = false;

  /** A frame has come. Where time runs back or leaps there is nothing between. */
  push(frame: Frame, now: number): void {
    const last = this.newest;
    const leap =
      last === null ||
      last.kind !== frame.kind ||
      last.joints !== frame.joints ||
      frame.number < last.number ||
      Math.abs(frame.time - last.time) > 0.7;
    this.before = leap ? null : last;
    if (!leap && last) this.spacing += (Math.min(0.2, (now - this.arrived) / 1000) - this.spacing) * 0.15;
    this.newest = frame;
    this.arrived = now;
    this.indexBefore.clear();
    if (this.before) this.before.ids.forEach((id, i) => this.indexBefore.set(id, i));
  }

  clear(): void {
    this.newest = this.before = null;
  }

  /** Work out what is drawn at a time of the clock; the share of the way from the last frame to the newest. */
  sample(now: number): number {
    const frame = this.newest;
    if (!frame) return 0;
    const share =
      this.direct || !this.before ? 1 : Math.min(1, (now - this.arrived) / 1000 / Math.max(0.004, this.spacing));
    if (this.places.length !== frame.places.length) this.places = new Float32Array(frame.places.length);
    if (this.roots.length !== frame.roots.length) this.roots = new Float32Array(frame.roots.length);
    if (this.rotations.length !== frame.rotations.length) this.rotations = new Float32Array(frame.rotations.length);
    this.places.set(frame.places);
    this.roots.set(frame.roots);
    this.rotations.set(frame.rotations);
    const before = this.before;
    if (!before || share >= 1) return share;
    for (let i = 0; i < frame.count; i++) {
      const k = this.indexBefore.get(frame.ids[i]!);
      if (k === undefined) continue;
      mix(this.places, before.places, 3 * i, 3 * k, 2, share);
      const turn = before.places[3 * k + 2]! - this.places[3 * i + 2]!;
      this.places[3 * i + 2]! += Math.atan2(Math.sin(turn), Math.cos(turn)) * (1 - share);
      if (i >= frame.full || k >= before.full) continue;
      mix(this.roots, before.roots, 3 * i, 3 * k, 3, share);
      turnBetween(this.rotations, before.rotations, 4 * frame.joints * i, 4 * frame.joints * k, frame.joints, share);
    }
    return share;
  }
}

function mix(out: Float32Array, from: Float32Array, at: number, fromAt: number, width: number, share: number): void {
  for (let c = 0; c < width; c++) out[at + c] = from[fromAt + c]! + (out[at + c]! - from[fromAt + c]!) * share;
}

/** Normalised linear interpolation: neighbours are frames, so the rotations are near each other. */
function turnBetween(
  out: Float32Array,
  from: Float32Array,
  at: number,
  fromAt: number,
  joints: number,
  share: number,
): void {
  for (let j = 0; j < joints; j++) {
    const o = at + 4 * j;
    const f = fromAt + 4 * j;
    const dot =
      out[o]! * from[f]! + out[o + 1]! * from[f + 1]! + out[o + 2]! * from[f + 2]! + out[o + 3]! * from[f + 3]!;
    const keep = dot < 0 ? share - 1 : 1 - share;
    let length = 0;
    for (let c = 0; c < 4; c++) {
      out[o + c] = from[f + c]! * keep + out[o + c]! * share;
      length += out[o + c]! ** 2;
    }
    const scale = 1 / Math.sqrt(length);
    for (let c = 0; c < 4; c++) out[o + c]! *= scale;
  }
}
