/** The scene being edited: plain data, and functions that make the next one. Nothing here draws or sends. */

import type { BehaviorPart, CirclePart, PersonPart, PolygonPart, ScenePart, SourcePart } from "../../protocol";

export type Point = [number, number];
export type Area = Point | Point[];
export type Kind = "roads" | "obstacles" | "walls" | "movers" | "people" | "sources";

/** One thing of a scene. */
export interface Ref {
  kind: Kind;
  index: number;
}

/** A point of a thing that can be dragged. `goal` is the place in its goals, -1 for the thing itself. */
export interface Handle {
  x: number;
  z: number;
  goal: number;
  corner: number;
}

export const KINDS: readonly Kind[] = ["roads", "obstacles", "walls", "movers", "people", "sources"];

const WORDS: Record<Kind, string> = {
  roads: "road",
  obstacles: "obstacle",
  walls: "wall",
  movers: "mover",
  people: "person",
  sources: "source",
};

export const EMPTY: ScenePart = { version: 1 };

export const isCircle = (part: CirclePart | PolygonPart): part is CirclePart => "center" in part;
export const isPoint = (area: Area): area is Point => typeof area[0] === "number";
export const pointsOf = (area: Area): Point[] => (isPoint(area) ? [area] : area);
export const same = (a: Ref, b: Ref): boolean => a.kind === b.kind && a.index === b.index;

type Part = NonNullable<ScenePart[Kind]>[number];

export function listOf<K extends Kind>(scene: ScenePart, kind: K): NonNullable<ScenePart[K]> {
  return (scene[kind] ?? []) as NonNullable<ScenePart[K]>;
}

export function partOf(scene: ScenePart, ref: Ref): Part | undefined {
  return (listOf(scene, ref.kind) as Part[])[ref.index];
}

/** Everything, in the order in which it lies: what is drawn last comes last. */
export function allOf(scene: ScenePart): Ref[] {
  return KINDS.flatMap((kind) => listOf(scene, kind).map((_, index) => ({ kind, index })));
}

export function nameOf(scene: ScenePart, ref: Ref): string {
  return partOf(scene, ref)?.name ?? `${WORDS[ref.kind]} ${ref.index + 1}`;
}

/** A name that nothing of this kind has yet. */
export function freshName(scene: ScenePart, kind: Kind): string {
  const taken = new Set(allOf(scene).map((ref) => nameOf(scene, ref)));
  for (let number = listOf(scene, kind).length + 1; ; number++) {
    const name = `${WORDS[kind]} ${number}`;
    if (!taken.has(name)) return name;
  }
}

/** The scene with one more thing, and where it is. */
export function add<K extends Kind>(
  scene: ScenePart,
  kind: K,
  part: NonNullable<ScenePart[K]>[number],
): [ScenePart, Ref] {
  const list = listOf(scene, kind) as Part[];
  const named = { ...part, name: part.name ?? freshName(scene, kind) } as Part;
  return [
    { ...scene, [kind]: [...list, named] },
    { kind, index: list.length },
  ];
}

export function remove(scene: ScenePart, refs: readonly Ref[]): ScenePart {
  const out: ScenePart = { ...scene };
  for (const kind of KINDS) {
    const gone = new Set(refs.filter((ref) => ref.kind === kind).map((ref) => ref.index));
    if (gone.size)
      Object.assign(out, { [kind]: (listOf(scene, kind) as Part[]).filter((_, index) => !gone.has(index)) });
  }
  return out;
}

/** Change fields of a thing; `undefined` takes one away. */
export function update(scene: ScenePart, ref: Ref, changes: Record<string, unknown>): ScenePart {
  const list = [...(listOf(scene, ref.kind) as Part[])];
  const part = list[ref.index];
  if (!part) return scene;
  const next = { ...part, ...changes } as Record<string, unknown>;
  for (const key of Object.keys(next)) if (next[key] === undefined) delete next[key];
  list[ref.index] = next as unknown as Part;
  return { ...scene, [ref.kind]: list };
}

/** Change how a person goes. */
export function behave(scene: ScenePart, ref: Ref, changes: BehaviorPart): ScenePart {
  const person = partOf(scene, ref) as PersonPart | undefined;
  if (!person) return scene;
  return update(scene, ref, { behavior: { ...person.behavior, ...changes } });
}

const shift = ([x, z]: Point, dx: number, dz: number): Point => [round(x + dx), round(z + dz)];
const shiftArea = (area: Area, dx: number, dz: number): Area =>
  isPoint(area) ? shift(area, dx, dz) : area.map((point) => shift(point, dx, dz));

/** Centimetres are enough for what a hand draws, and read well in a file. */
export function round(value: number): number {
  const out = Math.round(value * 100) / 100;
  return out === 0 ? 0 : out;
}

/** Move a thing; people and sources leave their goals where they are. */
export function moveBy(scene: ScenePart, ref: Ref, dx: number, dz: number): ScenePart {
  const part = partOf(scene, ref);
  if (!part) return scene;
  if ("start" in part) return update(scene, ref, { start: shiftArea(part.start as Area, dx, dz) });
  if ("center" in part) return update(scene, ref, { center: shift(part.center, dx, dz) });
  return update(scene, ref, { points: part.points.map((point) => shift(point, dx, dz)) });
}

export function handlesOf(scene: ScenePart, ref: Ref): Handle[] {
  const part = partOf(scene, ref);
  if (!part) return [];
  const of = (points: readonly Point[], goal: number): Handle[] =>
    points.map(([x, z], corner) => ({ x, z, goal, corner }));
  if ("start" in part) {
    return [
      ...of(pointsOf(part.start as Area), -1),
      ...goalsOf(part).flatMap((area, goal) => of(pointsOf(area), goal)),
    ];
  }
  if ("center" in part) {
    const [x, z] = part.center;
    return [
      { x, z, goal: -1, corner: 0 },
      { x: x + part.radius, z, goal: -1, corner: 1 },
    ];
  }
  return of(part.points, -1);
}

/** Drag one handle of a thing to a place. */
export function moveHandle(scene: ScenePart, ref: Ref, handle: Handle, x: number, z: number): ScenePart {
  const part = partOf(scene, ref);
  if (!part) return scene;
  const to: Point = [round(x), round(z)];
  const put = (area: Area): Area =>
    isPoint(area) ? to : area.map((point, corner) => (corner === handle.corner ? to : point));
  if ("start" in part) {
    if (handle.goal < 0) return update(scene, ref, { start: put(part.start as Area) });
    const goals = goalsOf(part).map((area, goal) => (goal === handle.goal ? put(area) : area));
    return setGoals(scene, ref, goals);
  }
  if ("center" in part) {
    if (handle.corner === 0) return update(scene, ref, { center: to });
    return update(scene, ref, { radius: Math.max(0.1, round(Math.hypot(x - part.center[0], z - part.center[1]))) });
  }
  return update(scene, ref, { points: put(part.points) });
}

/** Goals of a person, or of a source (those of its first route, where it has routes). */
export function goalsOf(part: PersonPart | SourcePart): Area[] {
  if ("routes" in part && part.routes?.length) return part.routes[0]!.goals as Area[];
  return (part.goals ?? []) as Area[];
}

export function setGoals(scene: ScenePart, ref: Ref, goals: Area[]): ScenePart {
  const part = partOf(scene, ref) as SourcePart | undefined;
  if (part?.routes?.length) {
    const routes = part.routes.map((route, i) => (i === 0 ? { ...route, goals } : route));
    return update(scene, ref, { routes });
  }
  return update(scene, ref, { goals });
}

/** What lies at a place, the topmost first; `reach` metres beside a thin thing still counts. */
export function thingAt(scene: ScenePart, x: number, z: number, reach: number): Ref | null {
  const order: Kind[] = ["people", "sources", "movers", "walls", "obstacles", "roads"];
  for (const kind of order) {
    const list = listOf(scene, kind) as Part[];
    for (let index = list.length - 1; index >= 0; index--) {
      if (lies(list[index]!, kind, x, z, reach)) return { kind, index };
    }
  }
  return null;
}

function lies(part: Part, kind: Kind, x: number, z: number, reach: number): boolean {
  if ("start" in part) {
    const points = pointsOf(part.start as Area);
    if (points.length > 2 && inside(points, x, z)) return true;
    return distanceTo(points, x, z, points.length > 2) < reach + 0.3;
  }
  if ("center" in part) return Math.hypot(x - part.center[0], z - part.center[1]) < part.radius + reach * 0.3;
  if (kind === "obstacles") return inside(part.points, x, z) || distanceTo(part.points, x, z, true) < reach * 0.3;
  if ("width" in part) return distanceTo(part.points, x, z, false) < part.width / 2;
  return distanceTo(part.points, x, z, false) < reach + ("radius" in part ? part.radius : 0);
}

export function inside(points: readonly Point[], x: number, z: number): boolean {
  let odd = false;
  for (let i = 0, j = points.length - 1; i < points.length; j = i++) {
    const [ax, az] = points[i]!;
    const [bx, bz] = points[j]!;
    if (az > z !== bz > z && x < ((bx - ax) * (z - az)) / (bz - az) + ax) odd = !odd;
  }
  return odd;
}

/** Distance from a polyline. */
export function distanceTo(points: readonly Point[], x: number, z: number, closed: boolean): number {
  let least = Infinity;
  const count = points.length;
  if (count === 1) return Math.hypot(x - points[0]![0], z - points[0]![1]);
  for (let i = 0; i < (closed ? count : count - 1); i++) {
    const [ax, az] = points[i]!;
    const [bx, bz] = points[(i + 1) % count]!;
    const length = (bx - ax) ** 2 + (bz - az) ** 2;
    const t = length ? Math.min(1, Math.max(0, ((x - ax) * (bx - ax) + (z - az) * (bz - az)) / length)) : 0;
    least = Math.min(least, Math.hypot(x - ax - t * (bx - ax), z - az - t * (bz - az)));
  }
  return least;
}

/** The rectangle in which everything lies: least x, least z, greatest x, greatest z. */
export function extent(scene: ScenePart): [number, number, number, number] | null {
  const points: Point[] = [];
  for (const ref of allOf(scene)) for (const { x, z } of handlesOf(scene, ref)) points.push([x, z]);
  if (!points.length) return null;
  const xs = points.map(([x]) => x);
  const zs = points.map(([, z]) => z);
  return [Math.min(...xs), Math.min(...zs), Math.max(...xs), Math.max(...zs)];
}
