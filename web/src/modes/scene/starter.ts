/** Scenes to begin with. */

import type { PersonPart, ScenePart } from "../../protocol";

const somebody = (
  name: string,
  start: [number, number],
  goal: [number, number],
  velocity: number,
  more: Partial<PersonPart> = {},
): PersonPart => ({
  name,
  start,
  goals: [goal],
  behavior: { velocity },
  ...more,
});

/** Two streets that cross, a kiosk, and people who want to get to the other side. */
export const crossing: ScenePart = {
  version: 1,
  roads: [
    {
      name: "long street",
      points: [
        [-15, 0],
        [15, 0],
      ],
      width: 6,
    },
    {
      name: "side street",
      points: [
        [0, -13],
        [0, 13],
      ],
      width: 5,
    },
  ],
  obstacles: [
    {
      name: "kiosk",
      points: [
        [-4.1, 1.2],
        [-2.7, 1.2],
        [-2.7, 2.6],
        [-4.1, 2.6],
      ],
    },
    { name: "tree", center: [4.2, -1.7], radius: 0.4 },
    { name: "lamp", center: [-8, -2.2], radius: 0.2 },
  ],
  people: [
    somebody("Ann", [-13, 0.6], [13, 0.8], 1.4),
    somebody("Ben", [13, 0.2], [-13, 0.4], 1.3),
    somebody("Cleo", [0.6, -11], [0.8, 11], 1.2),
    somebody("Dan", [-0.8, 11], [-0.6, -11], 1.5),
    somebody("Eve", [-12, -1.2], [11, -0.8], 1.1, { together: "friends" }),
    somebody("Finn", [-12.6, -0.5], [11, -0.2], 1.1, { together: "friends" }),
    somebody("Gil", [12, -1], [-12, -1], 2.8, { behavior: { velocity: 2.8, status: "run" }, begins: 2 }),
  ],
  sources: [
    {
      name: "from the north",
      start: [
        [-1.8, 12],
        [1.8, 12],
      ],
      goals: [
        [
          [14, -2],
          [14, 2],
        ],
      ],
      flow: 0.25,
      most: 12,
      velocity: { mean: 1.3, deviation: 0.2, least: 0.9, most: 1.8 },
    },
    {
      name: "from the south",
      start: [
        [1.8, -12],
        [-1.8, -12],
      ],
      goals: [
        [
          [-14, 2],
          [-14, -2],
        ],
      ],
      flow: 0.25,
      most: 12,
      velocity: { mean: 1.3, deviation: 0.2, least: 0.9, most: 1.8 },
    },
  ],
  seconds: 90,
  seed: 7,
};

/** Four streams that meet on a square. */
export const square: ScenePart = {
  version: 1,
  obstacles: [{ name: "fountain", center: [0, 0], radius: 2 }],
  sources: (
    [
      [
        "west",
        [
          [-22, 5],
          [-22, -5],
        ],
        [
          [22, -5],
          [22, 5],
        ],
      ],
      [
        "east",
        [
          [22, -5],
          [22, 5],
        ],
        [
          [-22, 5],
          [-22, -5],
        ],
      ],
      [
        "north",
        [
          [5, 22],
          [-5, 22],
        ],
        [
          [-5, -22],
          [5, -22],
        ],
      ],
      [
        "south",
        [
          [-5, -22],
          [5, -22],
        ],
        [
          [5, 22],
          [-5, 22],
        ],
      ],
    ] as [string, [number, number][], [number, number][]][]
  ).map(([name, start, goal]) => ({
    name,
    start,
    goals: [goal],
    flow: 1.2,
    velocity: { mean: 1.3, deviation: 0.22, least: 0.8, most: 1.9 },
    height: { mean: 1.72, deviation: 0.08, least: 1.5, most: 1.95 },
    together: [6, 3, 1],
  })),
  seconds: 120,
  seed: 3,
};
