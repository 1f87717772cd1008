/** A line on the floor with a width in metres: trails, paths, what is being drawn. Old points fade. */

import { BufferAttribute, BufferGeometry, Color, DoubleSide, Mesh, MeshBasicMaterial } from "three";

export interface RibbonOptions {
  colour: number;
  width: number;
  height: number;
  capacity: number;
  opacity?: number;
  fades?: boolean;
  dashed?: boolean;
}

export class Ribbon {
  readonly mesh: Mesh;
  private readonly points: Float32Array;
  private start = 0;
  private count = 0;
  private readonly positions: Float32Array;
  private readonly colours: Float32Array;
  private readonly geometry = new BufferGeometry();
  private dirty = false;

  constructor(private readonly options: RibbonOptions) {
    const { capacity } = options;
    this.points = new Float32Array(capacity * 2);
    this.positions = new Float32Array(capacity * 6);
    this.colours = new Float32Array(capacity * 8);
    const index: number[] = [];
    for (let i = 0; i + 1 < capacity; i++) {
      if (options.dashed && i % 4 >= 2) continue;
      index.push(2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 2, 2 * i + 1, 2 * i + 3);
    }
    this.geometry.setIndex(index);
    this.geometry.setAttribute("position", new BufferAttribute(this.positions, 3));
    this.geometry.setAttribute("color", new BufferAttribute(this.colours, 4));
    this.geometry.setDrawRange(0, 0);
    this.mesh = new Mesh(
      this.geometry,
      new MeshBasicMaterial({
        vertexColors: true,
        transparent: true,
        depthWrite: false,
        side: DoubleSide,
        toneMapped: false,
        polygonOffset: true,
        polygonOffsetFactor: -1,
      }),
    );
    this.mesh.frustumCulled = false;
    this.mesh.position.y = options.height;
    this.mesh.renderOrder = 5;
  }

  get length(): number {
    return this.count;
  }

  /** One more point; the oldest goes when there is no room. Points nearer than a centimetre replace the last one. */
  add(x: number, z: number): void {
    const { capacity } = this.options;
    if (this.count > 1) {
      const before = (this.start + this.count - 2) % capacity;
      if (Math.hypot(x - this.points[2 * before]!, z - this.points[2 * before + 1]!) < 0.012) this.count--;
    }
    if (this.count === capacity) {
      this.start = (this.start + 1) % capacity;
      this.count--;
    }
    const at = (this.start + this.count) % capacity;
    this.points[2 * at] = x;
    this.points[2 * at + 1] = z;
    this.count++;
    this.dirty = true;
  }

  /** All points at once. */
  set(points: ArrayLike<number>): void {
    this.clear();
    for (let i = 0; i + 1 < points.length; i += 2) this.add(points[i]!, points[i + 1]!);
  }

  clear(): void {
    this.start = this.count = 0;
    this.dirty = true;
  }

  dispose(): void {
    this.geometry.dispose();
    (this.mesh.material as MeshBasicMaterial).dispose();
  }

  /** Bring the picture up to date; cheap when nothing has changed. */
  update(): void {
    if (!this.dirty) return;
    this.dirty = false;
    const { capacity, width, fades = true, opacity = 1 } = this.options;
    const colour = new Color(this.options.colour);
    const half = width / 2;
    const x = (i: number): number => this.points[2 * ((this.start + i) % capacity)]!;
    const z = (i: number): number => this.points[2 * ((this.start + i) % capacity) + 1]!;
    for (let i = 0; i < this.count; i++) {
      const a = Math.max(0, i - 1);
      const b = Math.min(this.count - 1, i + 1);
      let dx = x(b) - x(a);
      let dz = z(b) - z(a);
      const far = Math.hypot(dx, dz) || 1;
      dx /= far;
      dz /= far;
      this.positions.set([x(i) - dz * half, 0, z(i) + dx * half, x(i) + dz * half, 0, z(i) - dx * half], i * 6);
      const age = this.count > 1 ? i / (this.count - 1) : 1;
      const alpha = fades ? opacity * Math.min(1, age * 1.4) : opacity;
      this.colours.set([colour.r, colour.g, colour.b, alpha, colour.r, colour.g, colour.b, alpha], i * 8);
    }
    this.geometry.setDrawRange(0, Math.max(0, this.drawn(this.count - 1)) * 6);
    this.geometry.attributes.position!.needsUpdate = true;
    this.geometry.attributes.color!.needsUpdate = true;
  }

  /** How many of the first quads have triangles. */
  private drawn(quads: number): number {
    if (!this.options.dashed || quads <= 0) return quads;
    return Math.floor(quads / 4) * 2 + Math.min(2, quads % 4);
  }
}
