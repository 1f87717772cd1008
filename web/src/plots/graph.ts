/** The transition graph, small: standing, walking and running, what leads from one to the other, and where we are. */

import type { DatabasePart } from "../protocol";
import { el, replace, setText, svg } from "../ui/dom";

interface Node {
  x: number;
  y: number;
  circle: SVGElement;
}

const WIDTH = 268;
const HEIGHT = 140;
const CORNERS: Record<string, [number, number]> = { stand: [38, 106], walk: [134, 24], run: [230, 106] };

export class GraphDrawing {
  readonly element: HTMLElement;
  private readonly picture = svg("svg", {
    viewBox: `0 0 ${WIDTH} ${HEIGHT}`,
    class: "graph",
    role: "img",
    "aria-label": "Transition graph",
  });
  readonly caption = el("p", { class: "graph-caption" });
  private nodes: Node[] = [];
  private edges = new Map<string, SVGElement>();
  private names: string[] = [];
  private active = -1;
  private edge: SVGElement | null = null;
  private ring = svg("circle", { r: 8.5, class: "graph-ring", pathLength: 1 });

  constructor() {
    this.element = el("figure", { class: "graph-figure" }, this.picture);
  }

  set(database: DatabasePart): void {
    this.active = -1;
    this.edge = null;
    this.names = database.groups.map((group) => group.name);
    const between = new Map<string, number[]>();
    database.groups.forEach((group, i) => between.set(group.motion, [...(between.get(group.motion) ?? []), i]));
    const places: [number, number][] = database.groups.map(() => [0, 0]);
    for (const [motion, members] of between) {
      const [from, to] = motion.split("-");
      const a = CORNERS[from ?? ""];
      if (!a) continue;
      const b = to ? CORNERS[to] : undefined;
      members.forEach((member, k) => {
        if (!b) {
          const angle = (k / members.length) * Math.PI * 2 + Math.PI / 2;
          const reach = members.length === 1 ? 0 : 13;
          places[member] = [a[0] + Math.cos(angle) * reach, a[1] + Math.sin(angle) * reach];
          return;
        }
        // transitions stand beside the straight line from one corner to the other, each way on its own side
        const dx = b[0] - a[0];
        const dy = b[1] - a[1];
        const far = Math.hypot(dx, dy);
        const along = 0.5 + (k - (members.length - 1) / 2) * Math.min(0.14, 0.5 / members.length);
        places[member] = [a[0] + dx * along - (dy / far) * -11, a[1] + dy * along + (dx / far) * -11];
      });
    }
    this.edges.clear();
    const lines = svg("g", { class: "graph-edges" });
    for (const [i, j] of database.graph) {
      if (i === j) continue;
      const [x1, y1] = places[i]!;
      const [x2, y2] = places[j]!;
      const line = svg("line", { x1, y1, x2, y2 });
      this.edges.set(`${i}-${j}`, line);
      lines.appendChild(line);
    }
    const dots = svg("g", { class: "graph-nodes" });
    this.nodes = places.map(([x, y], i) => {
      const steady = !database.groups[i]!.motion.includes("-");
      const circle = svg(
        "circle",
        { cx: x, cy: y, r: steady ? 5 : 3.2, class: steady ? "steady" : "" },
        svg("title", {}, this.names[i]!),
      );
      dots.appendChild(circle);
      return { x, y, circle };
    });
    const words = svg("g", { class: "graph-words" });
    const labels: Record<string, [number, number, string]> = {
      stand: [38, 134, "middle"],
      walk: [160, 18, "start"],
      run: [230, 134, "middle"],
    };
    for (const [word, [x, y, anchor]] of Object.entries(labels)) {
      if (between.has(word)) words.appendChild(svg("text", { x, y, "text-anchor": anchor }, word));
    }
    this.ring = svg("circle", { r: 8.5, class: "graph-ring", pathLength: 1, visibility: "hidden" });
    replace(this.picture, lines, dots, words, this.ring);
  }

  /** What plays, and how far it is. */
  show(group: number, generic: number): void {
    const node = this.nodes[group];
    if (!node) return;
    if (group !== this.active) {
      this.nodes[this.active]?.circle.classList.remove("active");
      this.edge?.classList.remove("active");
      this.edge = this.edges.get(`${this.active}-${group}`) ?? null;
      this.edge?.classList.add("active");
      node.circle.classList.add("active");
      this.active = group;
      this.ring.setAttribute("cx", String(node.x));
      this.ring.setAttribute("cy", String(node.y));
      this.ring.setAttribute("transform", `rotate(-90 ${node.x} ${node.y})`);
      this.ring.setAttribute("visibility", "visible");
      const [motion, string] = this.names[group]!.split("/");
      setText(this.caption, `${motion!.replace("-", " to ")} · ${string ?? ""}`);
    }
    this.ring.setAttribute("stroke-dasharray", `${Math.min(1, Math.max(0, generic)).toFixed(3)} 1`);
  }
}
