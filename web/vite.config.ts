import type { Plugin } from "vite";
import { defineConfig } from "vitest/config";

/** The style sheet of lil-gui brings its glyphs as a font in a data: address, which the page's policy forbids; plain characters do. */
const plainGlyphs: Plugin = {
  name: "plain-glyphs",
  enforce: "pre",
  transform(code, id) {
    return id.includes("lil-gui") && id.endsWith(".css") ? code.replace(/@font-face\s*\{[^}]*\}/g, "") : undefined;
  },
};

// The bundle goes where the server looks for it, and where the wheel takes it from.
export default defineConfig({
  plugins: [plainGlyphs],
  base: "./",
  build: {
    outDir: "../src/stridecast/live/static",
    emptyOutDir: true,
    target: "es2022",
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 1000,
    assetsInlineLimit: 0, // data: addresses would need a wider content security policy
  },
  server: {
    proxy: {
      "/ws": { target: "ws://127.0.0.1:8047", ws: true },
      "/body.glb": "http://127.0.0.1:8047",
      "/files": "http://127.0.0.1:8047",
      "/download": "http://127.0.0.1:8047",
    },
  },
  test: { include: ["tests/**/*.test.ts"], environment: "node" },
});
