/** Skinned figures, cloned for those who are nearest: the mannequin that the server makes, or a character's meshes. */

import {
  Camera,
  Color,
  Group,
  Light,
  type Material,
  Mesh,
  type MeshStandardMaterial,
  type Object3D,
  PropertyBinding,
  Quaternion,
  SkinnedMesh,
  Vector3,
} from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { clone } from "three/addons/utils/SkeletonUtils.js";
import type { CharacterPart } from "../protocol";
import type { Body } from "./body";

/** How a joint turns a node; nothing where it has none. */
interface Joint {
  node: Object3D;
  before: Quaternion;
  after: Quaternion;
}

interface Wearer {
  object: Object3D;
  joints: (Joint | null)[];
  materials: { material: MeshStandardMaterial; own: Color }[];
}

/** Triangles of all figures together; a heavy character is worn by fewer. */
const MOST_TRIANGLES = 600_000;

/** How much of a figure's colour a character's own materials take on. */
const TINT = 0.35;

export class Skin {
  readonly group = new Group();
  private readonly wearers: Wearer[] = [];
  private used = 0;

  private readonly place = new Vector3();
  private readonly turned = new Quaternion();

  private constructor(
    private readonly body: Body,
    private readonly model: Object3D,
    private readonly most: number,
    private readonly character: CharacterPart | null,
  ) {}

  /** Fetch the mannequin; an error where there is none or its bones are not the skeleton's. */
  static async load(url: string, body: Body, most: number): Promise<Skin> {
    const { scene } = await new GLTFLoader().loadAsync(url);
    const skin = new Skin(body, scene, most, null);
    skin.dress(); // tells at once whether all bones are there
    return skin;
  }

  /** Fetch the meshes of a character; an error where they are not what three reads. */
  static async wear(url: string, body: Body, most: number, character: CharacterPart): Promise<Skin> {
    const { scene, parser } = await new GLTFLoader().loadAsync(url);
    for (const number of character.nodes) {
      if (number < 0) continue;
      const node = (await parser.getDependency("node", number)) as Object3D; // the very object of the scene
      node.userData.node = number;
    }
    strip(scene, (await parser.getDependency("node", character.nodes[0]!)) as Object3D);
    let triangles = 0;
    scene.traverse((node) => {
      if (node instanceof Mesh) triangles += (node.geometry.index ?? node.geometry.attributes.position).count / 3;
    });
    const skin = new Skin(
      body,
      scene,
      Math.max(1, Math.min(most, Math.floor(MOST_TRIANGLES / Math.max(1, triangles)))),
      character,
    );
    skin.dress();
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
    const { joints } = wearer;
    const size = scale * (this.character?.size ?? 1);
    wearer.object.scale.setScalar(size);
    const place = this.place.set(roots[rootAt]!, roots[rootAt + 1]!, roots[rootAt + 2]!).divideScalar(size);
    if (this.character) {
      const { corner, turn, grown } = this.character;
      place
        .sub(new Vector3(...corner))
        .divideScalar(grown)
        .applyQuaternion(quaternion(turn).invert());
    }
    joints[0]!.node.position.copy(place);
    for (let j = 0; j < joints.length; j++) {
      const r = rotationAt + 4 * j;
      this.turned.set(rotations[r + 1]!, rotations[r + 2]!, rotations[r + 3]!, rotations[r]!);
      const joint = joints[j];
      if (joint) joint.node.quaternion.copy(joint.before).multiply(this.turned).multiply(joint.after);
    }
    for (const { material, own } of wearer.materials) {
      material.color.copy(colour);
      if (this.character) material.color.lerpColors(own, own.clone().multiply(colour), TINT);
    }
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
      for (const { material } of materials) material.dispose();
    }
    this.model.traverse((node) => {
      if (node instanceof Mesh) node.geometry.dispose();
    });
  }

  private dress(): Wearer {
    const object = clone(this.model);
    const materials: Wearer["materials"] = [];
    object.traverse((node) => {
      if (!(node instanceof Mesh)) return;
      node.castShadow = node.receiveShadow = true;
      node.frustumCulled = false; // the bounds are those of the rest pose at the origin
      const copies = (Array.isArray(node.material) ? node.material : [node.material]).map((material: Material) => {
        const copy = material.clone() as MeshStandardMaterial;
        if (!this.character) {
          copy.roughness = 0.78;
          copy.metalness = 0;
        }
        if (copy.color) materials.push({ material: copy, own: copy.color.clone() });
        return copy;
      });
      node.material = Array.isArray(node.material) ? copies : copies[0]!;
    });
    const wearer = {
      object,
      joints: this.character ? this.numbered(object, this.character) : this.named(object),
      materials,
    };
    this.wearers.push(wearer);
    this.group.add(object);
    return wearer;
  }

  /** Joints of the mannequin, whose nodes have their names and rest as they do. */
  private named(object: Object3D): Joint[] {
    return this.body.names.map((name) => {
      const node = object.getObjectByName(PropertyBinding.sanitizeNodeName(name));
      if (!node) throw new Error(`the mannequin has no bone ${name}`);
      return { node, before: new Quaternion(), after: new Quaternion() };
    });
  }

  /** Joints of a character, whose nodes rest at any angle. */
  private numbered(object: Object3D, character: CharacterPart): (Joint | null)[] {
    const found = new Map<number, Object3D>();
    object.traverse((node) => {
      if (typeof node.userData.node === "number") found.set(node.userData.node, node);
    });
    return character.nodes.map((number, j) => {
      if (number < 0) return null;
      const node = found.get(number);
      if (!node) throw new Error(`the scene of the character has no bone ${this.body.names[j]}`);
      return { node, before: quaternion(character.before[j]!), after: quaternion(character.after[j]!) };
    });
  }
}

/** Take away what is no part of a figure: lights, cameras, and meshes that neither hang from its root nor are skinned. */
function strip(scene: Object3D, root: Object3D): void {
  const inside = new Set<Object3D>();
  root.traverse((node) => inside.add(node));
  const away: Object3D[] = [];
  scene.traverse((node) => {
    const mesh = node instanceof Mesh && !(node instanceof SkinnedMesh) && !inside.has(node);
    if (node instanceof Light || node instanceof Camera || mesh) away.push(node);
  });
  for (const node of away) node.removeFromParent();
}

function quaternion([w, x, y, z]: readonly number[]): Quaternion {
  return new Quaternion(x, y, z, w);
}
