/** What hand and fingers wish: mouse, pen, keys, gamepad. Whoever acted last steers. */

import type { Wish } from "./wish";
import type { Spot, Stage } from "../../stage/stage";

export type Hand = "mouse" | "target" | "drawing" | "curve" | "keys" | "pad" | "rest";

/** Shortest time between two messages of one kind; the server takes 240 a second. */
const SPACING = 5;
/** A press that rests so long places a target. */
const HOLD = 320;
const MOVED = 6;
/** As far from the walker as the mouse may lead. */
const REACH = 12;
const DEAD_ZONE = 0.16;
/** Pull of a stick that is pushed over, m/s2. */
const PULL = 3.2;

const KEYS: Record<string, readonly [number, number]> = {
  KeyW: [0, 1],
  ArrowUp: [0, 1],
  KeyS: [0, -1],
  ArrowDown: [0, -1],
  KeyA: [-1, 0],
  ArrowLeft: [-1, 0],
  KeyD: [1, 0],
  ArrowRight: [1, 0],
};

export interface SteeringEvents {
  wish(wish: Wish, at: number): void;
  hand(hand: Hand): void;
  drawing(points: readonly Spot[]): void;
  target(spot: Spot | null): void;
  padButton(button: number): void;
}

export class Steering {
  hand: Hand = "rest";
  /** Where the walker is, to measure from. */
  walker: Spot = { x: 0, z: 0 };
  /** Whether a drawn line is kept to exactly, or a point runs along it. */
  exact = true;
  private active = false;
  private hovering: { x: number; y: number } | null = null;
  private readonly down = new Set<string>();
  private drawn: Spot[] = [];
  private press: { x: number; y: number; at: number; id: number } | null = null;
  private turning: { x: number; y: number; id: number; pan: boolean } | null = null;
  private sentAt = 0;
  private sentPoint: Spot | null = null;
  private waiting: { spot: Spot; at: number } | null = null;
  private padActive = false;
  private padButtons: boolean[] = [];
  private drive = "";

  constructor(
    private readonly stage: Stage,
    private readonly events: SteeringEvents,
  ) {
    const canvas = stage.canvas;
    // raw updates come at the rate of the mouse, not of the screen
    const moves = "onpointerrawupdate" in canvas ? "pointerrawupdate" : "pointermove";
    canvas.addEventListener(moves, (event) => this.moved(event as PointerEvent));
    canvas.addEventListener("pointerdown", (event) => this.pressed(event));
    addEventListener("pointerup", (event) => this.released(event));
    addEventListener("pointercancel", (event) => this.released(event));
    canvas.addEventListener("pointerleave", () => (this.hovering = null));
    canvas.addEventListener("contextmenu", (event) => this.active && event.preventDefault());
    // whoever leaves the page lets go of all keys
    addEventListener("blur", () => this.letGo());
    document.addEventListener("visibilitychange", () => document.hidden && this.letGo());
  }

  enter(): void {
    this.active = true;
  }

  leave(): void {
    this.letGo();
    this.active = false;
    this.press = this.turning = null;
  }

  /** Forget what was wished, as after a new connection; keys that are held count again. */
  renew(): void {
    this.sentPoint = null;
    this.drive = "";
    if (this.down.size) this.sendKeys();
    else if (this.hand !== "mouse") this.take("rest");
  }

  /** Give up target, line and keys. */
  free(): void {
    this.events.target(null);
    this.events.drawing([]);
    this.take("rest");
    this.events.wish({ kind: "rest" }, performance.now());
  }

  /** The line that was drawn is at its end. */
  arrived(): void {
    if (this.hand === "curve") this.take("rest");
  }

  private take(hand: Hand): void {
    if (this.hand === hand) return;
    this.hand = hand;
    this.events.hand(hand);
  }

  // pointer

  private spot(event: { clientX: number; clientY: number }): Spot | null {
    return this.stage.spotAt(event.clientX, event.clientY, this.walker, REACH);
  }

  private moved(event: PointerEvent): void {
    if (!this.active) return;
    if (this.turning && event.pointerId === this.turning.id) {
      const dx = event.clientX - this.turning.x;
      const dy = event.clientY - this.turning.y;
      Object.assign(this.turning, { x: event.clientX, y: event.clientY });
      if (this.turning.pan)
        this.stage.cameras.pan(-dx / this.stage.canvas.clientHeight, dy / this.stage.canvas.clientHeight);
      else this.stage.cameras.rotate(dx * 0.006, dy * 0.006);
      return;
    }
    const samples = event.getCoalescedEvents?.() ?? [];
    const all = samples.length ? samples : [event];
    const last = all[all.length - 1]!;
    this.hovering = { x: last.clientX, y: last.clientY };
    if (this.press && event.pointerId === this.press.id) {
      if (this.hand !== "drawing" && Math.hypot(last.clientX - this.press.x, last.clientY - this.press.y) > MOVED) {
        const first = this.stage.spotAt(this.press.x, this.press.y);
        this.drawn = first ? [first] : [];
        this.events.target(null);
        this.take("drawing");
      }
      if (this.hand === "drawing") {
        for (const sample of all) this.draw(this.stage.spotAt(sample.clientX, sample.clientY));
        this.events.drawing(this.drawn);
      }
      return;
    }
    if (this.hand === "target" || this.hand === "curve") return; // until a click or Esc frees it
    const spot = this.spot(last);
    if (spot) this.point(spot, last.timeStamp || performance.now());
  }

  private draw(spot: Spot | null): void {
    const last = this.drawn[this.drawn.length - 1];
    if (spot && (!last || Math.hypot(spot.x - last.x, spot.z - last.z) > 0.05)) this.drawn.push(spot);
  }

  private pressed(event: PointerEvent): void {
    if (!this.active) return;
    this.stage.canvas.focus({ preventScroll: true });
    if (event.button === 2 || event.button === 1) {
      this.turning = {
        x: event.clientX,
        y: event.clientY,
        id: event.pointerId,
        pan: event.button === 1 || event.shiftKey,
      };
      this.stage.canvas.setPointerCapture(event.pointerId);
      event.preventDefault();
      return;
    }
    if (event.button !== 0) return;
    this.press = { x: event.clientX, y: event.clientY, at: performance.now(), id: event.pointerId };
    this.stage.canvas.setPointerCapture(event.pointerId);
  }

  private released(event: PointerEvent): void {
    if (this.turning?.id === event.pointerId) this.turning = null;
    if (this.press?.id !== event.pointerId) return;
    this.press = null;
    if (!this.active) return;
    if (this.hand === "drawing") {
      const points = this.drawn.map((spot) => [spot.x, spot.z] as [number, number]);
      if (points.length >= 2) {
        this.take("curve");
        this.events.wish({ kind: this.exact ? "path" : "curve", points }, performance.now());
      } else this.take("rest");
      this.events.drawing([]);
    } else if (this.hand === "curve" || (this.hand === "target" && !this.placed)) {
      // a click gives the mouse its hold back
      this.events.target(null);
      this.take("mouse");
      const spot = this.spot(event);
      if (spot) this.point(spot, event.timeStamp);
    }
    this.placed = false;
  }

  private placed = false;

  private point(spot: Spot, at: number): void {
    this.take("mouse");
    this.waiting = { spot, at };
    this.flush(performance.now());
  }

  private flush(now: number): void {
    if (!this.waiting || now - this.sentAt < SPACING) return;
    const { spot, at } = this.waiting;
    this.waiting = null;
    if (this.sentPoint && Math.hypot(spot.x - this.sentPoint.x, spot.z - this.sentPoint.z) < 1e-3) return;
    this.sentAt = now;
    this.sentPoint = spot;
    this.events.wish({ kind: "point", point: [spot.x, spot.z] }, at);
  }

  // keys

  key(event: KeyboardEvent): boolean {
    if (!(event.code in KEYS) || event.ctrlKey || event.metaKey || event.altKey) return false;
    if (!this.down.has(event.code)) {
      this.down.add(event.code);
      this.events.target(null);
      this.take("keys");
      this.sendKeys();
    }
    return true;
  }

  keyUp(event: KeyboardEvent): void {
    if (this.down.delete(event.code)) this.sendKeys();
  }

  private letGo(): void {
    if (!this.down.size) return;
    this.down.clear();
    this.sendKeys();
  }

  /** What the held keys mean, seen from the camera. */
  private sendKeys(): void {
    let right = 0;
    let up = 0;
    for (const code of this.down) {
      right += KEYS[code]![0];
      up += KEYS[code]![1];
    }
    const length = Math.hypot(right, up);
    const direction: [number, number] = length ? this.fromCamera(right / length, up / length) : [0, 0];
    const words = direction.map((x) => x.toFixed(3)).join();
    if (words === this.drive && this.down.size) return;
    this.drive = words;
    this.sentPoint = null;
    this.events.wish({ kind: "drive", direction }, performance.now());
  }

  private fromCamera(right: number, up: number): [number, number] {
    const ahead = this.stage.cameras.ahead;
    const clip = (x: number): number => Math.min(1, Math.max(-1, x));
    // the left of who looks along a heading is (cos, -sin); the right its opposite
    return [clip(Math.sin(ahead) * up - Math.cos(ahead) * right), clip(Math.cos(ahead) * up + Math.sin(ahead) * right)];
  }

  // before each picture

  tick(now: number): void {
    if (!this.active) return;
    if (this.press && this.hand !== "drawing" && this.hand !== "target" && now - this.press.at > HOLD) {
      const spot = this.stage.spotAt(this.press.x, this.press.y);
      if (spot) {
        this.take("target");
        this.placed = true;
        this.events.target(spot);
        this.events.wish({ kind: "point", point: [spot.x, spot.z] }, now);
      }
    }
    if (this.hand === "mouse" && this.hovering && !this.press) {
      // the camera moves on, so what lies below a resting mouse does
      const spot = this.stage.spotAt(this.hovering.x, this.hovering.y, this.walker, REACH);
      if (spot) this.waiting ??= { spot, at: now };
    }
    this.flush(now);
    if (this.hand === "keys" && this.down.size) this.sendKeys();
    this.pad(now);
  }

  private pad(now: number): void {
    const pad = navigator.getGamepads?.().find((found) => found?.connected);
    if (!pad) return;
    const [x = 0, y = 0, turnX = 0, turnY = 0] = pad.axes;
    const push = Math.hypot(x, y);
    if (push > DEAD_ZONE) {
      if (now - this.sentAt >= 16) {
        const strength = Math.min(1, (push - DEAD_ZONE) / (1 - DEAD_ZONE)) * PULL;
        const [fx, fz] = this.fromCamera(x / push, -y / push);
        this.sentAt = now;
        this.take("pad");
        this.events.target(null);
        this.events.wish({ kind: "force", frame: "world", force: [fx * strength, fz * strength] }, now);
      }
      this.padActive = true;
    } else if (this.padActive) {
      this.padActive = false;
      this.take("rest");
      this.events.wish({ kind: "rest" }, now);
    }
    if (Math.hypot(turnX, turnY) > DEAD_ZONE) this.stage.cameras.rotate(turnX * 0.045, turnY * 0.03);
    pad.buttons.forEach((button, i) => {
      if (button.pressed && !this.padButtons[i]) this.events.padButton(i);
      this.padButtons[i] = button.pressed;
    });
  }
}
