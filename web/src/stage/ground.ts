/** An endless floor: a plain disc with a grid of lines as wide as a pixel that fade into the distance. */

import { Color, Mesh, MeshLambertMaterial, PlaneGeometry, type Scene, ShadowMaterial, type Vector3 } from "three";
import { palette } from "./palette";

const EXTENT = 800;

export class Ground {
  private readonly floor: Mesh;
  private readonly shadow: Mesh;

  constructor(scene: Scene) {
    const material = new MeshLambertMaterial({ color: palette.ground, depthWrite: false }); // nothing lies below it
    material.onBeforeCompile = (shader) => {
      shader.uniforms.fineLine = { value: new Color(palette.gridFine) };
      shader.uniforms.coarseLine = { value: new Color(palette.gridCoarse) };
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", "#include <common>\nvarying vec3 vPlace;")
        .replace(
          "#include <begin_vertex>",
          "#include <begin_vertex>\nvPlace = (modelMatrix * vec4(position, 1.0)).xyz;",
        );
      shader.fragmentShader = shader.fragmentShader
        .replace(
          "#include <common>",
          `#include <common>
          varying vec3 vPlace;
          uniform vec3 fineLine;
          uniform vec3 coarseLine;
          float lines(vec2 at, float spacing, float width) {
            vec2 cell = at / spacing;
            vec2 change = fwidth(cell);
            vec2 near = abs(fract(cell - 0.5) - 0.5) / change;
            float line = 1.0 - clamp(min(near.x, near.y) - width + 0.5, 0.0, 1.0);
            return line * (1.0 - smoothstep(0.03, 0.2, max(change.x, change.y)));
          }`,
        )
        .replace(
          "#include <color_fragment>",
          `#include <color_fragment>
          diffuseColor.rgb = mix(diffuseColor.rgb, fineLine, lines(vPlace.xz, 1.0, 0.5));
          diffuseColor.rgb = mix(diffuseColor.rgb, coarseLine, lines(vPlace.xz, 5.0, 0.7));`,
        );
    };
    const plane = new PlaneGeometry(EXTENT, EXTENT).rotateX(-Math.PI / 2);
    this.floor = new Mesh(plane, material);
    this.floor.renderOrder = -2;
    this.shadow = new Mesh(plane, new ShadowMaterial({ opacity: 0.26, color: 0x1c2433, depthWrite: false }));
    this.shadow.receiveShadow = true;
    this.shadow.position.y = 0.012;
    this.shadow.renderOrder = 4;
    scene.add(this.floor, this.shadow);
  }

  /** The floor goes along with who looks; the grid stays where it is. */
  centre(at: Vector3): void {
    for (const mesh of [this.floor, this.shadow]) {
      mesh.position.x = Math.round(at.x / 5) * 5;
      mesh.position.z = Math.round(at.z / 5) * 5;
    }
  }
}
