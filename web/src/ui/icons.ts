/** Line drawings for buttons, 20 by 20, drawn with the colour of the text. */

import { svg } from "./dom";

const draw =
  (...paths: string[]) =>
  (): SVGElement =>
    svg(
      "svg",
      { viewBox: "0 0 20 20", class: "glyph", "aria-hidden": "true", focusable: "false" },
      ...paths.map((d) => svg("path", { d })),
    );

export const icons = {
  stand: draw("M10 4.5a1.6 1.6 0 1 0 0-.01", "M10 7v6M10 13l-1.6 5M10 13l1.6 5M10 8l-2.4 4.4M10 8l2.4 4.4"),
  walk: draw("M11 4a1.6 1.6 0 1 0 0-.01", "M10.6 7l-1 5.5L6.5 18M9.6 12.5l3 2.3.9 3.7M10.5 7.4L7.6 9l-.9 3M10.8 7.4l2.2 2.6 2.4 1"),
  run: draw("M12.5 4a1.6 1.6 0 1 0 0-.01", "M11.5 7l-2 5-3.5 2.6L3 14M9.5 12l3.6 1.4-.4 4.4M11.2 7.3L8 7.2 5.8 9.6M11.5 7.6l2.3 2.6 3-.3"),
  play: draw("M6 4l10 6-10 6z"),
  pause: draw("M6.5 4v12M13.5 4v12"),
  step: draw("M5 4l8 6-8 6zM15.5 4v12"),
  restart: draw("M4.5 10a5.5 5.5 0 1 0 2-4.2M4.2 3.5v3.6h3.6"),
  faster: draw("M3.5 5l6 5-6 5zM10.5 5l6 5-6 5z"),
  slower: draw("M16.5 5l-6 5 6 5zM9.5 5l-6 5 6 5z"),
  undo: draw("M7 4L3.5 7.5 7 11M4 7.5h7.5a4.5 4.5 0 0 1 0 9H8"),
  redo: draw("M13 4l3.5 3.5L13 11M16 7.5H8.500a4.500 4.500 0 0 0 0 9H12"),
  select: draw("M5 3l10 7-4.6 1L8 16z"),
  road: draw("M6 17L8.500 3M14 17L11.500 3M10 15v-2M10 10V8"),
  circle: draw("M10 4a6 6 0 1 0 .01 0"),
  polygon: draw("M10 3.500l6.500 5-2.500 7.500H6L3.500 8.500z"),
  wall: draw("M3 14l5-7 4 4 5-7"),
  person: draw("M10 4.500a2.300 2.300 0 1 0 .01 0", "M5 17c0-3.600 2-6 5-6s5 2.400 5 6"),
  source: draw("M7 5a1.900 1.900 0 1 0 .01 0M13.500 6a1.600 1.600 0 1 0 .01 0", "M3 16c0-3.200 1.700-5.200 4-5.200s4 2 4 5.200M12.500 11.200c2.600-.2 4.500 1.600 4.500 4.800"),
  start: draw("M5 17.500V3M5 4l9 3-9 3.500"),
  goal: draw("M10 17.500c-4-4.600-5.500-7-5.500-9.300a5.500 5.500 0 0 1 11 0c0 2.300-1.500 4.700-5.500 9.300z", "M10 6.500a1.800 1.800 0 1 0 .01 0"),
  remove: draw("M4 6h12M8 6V4h4v2M6 6l.8 11h6.400L14 6"),
  open: draw("M3 15.500V5h5l1.500 2H17v8.500z"),
  save: draw("M10 3v9M6.500 8.500L10 12l3.500-3.500M4 16.500h12"),
  help: draw("M10 3a7 7 0 1 0 .01 0", "M8 8.200a2 2 0 1 1 3 1.700c-.7.400-1 .8-1 1.600M10 13.800v.1"),
  follow: draw("M10 3.500a2 2 0 1 0 .01 0", "M6.500 13c0-3 1.300-5 3.500-5s3.500 2 3.500 5M3 14.500c2 3 12 3 14 0"),
  orbit: draw("M10 8a2 2 0 1 0 .01 0", "M2.500 10c0-2 3.400-3.600 7.500-3.600s7.500 1.600 7.500 3.600-3.400 3.600-7.500 3.600S2.500 12 2.500 10z"),
  top: draw("M4 4h12v12H4z", "M10 8a2 2 0 1 0 .01 0"),
  close: draw("M5 5l10 10M15 5L5 15"),
  fit: draw("M3.500 7V3.500H7M13 3.500h3.500V7M16.500 13v3.500H13M7 16.500H3.500V13"),
} as const;
