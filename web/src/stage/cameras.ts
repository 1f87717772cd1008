/** Where one looks from: along with somebody, from anywhere around, or from above. */

import { type PerspectiveCamera, Vector3 } from "three";

export type View = "follow" | "orbit" | "top";

interface Eye {
  yaw: number;
  pitch: number;
  distance: number;
}

const LOWEST = 0.06;
const HIGHEST = Math.PI / 2 - 0.02;
const NEAREST = 1.5;
const FARTHEST = 160;

export class Cameras {
  view: View = "follow";
  private readonly eyes: Record<View, Eye> = {
    follow: { yaw: Math.PI, pitch: 0.36, distance: 5.6 },
    orbit: { yaw: Math.PI * 0.8, pitch: 0.5, distance: 9 },
    top: { yaw: Math.PI, pitch: HIGHEST, distance: 15 },
  };
  /** What is looked at, and what is wanted to be looked at. */
  readonly target = new Vector3(0, 0.9, 0);
  private readonly wanted = new Vector3(0, 0.9, 0);
  private readonly shown: Eye = { ...this.eyes.follow };
  private readonly place = new Vector3();

  constructor(private readonly camera: PerspectiveCamera) {}

  /** Take another view, from as far away if `sameDistance`. */
  set(view: View, sameDistance = false): void {
    const { distance } = this.eye;
    this.view = view;
    if (sameDistance) this.eye_().distance = distance;
  }

  get eye(): Readonly<Eye> {
    return this.eyes[this.view];
  }

  /** Somebody to go along with (not in the orbit view, which rests). */
  follow(x: number, y: number, z: number): void {
    if (this.view !== "orbit") this.wanted.set(x, y, z);
  }

  /** The orbit view rests until somebody has gone too far off; then it looks there. */
  keepNear(x: number, z: number, metres: number): void {
    if (this.view === "orbit" && Math.hypot(x - this.wanted.x, z - this.wanted.z) > metres) this.wanted.set(x, 0.85, z);
  }

  /** Look at a place from now on. */
  lookAt(x: number, z: number, distance?: number): void {
    this.wanted.set(x, 0.5, z);
    if (distance !== undefined) this.eye_().distance = clamp(distance, NEAREST, FARTHEST);
  }

  /** Be there at once instead of gliding. */
  jump(): void {
    this.target.copy(this.wanted);
    Object.assign(this.shown, this.eye);
  }

  rotate(dx: number, dy: number): void {
    const eye = this.eye_();
    eye.yaw -= dx;
    if (this.view !== "top") eye.pitch = clamp(eye.pitch + dy, LOWEST, HIGHEST);
  }

  zoom(factor: number): void {
    const eye = this.eye_();
    eye.distance = clamp(eye.distance * factor, NEAREST, FARTHEST);
  }

  /** Shift what is looked at along the floor, in parts of the picture's height. */
  pan(right: number, up: number): void {
    const scale = this.shown.distance * 0.83;
    const yaw = this.shown.yaw;
    this.wanted.x += (-Math.cos(yaw) * -right + -Math.sin(yaw) * up) * scale;
    this.wanted.z += (Math.sin(yaw) * -right + -Math.cos(yaw) * up) * scale;
  }

  /** Direction on the floor that leads up the picture, as a heading. */
  get ahead(): number {
    return Math.atan2(-Math.sin(this.shown.yaw), -Math.cos(this.shown.yaw));
  }

  private eye_(): Eye {
    return this.eyes[this.view];
  }

  update(seconds: number): void {
    const eye = this.eye;
    const soft = 1 - Math.exp(-seconds * 9);
    const along = 1 - Math.exp(-seconds * 7);
    this.target.lerp(this.wanted, this.view === "follow" ? along : soft);
    const turn = Math.atan2(Math.sin(eye.yaw - this.shown.yaw), Math.cos(eye.yaw - this.shown.yaw));
    this.shown.yaw += turn * soft;
    this.shown.pitch += (eye.pitch - this.shown.pitch) * soft;
    this.shown.distance *= Math.pow(eye.distance / this.shown.distance, soft);
    const { yaw, pitch, distance } = this.shown;
    const level = Math.cos(pitch) * distance;
    this.place.set(Math.sin(yaw) * level, Math.sin(pitch) * distance, Math.cos(yaw) * level).add(this.target);
    this.camera.position.copy(this.place);
    this.camera.lookAt(this.target);
  }
}

function clamp(value: number, least: number, most: number): number {
  return Math.min(most, Math.max(least, value));
}
