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
  body: 0xf1ece4,
  bodyJoint: 0xb9b1a4,
  accent: 0x2b50d8,
  input: 0xd42a2a,
  vehicle: 0x15181d,
  pelvis: 0x0f8a4b,
  footprint: 0x6b7482,
  chosen: 0xf08c00,
} as const;

/** Calm clothes of a crowd, told apart without shouting. */
export const crowdColours = [0xeee8de, 0xc3cfe3, 0xc9dcc4, 0xe3c6bb, 0xcdc6e4, 0xe6d8ac, 0xb4d3d6, 0xd8d8dc] as const;
