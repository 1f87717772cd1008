/** What clicks, drags and keys on the ground mean, by the tool that is in the hand. */

import type { ScenePart } from "../../protocol";
import type { Spot } from "../../stage/stage";
import {
  add,
  type Area,
  goalsOf,
  listOf,
  partOf,
  pointsOf,
  type Point,
  type Ref,
  round,
  setGoals,
  update,
} from "./document";
import type { PersonPart, SourcePart } from "../../protocol";

export type Tool = "select" | "road" | "circle" | "polygon" | "wall" | "person" | "source" | "start" | "goal";

export const HINTS: Record<Tool, string> = {
  select:
    "Click to choose, shift-click for more, drag to move. Drag the ground to shift the view, right drag to turn it.",
  road: "Click point after point, double-click or press Enter to end the road. Or drag from one end to the other.",
  circle: "Press where the middle is to be, and drag to the rim.",
  polygon: "Click the corners one after the other, double-click or press Enter to close.",
  wall: "Click point after point, double-click or press Enter to end the wall.",
  person: "Press where somebody starts and drag to where they go. A click only puts them there.",
  source: "Drag a line from which people come. Then put their goal with the goal tool.",
  start: "Click where the chosen people start.",
  goal: "Click where the chosen people go, drag for a line to be reached. Shift adds a further goal.",
};

const NEAR = 0.35;
const DRAGGED = 0.25;

export interface Draft {
  points: Point[];
  closed: boolean;
  width?: number;
  circle?: number;
}

export interface ToolEvents {
  scene(): ScenePart;
  chosen(): readonly Ref[];
  change(scene: ScenePart, chosen: readonly Ref[]): void;
  draft(draft: Draft | null): void;
  say(text: string): void;
}

/** Tools that put something on the ground; choosing and moving is another matter. */
export class Drawing {
  private points: Point[] = [];
  private from: Spot | null = null;

  constructor(private readonly events: ToolEvents) {}

  get drawing(): boolean {
    return this.points.length > 0 || this.from !== null;
  }

  cancel(): void {
    this.points = [];
    this.from = null;
    this.events.draft(null);
  }

  /** Take the last point back. */
  back(): boolean {
    if (!this.points.length) return false;
    this.points.pop();
    this.events.draft(this.points.length ? { points: this.points, closed: false } : null);
    return true;
  }

  press(spot: Spot): void {
    this.from = spot;
  }

  /** The pointer moves, pressed or not. */
  move(tool: Tool, spot: Spot): void {
    const from = this.from;
    const pulled = from !== null && apart(from, spot) > DRAGGED;
    if (tool === "circle") {
      if (from && pulled) this.events.draft({ points: [at(from)], closed: false, circle: apart(from, spot) });
      return;
    }
    if (tool === "road" || tool === "wall" || tool === "polygon") {
      const so = this.points.length ? this.points : from && pulled ? [at(from)] : [];
      if (so.length)
        this.events.draft({
          points: [...so, at(spot)],
          closed: tool === "polygon",
          ...(tool === "road" ? { width: 3 } : {}),
        });
      return;
    }
    if (from && pulled) this.events.draft({ points: [at(from), at(spot)], closed: false });
  }

  release(tool: Tool, spot: Spot, more: boolean): void {
    const from = this.from ?? spot;
    this.from = null;
    const pulled = apart(from, spot) > DRAGGED;
    const { events } = this;
    const scene = events.scene();
    switch (tool) {
      case "circle":
        events.draft(null);
        this.put(add(scene, "obstacles", { center: at(from), radius: pulled ? round(apart(from, spot)) : 0.5 }));
        return;
      case "road":
      case "wall":
      case "polygon":
        if (pulled && !this.points.length && tool !== "polygon") {
          this.points = [at(from), at(spot)];
          this.finish(tool);
          return;
        }
        this.point(tool, spot);
        return;
      case "person":
        events.draft(null);
        this.put(
          add(scene, "people", { start: at(from), goals: pulled ? [at(spot)] : [], behavior: { velocity: 1.3 } }),
        );
        return;
      case "source":
        events.draft(null);
        this.put(
          add(scene, "sources", {
            start: pulled ? [at(from), at(spot)] : at(from),
            flow: 0.5,
            velocity: { mean: 1.3, deviation: 0.2, least: 0.9, most: 1.8 },
          }),
        );
        return;
      case "start":
      case "goal":
        events.draft(null);
        this.aim(tool, pulled ? [at(from), at(spot)] : at(spot), more);
        return;
    }
  }

  private point(tool: "road" | "wall" | "polygon", spot: Spot): void {
    const first = this.points[0];
    const last = this.points[this.points.length - 1];
    const near = (point: Point | undefined): boolean =>
      point !== undefined && Math.hypot(point[0] - spot.x, point[1] - spot.z) < NEAR;
    if (near(last) || (tool === "polygon" && this.points.length > 2 && near(first))) {
      this.finish(tool);
      return;
    }
    this.points.push(at(spot));
    this.events.draft({ points: this.points, closed: tool === "polygon", ...(tool === "road" ? { width: 3 } : {}) });
  }

  /** The line or the polygon has all its points. */
  finish(tool: Tool): boolean {
    const { events, points } = this;
    const least = tool === "polygon" ? 3 : 2;
    if (tool !== "road" && tool !== "wall" && tool !== "polygon") return false;
    if (points.length < least) {
      if (points.length)
        events.say(
          tool === "polygon"
            ? "A polygon needs three corners; click one more."
            : "A line needs two points; click one more.",
        );
      return points.length > 0;
    }
    const line = [...points];
    this.cancel();
    const scene = events.scene();
    if (tool === "road") this.put(add(scene, "roads", { points: line, width: 3 }));
    else if (tool === "wall") this.put(add(scene, "walls", { points: line }));
    else this.put(add(scene, "obstacles", { points: line }));
    return true;
  }

  private put([scene, ref]: [ScenePart, Ref]): void {
    this.events.change(scene, [ref]);
  }

  /** Give the chosen a start or a goal; without any, those who have no goal yet. */
  private aim(tool: "start" | "goal", where: Area, more: boolean): void {
    const { events } = this;
    let scene = events.scene();
    let refs = events.chosen().filter((ref) => ref.kind === "people" || ref.kind === "sources");
    if (!refs.length && tool === "goal") {
      refs = (["people", "sources"] as const).flatMap((kind) =>
        listOf(scene, kind).flatMap((part, index) =>
          goalsOf(part as PersonPart | SourcePart).length ? [] : [{ kind, index }],
        ),
      );
    }
    if (!refs.length) {
      events.say(
        tool === "goal"
          ? "Everybody has a goal. Choose people or a source first, to give them another."
          : "Choose people or a source first, then click where they start.",
      );
      return;
    }
    const middle = centre(where);
    const spread = refs.map((_, i) => i - (refs.length - 1) / 2);
    refs.forEach((ref, i) => {
      const part = partOf(scene, ref) as PersonPart | SourcePart;
      if (tool === "goal") scene = setGoals(scene, ref, more ? [...goalsOf(part), where] : [where]);
      // several people cannot stand in one place
      else
        scene = update(scene, ref, {
          start: refs.length === 1 ? where : [round(middle[0] + spread[i]! * 0.8), round(middle[1])],
        });
    });
    events.change(scene, refs);
  }
}

const at = (spot: Spot): Point => [round(spot.x), round(spot.z)];
const apart = (a: Spot, b: Spot): number => Math.hypot(a.x - b.x, a.z - b.z);

function centre(area: Area): Point {
  const points = pointsOf(area);
  return [
    points.reduce((sum, [x]) => sum + x, 0) / points.length,
    points.reduce((sum, [, z]) => sum + z, 0) / points.length,
  ];
}
