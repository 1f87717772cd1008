/** The scene on the stage: roads, obstacles, walls, where people start and go, and what is chosen. */

import {
  BufferAttribute,
  BufferGeometry,
  CircleGeometry,
  CylinderGeometry,
  DoubleSide,
  ExtrudeGeometry,
  Group,
  InstancedMesh,
  type Material,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
  Object3D,
  RingGeometry,
  Shape,
  ShapeGeometry,
} from "three";
import type { ScenePart } from "../../protocol";
import { palette } from "../../stage/palette";
import {
  type Area,
  goalsOf,
  handlesOf,
  isCircle,
  isPoint,
  listOf,
  type Point,
  pointsOf,
  type Ref,
  same,
} from "./document";

const OBSTACLE_HEIGHT = 0.9;
const WALL_HEIGHT = 1.1;

const flat = (colour: number, opacity = 1): MeshBasicMaterial =>
  new MeshBasicMaterial({
    color: colour,
    transparent: opacity < 1,
    opacity,
    depthWrite: false,
    side: DoubleSide,
    toneMapped: false,
  });

const materials = {
  edge: flat(palette.roadEdge),
  road: flat(palette.road),
  roadChosen: flat(0xe3eafd),
  obstacle: new MeshStandardMaterial({ color: palette.obstacle, roughness: 0.85 }),
  wall: new MeshStandardMaterial({ color: palette.wall, roughness: 0.85 }),
  chosen: new MeshStandardMaterial({ color: 0x6d8bf0, roughness: 0.8 }),
  mover: new MeshStandardMaterial({ color: 0xd8a25a, roughness: 0.8 }),
  start: flat(palette.accent, 0.85),
  area: flat(palette.accent, 0.16),
  goal: flat(palette.pelvis, 0.85),
  goalArea: flat(palette.pelvis, 0.16),
  way: flat(palette.accent, 0.3),
  handle: flat(palette.accent),
  sketch: flat(palette.accent, 0.5),
  cursor: flat(palette.vehicle, 0.9),
} as const;

export class SceneDrawing {
  readonly group = new Group();
  private readonly built = new Group();
  private readonly overlay = new Group();
  private readonly sketches = new Group();
  private readonly cursor: Mesh;
  private movers: Mesh[] = [];
  /** Whether starts and goals of everybody are shown, or only of the chosen. */
  private everything = true;

  constructor() {
    this.cursor = new Mesh(new RingGeometry(0.1, 0.15, 32).rotateX(-Math.PI / 2), materials.cursor);
    this.cursor.renderOrder = 9;
    this.cursor.position.y = 0.03;
    this.cursor.visible = false;
    this.group.add(this.built, this.overlay, this.sketches, this.cursor);
  }

  /** Draw a scene anew. */
  show(scene: ScenePart, chosen: readonly Ref[], everything: boolean): void {
    this.everything = everything;
    clear(this.built);
    clear(this.overlay);
    const isChosen = (ref: Ref): boolean => chosen.some((other) => same(other, ref));
    // all edges lie below all roads, so crossings have no line across
    listOf(scene, "roads").forEach((road) => this.strip(road.points, road.width + 0.14, materials.edge, 0));
    listOf(scene, "roads").forEach((road, index) =>
      this.strip(
        road.points,
        road.width,
        isChosen({ kind: "roads", index }) ? materials.roadChosen : materials.road,
        1,
      ),
    );
    listOf(scene, "obstacles").forEach((obstacle, index) => {
      const material = isChosen({ kind: "obstacles", index }) ? materials.chosen : materials.obstacle;
      if (isCircle(obstacle)) {
        const height = obstacle.radius < 0.45 ? 2.2 : OBSTACLE_HEIGHT;
        const mesh = solid(new CylinderGeometry(obstacle.radius, obstacle.radius, height, 40), material);
        mesh.position.set(obstacle.center[0], height / 2, obstacle.center[1]);
        this.built.add(mesh);
      } else this.built.add(solid(block(obstacle.points, OBSTACLE_HEIGHT), material));
    });
    listOf(scene, "walls").forEach((wall, index) => {
      this.built.add(
        solid(fence(wall.points, WALL_HEIGHT), isChosen({ kind: "walls", index }) ? materials.chosen : materials.wall),
      );
    });
    listOf(scene, "people").forEach((person, index) =>
      this.somebody(person.start as Area, goalsOf(person), isChosen({ kind: "people", index }), false),
    );
    listOf(scene, "sources").forEach((source, index) =>
      this.somebody(source.start as Area, goalsOf(source), isChosen({ kind: "sources", index }), true),
    );
    if (scene.start) this.somebody(scene.start, scene.goals ?? [], false, false);
    const only = chosen.length === 1 ? chosen[0] : undefined;
    if (only) {
      for (const handle of handlesOf(scene, only)) {
        this.overlay.add(
          disc(handle.x, handle.z, 0.13, 0.035, flat(0xffffff), 10),
          disc(handle.x, handle.z, 0.095, 0.036, materials.handle, 11),
        );
      }
    }
  }

  /** What is being drawn: a line so far, and where the pointer is. */
  sketch(points: readonly Point[], options: { width?: number; closed?: boolean; circle?: number } = {}): void {
    clear(this.sketches);
    if (!points.length) return;
    const [first] = points;
    if (options.circle !== undefined && first)
      this.sketches.add(disc(first[0], first[1], options.circle, 0.028, materials.sketch, 8));
    else {
      if (options.closed && points.length > 2) this.sketches.add(area(points, 0.026, materials.area, 7));
      const mesh = ribbon(
        options.closed ? [...points, points[0]!] : points,
        options.width ?? 0.08,
        materials.sketch,
        8,
      );
      mesh.position.y = 0.027;
      this.sketches.add(mesh);
    }
    for (const [x, z] of points) this.sketches.add(disc(x, z, 0.07, 0.03, materials.handle, 9));
  }

  /** The place that keys move. */
  showCursor(at: { x: number; z: number } | null): void {
    this.cursor.visible = at !== null;
    if (at) this.cursor.position.set(at.x, this.cursor.position.y, at.z);
  }

  /** Sizes of the obstacles that move. */
  setMovers(radii: readonly number[]): void {
    for (const mesh of this.movers) {
      this.group.remove(mesh);
      mesh.geometry.dispose();
    }
    this.movers = radii.map((radius) => {
      const mesh = solid(new CylinderGeometry(radius, radius, 0.8, 32), materials.mover);
      mesh.visible = false;
      this.group.add(mesh);
      return mesh;
    });
  }

  /** Where they are now. */
  moveMovers(places: Float32Array): void {
    this.movers.forEach((mesh, i) => {
      mesh.visible = 2 * i + 1 < places.length;
      if (mesh.visible) mesh.position.set(places[2 * i]!, 0.4, places[2 * i + 1]!);
    });
  }

  private strip(points: readonly Point[], width: number, material: Material, order: number): void {
    const mesh = ribbon(points, width, material, order - 1, true);
    mesh.position.y = 0.004 + order * 0.002;
    this.built.add(mesh);
  }

  private somebody(start: Area, goals: readonly Area[], chosen: boolean, source: boolean): void {
    if (!this.everything && !chosen) return;
    const from = this.place(start, source ? materials.area : materials.start, materials.start, false);
    let before = from;
    for (const goal of goals) {
      const to = this.place(goal, materials.goalArea, materials.goal, true);
      if (chosen || goals.length === 1) this.overlay.add(dashes(before, to, chosen ? materials.start : materials.way));
      before = to;
    }
  }

  /** Mark a point, a line or an area; its middle. */
  private place(where: Area, filled: Material, line: Material, goal: boolean): Point {
    const points = pointsOf(where);
    const middle: Point = [
      points.reduce((sum, [x]) => sum + x, 0) / points.length,
      points.reduce((sum, [, z]) => sum + z, 0) / points.length,
    ];
    if (isPoint(where) || points.length === 1) {
      const ring = new Mesh(new RingGeometry(goal ? 0.11 : 0.24, goal ? 0.2 : 0.29, 36).rotateX(-Math.PI / 2), line);
      ring.position.set(middle[0], 0.024, middle[1]);
      ring.renderOrder = 6;
      this.overlay.add(ring);
      if (goal) this.overlay.add(disc(middle[0], middle[1], 0.06, 0.025, line, 6));
    } else {
      if (points.length > 2) this.overlay.add(area(points, 0.02, filled, 5));
      const mesh = ribbon(points.length > 2 ? [...points, points[0]!] : points, 0.08, line, 6);
      mesh.position.y = 0.024;
      this.overlay.add(mesh);
    }
    return middle;
  }
}

function clear(group: Group): void {
  for (const child of [...group.children]) {
    group.remove(child);
    if (child instanceof Mesh) child.geometry.dispose();
  }
}

function solid(geometry: BufferGeometry, material: Material): Mesh {
  const mesh = new Mesh(geometry, material);
  mesh.castShadow = mesh.receiveShadow = true;
  return mesh;
}

function disc(x: number, z: number, radius: number, height: number, material: Material, order: number): Mesh {
  const mesh = new Mesh(new CircleGeometry(radius, 40).rotateX(-Math.PI / 2), material);
  mesh.position.set(x, height, z);
  mesh.renderOrder = order;
  return mesh;
}

/** A polygon on the floor; shapes live in a plane of x and y, so z is turned over. */
function area(points: readonly Point[], height: number, material: Material, order: number): Mesh {
  const mesh = new Mesh(new ShapeGeometry(shape(points)).rotateX(-Math.PI / 2), material);
  mesh.position.y = height;
  mesh.renderOrder = order;
  return mesh;
}

function shape(points: readonly Point[]): Shape {
  const out = new Shape();
  points.forEach(([x, z], i) => (i ? out.lineTo(x, -z) : out.moveTo(x, -z)));
  return out;
}

function block(points: readonly Point[], height: number): BufferGeometry {
  return new ExtrudeGeometry(shape(points), { depth: height, bevelEnabled: false }).rotateX(-Math.PI / 2);
}

/** Upright boxes along a line. */
function fence(points: readonly Point[], height: number): BufferGeometry {
  const half = 0.05;
  const corners: Point[] = [];
  const left: Point[] = [];
  for (let i = 0; i < points.length; i++) {
    const [ax, az] = points[Math.max(0, i - 1)]!;
    const [bx, bz] = points[Math.min(points.length - 1, i + 1)]!;
    const far = Math.hypot(bx - ax, bz - az) || 1;
    const [x, z] = points[i]!;
    corners.push([x - ((bz - az) / far) * half, z + ((bx - ax) / far) * half]);
    left.push([x + ((bz - az) / far) * half, z - ((bx - ax) / far) * half]);
  }
  return block([...corners, ...left.reverse()], height);
}

/** A flat strip along a line, with round joints and, for roads, round ends. */
function ribbon(points: readonly Point[], width: number, material: Material, order: number, round = false): Mesh {
  const half = width / 2;
  const positions: number[] = [];
  const index: number[] = [];
  for (let i = 0; i + 1 < points.length; i++) {
    const [ax, az] = points[i]!;
    const [bx, bz] = points[i + 1]!;
    const far = Math.hypot(bx - ax, bz - az);
    if (far < 1e-9) continue;
    const nx = (-(bz - az) / far) * half;
    const nz = ((bx - ax) / far) * half;
    const at = positions.length / 3;
    positions.push(ax + nx, 0, az + nz, ax - nx, 0, az - nz, bx + nx, 0, bz + nz, bx - nx, 0, bz - nz);
    index.push(at, at + 1, at + 2, at + 2, at + 1, at + 3);
  }
  const sides = round ? 36 : 12;
  points.forEach(([x, z], i) => {
    if (!round && (i === 0 || i === points.length - 1)) return;
    const at = positions.length / 3;
    positions.push(x, 0, z);
    for (let k = 0; k <= sides; k++) {
      const angle = (k / sides) * Math.PI * 2;
      positions.push(x + Math.cos(angle) * half, 0, z + Math.sin(angle) * half);
      if (k) index.push(at, at + k + 1, at + k);
    }
  });
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(positions), 3));
  geometry.setIndex(index);
  const mesh = new Mesh(geometry, material);
  mesh.renderOrder = order;
  return mesh;
}

const DASH = 0.55;

function dashes(a: Point, b: Point, material: Material): InstancedMesh {
  const far = Math.hypot(b[0] - a[0], b[1] - a[1]);
  const count = Math.min(400, Math.max(1, Math.floor(far / DASH)));
  const mesh = new InstancedMesh(new CircleGeometry(0.045, 10).rotateX(-Math.PI / 2), material, count);
  const dummy = new Object3D();
  for (let i = 0; i < count; i++) {
    const t = (i + 0.5) / count;
    dummy.position.set(a[0] + (b[0] - a[0]) * t, 0.022, a[1] + (b[1] - a[1]) * t);
    dummy.updateMatrix();
    mesh.setMatrixAt(i, dummy.matrix);
  }
  mesh.frustumCulled = false;
  mesh.renderOrder = 5;
  return mesh;
}
