/** Who of the crowd is under the mouse. */

import type { Between } from "../../between";
import type { Stage } from "../../stage/stage";

/** How wide a person is, metres. */
const BODY = 0.45;

/** Who is seen at a place of the window. */
export function personAt(stage: Stage, between: Between, clientX: number, clientY: number): number | null {
  const frame = between.newest;
  if (!frame || frame.kind !== 2) return null;
  let best: number | null = null;
  let least = Infinity;
  for (let i = 0; i < frame.count; i++) {
    const x = between.places[3 * i]!;
    const z = between.places[3 * i + 1]!;
    const feet = stage.seenAt(x, 0, z);
    const head = stage.seenAt(x, 1.7, z);
    if (!feet.front) continue;
    const tall = Math.hypot(head.left - feet.left, head.top - feet.top);
    const wide = Math.max(7, (tall / 1.7) * BODY);
    const t = tall
      ? ((clientX - feet.left) * (head.left - feet.left) + (clientY - feet.top) * (head.top - feet.top)) / tall ** 2
      : 0;
    const on = Math.min(1, Math.max(0, t));
    const off =
      Math.hypot(clientX - feet.left - on * (head.left - feet.left), clientY - feet.top - on * (head.top - feet.top)) /
      wide;
    if (off < 1 && off < least) {
      least = off;
      best = frame.ids[i]!;
    }
  }
  return best;
}
