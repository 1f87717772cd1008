import { describe, expect, it } from "vitest";
import { decode, FrameError, unpack } from "../src/frames";
import { HEADER_BYTES, LEVELS } from "../src/protocol";

/** The packing of docs/protocol.md, written down once more. */
function pack(q: readonly number[]): number[] {
  const greatest = q.reduce((best, x, i) => (Math.abs(x) > Math.abs(q[best]!) ? i : best), 0);
  const rest = q
    .filter((_, i) => i !== greatest)
    .map((x) => Math.round((Math.atan(x / q[greatest]!) * 4 * LEVELS) / Math.PI) + LEVELS);
  return [rest[0]! | ((greatest >> 1) << 15), rest[1]! | ((greatest & 1) << 15), rest[2]!];
}

describe("rotations", () => {
  it("come back within a ten-thousandth of a radian, whichever component is greatest", () => {
    let seed = 1;
    const random = (): number => {
      seed = (seed * 48271) % 2147483647;
      return (seed / 2147483647) * 2 - 1;
    };
    for (let i = 0; i < 2000; i++) {
      const raw = [random(), random(), random(), random()];
      const length = Math.hypot(...raw);
      const q = raw.map((x) => x / length);
      const back = unpack(Uint16Array.from(pack(q)));
      const dot = Math.abs(q.reduce((sum, x, k) => sum + x * back[k]!, 0));
      expect(2 * Math.acos(Math.min(1, dot))).toBeLessThan(2e-3); // float32 of an angle near 0
      const apart = Math.min(
        Math.hypot(...q.map((x, k) => x - back[k]!)),
        Math.hypot(...q.map((x, k) => x + back[k]!)),
      );
      expect(2 * apart).toBeLessThan(1e-4);
    }
  });
});

describe("frames", () => {
  it("are refused when they are too short or too long", () => {
    expect(() => decode(new ArrayBuffer(8))).toThrow(FrameError);
    expect(() => decode(new ArrayBuffer(HEADER_BYTES + 4))).toThrow(FrameError);
  });

  it("say what stands in them", () => {
    const buffer = new ArrayBuffer(HEADER_BYTES + 4 + 12 + 4 + 4 + 12 + 8 + 4);
    const view = new DataView(buffer);
    view.setUint8(0, 2);
    view.setUint8(1, 1);
    view.setUint16(2, 1, true);
    view.setUint32(4, 77, true);
    view.setFloat64(8, 2.5, true);
    view.setUint16(24, 1, true);
    view.setUint16(26, 1, true);
    let at = HEADER_BYTES;
    view.setUint32(at, 9, true);
    at += 4;
    [1, 2, 3].forEach((x, i) => view.setFloat32(at + 4 * i, x, true));
    at += 12;
    view.setFloat32(at, 1.5, true);
    view.setUint8(at + 4, 4);
    at += 8;
    [4, 5, 6].forEach((x, i) => view.setFloat32(at + 4 * i, x, true));
    at += 12;
    pack([1, 0, 0, 0]).forEach((x, i) => view.setUint16(at + 2 * i, x, true));
    view.setUint8(at + 8, 3);
    const frame = decode(buffer);
    expect(frame).toMatchObject({ kind: 2, replayed: true, number: 77, time: 2.5, count: 1, full: 1, steering: null });
    expect([...frame.ids, ...frame.places, ...frame.speeds, ...frame.rules, ...frame.roots]).toEqual([
      9, 1, 2, 3, 1.5, 4, 4, 5, 6,
    ]);
    expect([...frame.rotations]).toEqual([1, 0, 0, 0]);
    expect([...frame.planted]).toEqual([3]);
  });
});
