/** Where feet stood: soles on the floor that fade as others come. */

import {
  Color,
  DoubleSide,
  ExtrudeGeometry,
  InstancedBufferAttribute,
  InstancedMesh,
  MeshBasicMaterial,
  Object3D,
  Shape,
} from "three";
import { palette } from "./palette";

function sole(): Shape {
  const shape = new Shape();
  shape.moveTo(0, -0.13);
  shape.bezierCurveTo(0.042, -0.13, 0.042, -0.06, 0.034, -0.01);
  shape.bezierCurveTo(0.032, 0.03, 0.056, 0.06, 0.05, 0.1);
  shape.bezierCurveTo(0.046, 0.14, -0.03, 0.15, -0.042, 0.09);
  shape.bezierCurveTo(-0.05, 0.04, -0.034, 0.0, -0.036, -0.04);
  shape.bezierCurveTo(-0.038, -0.09, -0.036, -0.13, 0, -0.13);
  return shape;
}

export class Footprints {
  readonly mesh: InstancedMesh;
  private next = 0;
  private readonly strength: Float32Array;
  private readonly dummy = new Object3D();

  constructor(private readonly capacity = 60) {
    const geometry = new ExtrudeGeometry(sole(), { depth: 0.001, bevelEnabled: false, curveSegments: 8 });
    geometry.rotateX(Math.PI / 2); // the shape's up is +z now, its left stays at +x
    this.strength = new Float32Array(capacity);
    geometry.setAttribute("strength", new InstancedBufferAttribute(this.strength, 1));
    const material = new MeshBasicMaterial({
      color: new Color(palette.footprint),
      transparent: true,
      side: DoubleSide,
      depthWrite: false,
      toneMapped: false,
    });
    material.onBeforeCompile = (shader) => {
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", "#include <common>\nattribute float strength;\nvarying float vStrength;")
        .replace("#include <begin_vertex>", "#include <begin_vertex>\nvStrength = strength;");
      shader.fragmentShader = shader.fragmentShader
        .replace("#include <common>", "#include <common>\nvarying float vStrength;")
        .replace("#include <color_fragment>", "#include <color_fragment>\ndiffuseColor.a *= vStrength;");
    };
    this.mesh = new InstancedMesh(geometry, material, capacity);
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = 4;
    this.clear();
  }

  /** One more print: middle of the foot, direction, which foot. */
  add(x: number, z: number, heading: number, left: boolean, size = 1): void {
    for (let i = 0; i < this.capacity; i++) this.strength[i] = Math.max(0, this.strength[i]! - 0.75 / this.capacity);
    this.dummy.position.set(x, 0.008, z);
    this.dummy.rotation.set(0, heading, 0);
    this.dummy.scale.set(left ? -size : size, 1, size);
    this.dummy.updateMatrix();
    this.mesh.setMatrixAt(this.next, this.dummy.matrix);
    this.strength[this.next] = 0.75;
    this.next = (this.next + 1) % this.capacity;
    this.mesh.instanceMatrix.needsUpdate = true;
    this.mesh.geometry.attributes.strength!.needsUpdate = true;
  }

  clear(): void {
    this.strength.fill(0);
    this.dummy.scale.setScalar(0);
    this.dummy.updateMatrix();
    for (let i = 0; i < this.capacity; i++) this.mesh.setMatrixAt(i, this.dummy.matrix);
    this.mesh.instanceMatrix.needsUpdate = true;
    this.mesh.geometry.attributes.strength!.needsUpdate = true;
    this.next = 0;
  }
}
