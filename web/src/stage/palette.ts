/** Colours of what is drawn in three dimensions; the style sheet has the same ones for the panels. */

export const palette = {
  sky: 0xe9ebee,
  ground: 0xe4e6ea,
  gridFine: 0xd3d7dd,
  gridCoarse: 0xbcc2cb,
  road: 0xf7f8fa,
  roadEdge: 0xaab2be,
  obstacle: 0xb9bfc9,
  wall: 0x7d8592,
  body: 0xdcd6cc,
  bodyJoint: 0xb9b1a4,
  accent: 0x2b50d8,
  input: 0xd42a2a,
  vehicle: 0x15181d,
  pelvis: 0x0f8a4b,
  footprint: 0x6b7482,
  chosen: 0xf08c00,
} as const;

/** Calm clothes of a crowd, told apart without shouting. */
export const crowdColours = [0xdcd6cc, 0xc7ced8, 0xcfd6c9, 0xd8c9c3, 0xc9c6d6, 0xd9d2bd, 0xbfcfd2, 0xd2d2d4] as const;
