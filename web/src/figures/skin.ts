/** Skinned figures: the mannequin that the server makes of the skeleton, cloned for those who are nearest. */

import {
  type Bone,
  type Color,
  Group,
  type Material,
  Mesh,
  type MeshStandardMaterial,
  type Object3D,
  PropertyBinding,
  SkinnedMesh,
} from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { clone } from "three/addons/utils/SkeletonUtils.js";
import type { Body } from "./body";

interface Wearer {
  object: Object3D;
  bones: Bone[];
  materials: MeshStandardMaterial[];
}

export class Skin {
  readonly group = new Group();
  private readonly wearers: Wearer[] = [];
  private used = 0;

  private constructor(
    private readonly body: Body,
    private readonly model: Object3D,
    private readonly most: number,
  ) {}

  /** Fetch the mannequin; an error where there is none or its bones are not the skeleton's. */
  static async load(url: string, body: Body, most: number): Promise<Skin> {
    const { scene } = await new GLTFLoader().loadAsync(url);
    const skin = new Skin(body, scene, most);
    skin.dress(); // tells at once whether all bones are there
    return skin;
  }

  begin(): void {
    this.used = 0;
  }

  /** Show one more figure; `false` when there are no more. */
  add(
    roots: Float32Array,
    rootAt: number,
    rotations: Float32Array,
    rotationAt: number,
    scale: number,
    colour: Color,
  ): boolean {
    if (this.used >= this.most) return false;
    const wearer = this.wearers[this.used] ?? this.dress();
    this.used++;
    wearer.object.visible = true;
    wearer.object.scale.setScalar(scale);
    const { bones } = wearer;
    bones[0]!.position.set(roots[rootAt]! / scale, roots[rootAt + 1]! / scale, roots[rootAt + 2]! / scale);
    for (let j = 0; j < bones.length; j++) {
      const r = rotationAt + 4 * j;
      bones[j]!.quaternion.set(rotations[r + 1]!, rotations[r + 2]!, rotations[r + 3]!, rotations[r]!);
    }
    for (const material of wearer.materials) material.color.copy(colour);
    return true;
  }

  end(): void {
    for (let i = this.used; i < this.wearers.length; i++) this.wearers[i]!.object.visible = false;
  }

  dispose(): void {
    for (const { object, materials } of this.wearers) {
      object.traverse((node) => {
        if (node instanceof SkinnedMesh) node.skeleton.dispose();
      });
      for (const material of materials) material.dispose();
    }
    this.model.traverse((node) => {
      if (node instanceof Mesh) node.geometry.dispose();
    });
  }

  private dress(): Wearer {
    const object = clone(this.model);
    const found = new Map<string, Bone>();
    const materials: MeshStandardMaterial[] = [];
    object.traverse((node) => {
      if ((node as Bone).isBone) found.set(node.name, node as Bone);
      if (node instanceof Mesh) {
        node.castShadow = node.receiveShadow = true;
        node.frustumCulled = false; // the bounds are those of the rest pose at the origin
        node.material = (node.material as Material).clone();
        const material = node.material as MeshStandardMaterial;
        material.roughness = 0.78;
        material.metalness = 0;
        materials.push(material);
      }
    });
    const bones = this.body.names.map((name) => {
      const bone = found.get(PropertyBinding.sanitizeNodeName(name));
      if (!bone) throw new Error(`the mannequin has no bone ${name}`);
      return bone;
    });
    const wearer = { object, bones, materials };
    this.wearers.push(wearer);
    this.group.add(object);
    return wearer;
  }
}
