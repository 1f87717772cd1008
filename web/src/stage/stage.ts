/** The picture: renderer, light, floor, camera, and the loop that draws. */

import {
  Color,
  DirectionalLight,
  Fog,
  HemisphereLight,
  NeutralToneMapping,
  PCFShadowMap,
  PerspectiveCamera,
  Plane,
  Raycaster,
  Scene,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "three";
import { el } from "../ui/dom";
import { Cameras } from "./cameras";
import { Ground } from "./ground";
import { palette } from "./palette";

export type Tick = (seconds: number, now: number) => void;

export interface StageOptions {
  /** Greatest ratio of drawn to shown pixels. */
  ratio: number;
  shadows: boolean;
  /** Least time between two pictures, milliseconds; 0 draws as often as the screen shows. */
  spacing: number;
}

/** A ground point. */
export interface Spot {
  x: number;
  z: number;
}

const FLOOR = new Plane(new Vector3(0, 1, 0), 0);

export class Stage {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(40, 1, 0.1, 400);
  readonly cameras = new Cameras(this.camera);
  readonly canvas: HTMLCanvasElement;
  readonly element: HTMLElement;
  readonly renderer: WebGLRenderer;
  private readonly ground: Ground;
  private readonly sun: DirectionalLight;
  private readonly fill: DirectionalLight;
  private readonly ticks = new Set<Tick>();
  private readonly ray = new Raycaster();
  private readonly pointer = new Vector2();
  private readonly hit = new Vector3();
  private last = performance.now();
  /** Seconds between pictures, smoothed. */
  frameTime = 1 / 60;
  /** Half the width of the lit area in which shadows fall. */
  shadowReach = 9;

  constructor(private readonly options: StageOptions) {
    this.canvas = el("canvas", {
      class: "stage",
      tabindex: 0,
      role: "application",
      "aria-label": "Stage. Keys: see the help, question mark.",
    });
    this.element = el("div", { class: "stage-frame" }, this.canvas);
    this.renderer = new WebGLRenderer({
      canvas: this.canvas,
      antialias: options.ratio >= 1,
      powerPreference: "high-performance",
    });
    this.renderer.toneMapping = NeutralToneMapping;
    this.renderer.toneMappingExposure = 1.0;
    this.renderer.shadowMap.enabled = options.shadows;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.scene.background = new Color(palette.sky);
    this.scene.fog = new Fog(palette.sky, 22, 95);
    this.scene.add(new HemisphereLight(0xffffff, 0xd6d3ce, 1.75));
    this.sun = new DirectionalLight(0xfff6ea, 1.9);
    this.sun.castShadow = options.shadows;
    this.sun.shadow.mapSize.setScalar(options.ratio < 1 ? 512 : 2048);
    this.sun.shadow.radius = 4;
    this.sun.shadow.bias = -0.0004;
    this.sun.shadow.camera.near = 1;
    this.sun.shadow.camera.far = 120;
    this.scene.add(this.sun, this.sun.target);
    // a little light from where one looks, so that nobody is a dark shape
    this.fill = new DirectionalLight(0xffffff, 0.85);
    this.scene.add(this.fill, this.fill.target);
    this.ground = new Ground(this.scene);
    new ResizeObserver(() => this.resize()).observe(this.element);
  }

  /** Begin to draw. */
  run(): void {
    this.resize();
    this.cameras.jump();
    this.renderer.setAnimationLoop((now) => this.draw(now));
  }

  onTick(tick: Tick): () => void {
    this.ticks.add(tick);
    return () => this.ticks.delete(tick);
  }

  setShadows(on: boolean): void {
    this.sun.castShadow = on;
  }

  setRatio(ratio: number): void {
    this.options.ratio = ratio;
    this.resize();
  }

  /** How far mist hides the ground; a crowd seen from afar wants more. */
  setReach(metres: number): void {
    const fog = this.scene.fog as Fog;
    fog.near = metres * 0.25;
    fog.far = metres;
    this.camera.far = metres * 1.5 + 40;
    this.camera.updateProjectionMatrix();
  }

  /** Where on the floor a place of the window lies; nothing above the horizon. `within` metres of `from` at most. */
  spotAt(clientX: number, clientY: number, from?: Spot, within = Infinity): Spot | null {
    const box = this.canvas.getBoundingClientRect();
    this.pointer.set(((clientX - box.left) / box.width) * 2 - 1, 1 - ((clientY - box.top) / box.height) * 2);
    this.ray.setFromCamera(this.pointer, this.camera);
    const { origin, direction } = this.ray.ray;
    if (!this.ray.ray.intersectPlane(FLOOR, this.hit)) {
      if (!from) return null;
      // above the horizon: far away in that direction
      this.hit.set(origin.x + direction.x * 1e4, 0, origin.z + direction.z * 1e4);
    }
    if (!from) return { x: this.hit.x, z: this.hit.z };
    const dx = this.hit.x - from.x;
    const dz = this.hit.z - from.z;
    const far = Math.hypot(dx, dz);
    const scale = far > within ? within / far : 1;
    return { x: from.x + dx * scale, z: from.z + dz * scale };
  }

  /** Where in the window a place of the world is seen. */
  seenAt(x: number, y: number, z: number): { left: number; top: number; front: boolean } {
    this.hit.set(x, y, z).project(this.camera);
    const box = this.canvas.getBoundingClientRect();
    return {
      left: box.left + ((this.hit.x + 1) / 2) * box.width,
      top: box.top + ((1 - this.hit.y) / 2) * box.height,
      front: this.hit.z < 1,
    };
  }

  private resize(): void {
    const width = Math.max(1, this.element.clientWidth);
    const height = Math.max(1, this.element.clientHeight);
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, this.options.ratio));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }

  private draw(now: number): void {
    if (now - this.last < this.options.spacing) return;
    const seconds = Math.min(0.5, Math.max(0, (now - this.last) / 1000));
    this.frameTime += (Math.min(1, (now - this.last) / 1000) - this.frameTime) * 0.08;
    this.last = now;
    for (const tick of this.ticks) tick(seconds, now);
    this.cameras.update(seconds);
    this.ground.centre(this.cameras.target);
    this.light();
    this.renderer.render(this.scene, this.camera);
  }

  /** The sun's shadows fall about what is looked at, sharper the nearer it is. */
  private light(): void {
    const reach = this.shadowReach;
    const shadow = this.sun.shadow.camera;
    if (shadow.right !== reach) {
      shadow.left = shadow.bottom = -reach;
      shadow.right = shadow.top = reach;
      shadow.updateProjectionMatrix();
    }
    const texel = (2 * reach) / this.sun.shadow.mapSize.x; // whole texels, or the edges would crawl
    const x = Math.round(this.cameras.target.x / texel) * texel;
    const z = Math.round(this.cameras.target.z / texel) * texel;
    this.sun.target.position.set(x, 0, z);
    this.sun.position.set(x + 15, 32, z - 13);
    this.fill.position.copy(this.camera.position);
    this.fill.target.position.copy(this.cameras.target);
  }
}
